"""The readings of a flight as a table, in CSV or Parquet.

| column | what |
| --- | --- |
| `time_s` | seconds since the flight's first leg began; before it negative |
| `value` | the reading, in the sensor's unit |
| `leg` | the leg it was taken on, counted from 1; empty for readings outside the legs |
| `distance_m` | how far along its leg, metres; empty outside |
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from dslam_mav.errors import BadInputError
from dslam_mav.legs import FlownLeg

Array = NDArray[np.float64]

COLUMNS = ("time_s", "value", "leg", "distance_m")


@dataclass(frozen=True, slots=True, eq=False)
class ReadingTable:
    """All readings in order of time: `time_s`, `value`, `distance_m` (N,), `leg` (N,) int64; outside legs `leg` is 0
    and `distance_m` NaN.
    """

    time_s: Array
    value: Array
    leg: NDArray[np.int64]
    distance_m: Array


def reading_table(legs: Sequence[FlownLeg], time_ms: NDArray[np.int64], value: Array) -> ReadingTable:
    """The table of all readings `value` (N,) at `time_ms` (N,), rising, of which some lie on `legs`."""
    leg = np.zeros(time_ms.size, dtype=np.int64)
    distance_m = np.full(time_ms.size, np.nan)
    for number, flown in enumerate(legs, 1):
        at = np.searchsorted(time_ms, flown.time_ms)
        leg[at] = number
        distance_m[at] = flown.distance_m
    zero_ms = legs[0].zero_ms if legs else 0
    return ReadingTable((time_ms - zero_ms) / 1000.0, value, leg, distance_m)


def csv_bytes(table: ReadingTable) -> bytes:
    """The table as CSV with a header line; every number reads back as it was."""
    lines = [",".join(COLUMNS)]
    rows = zip(table.time_s.tolist(), table.value.tolist(), table.leg.tolist(), table.distance_m.tolist(), strict=True)
    for time_s, value, leg, distance_m in rows:
        lines.append(f"{time_s!r},{value!r},{leg},{distance_m!r}" if leg else f"{time_s!r},{value!r},,")
    return ("\n".join(lines) + "\n").encode()


def parquet_bytes(table: ReadingTable) -> bytes:
    """The table as Parquet, empty cells null; BadInputError where pyarrow is not installed."""
    if find_spec("pyarrow") is None:
        raise BadInputError("--to parquet: needs pyarrow; install it with: pip install 'dslam-mav[parquet]'")
    import pyarrow as pa
    import pyarrow.parquet as pq

    outside = table.leg == 0
    columns = {
        "time_s": pa.array(table.time_s),
        "value": pa.array(table.value),
        "leg": pa.array(table.leg, mask=outside),
        "distance_m": pa.array(table.distance_m, mask=outside),
    }
    out = io.BytesIO()
    pq.write_table(pa.table(columns), out)
    return out.getvalue()
