"""Rows as Parquet (extra `parquet`)."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence

from dslam_mav.sweep.points.columns import Column, Row

MISSING = "results are Parquet, which needs pyarrow: pip install 'dslam-mav[parquet]'"


def available() -> bool:
    """Whether there is something to write it with."""
    return importlib.util.find_spec("pyarrow") is not None


def parquet_bytes(columns: Sequence[Column], rows: Sequence[Row], notes: Mapping[str, str]) -> bytes:
    """A Parquet file: one column each, of one type, with nulls; `notes` and what columns mean are in its metadata."""
    import pyarrow as pa
    from pyarrow import parquet

    types = {"text": pa.string(), "whole": pa.int64(), "number": pa.float64(), "truth": pa.bool_()}
    schema = pa.schema(
        [pa.field(c.name, types[c.kind], metadata={"description": c.what}) for c in columns], metadata=dict(notes)
    )
    sink = pa.BufferOutputStream()
    parquet.write_table(pa.Table.from_pylist(list(rows), schema=schema), sink, compression="zstd")
    return bytes(sink.getvalue().to_pybytes())
