"""Logged readings (.csv, .tlog, .mcap) played again by time from the flight's start.

Which columns or messages are read is said by `columns`: "FIELD=NAME[*FACTOR][:UNIT],…". FIELD is time_s, value,
east_m or north_m. NAME is a CSV column; in a .tlog a field of a MAVLink message
("SCALED_PRESSURE2.temperature", "NAMED_VALUE_FLOAT.THERMAL"), of one sender with "@SYSTEM/COMPONENT" behind;
in a .mcap the reading's name. FACTOR brings the logged unit to ours:
"time_s=Time*0.001,value=Gas1L,east_m=X,north_m=Y".
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dslam_mav.errors import BadInputError
from dslam_mav.series import Column, Series, parse_columns, read_csv
from sim_bridge.fields.field import Array

DEFAULT_VALUE = "NAMED_VALUE_FLOAT.THERMAL"


class LoggedField:
    """A series replayed by time, whatever the place: linear between readings, NaN after the last."""

    def __init__(self, series: Series) -> None:
        self.duration_s = series.duration_s
        self._time_s = series.time_s - series.time_s[0]
        self._value = series.value

    def read(self, time_s: Array, place_m: Array) -> Array:  # noqa: ARG002 - a log knows no other place
        """Readings (M,) at `time_s` (M,) seconds after the first leg's start."""
        return np.asarray(np.interp(time_s, self._time_s, self._value, left=np.nan, right=np.nan))


def read_series(path: Path, columns: str | None = None) -> Series:
    """The readings logged in a .csv, .tlog or .mcap file; BadInputError names file, place and value."""
    readers = {".csv": read_csv, ".tlog": _read_tlog, ".mcap": _read_mcap}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise BadInputError(f"{path}: expected a .csv, .mcap or .tlog file, got {path.suffix or 'no ending'!r}")
    return reader(path, columns)


def _read_tlog(path: Path, columns: str | None) -> Series:
    from sim_bridge.fields.recorded_tlog import samples

    column = _value_column(path, columns, DEFAULT_VALUE)
    return _series(path, column, samples(path, column.name))


def _read_mcap(path: Path, columns: str | None) -> Series:
    from dslam_mav.log.reader import read_log

    column = _value_column(path, columns, "THERMAL")
    readings = [reading for _, reading in read_log(path).readings]
    names = sorted({reading.name for reading in readings})
    if column.name not in names:
        raise BadInputError(f"{path}: value {column.name}: not in this log, it has {', '.join(names) or 'none'}")
    return _series(path, column, ((r.time_boot_ms / 1e3, r.value) for r in readings if r.name == column.name))


def _value_column(path: Path, columns: str | None, default: str) -> Column:
    found = parse_columns(columns, {"value": Column(default)})
    for field in found:
        if field != "value":
            raise BadInputError(f"--columns: {field}: {path} has times of its own, only value can be chosen")
    return found["value"]


def _series(path: Path, column: Column, samples: Iterator[tuple[float, float]]) -> Series:
    """The samples (seconds, value) that come in order; repeats and late ones are dropped and counted."""
    time_s: list[float] = []
    value: list[float] = []
    dropped = 0
    for at_s, sample in samples:
        if not math.isfinite(sample):
            raise BadInputError(f"{path}: {column.name}: expected finite values, got {sample} at {at_s:.3f} s")
        if time_s and at_s <= time_s[-1]:
            dropped += 1
            continue
        time_s.append(at_s)
        value.append(sample * column.factor)
    if len(time_s) < 2:
        raise BadInputError(f"{path}: {column.name}: expected at least 2 readings, got {len(time_s)}")
    return Series(np.array(time_s), np.array(value), dropped=dropped)
