"""Logged readings (.csv, .tlog, .mcap) played again by time from the flight's start.

Which columns or messages are read is said by `columns`: "FIELD=NAME[*FACTOR],…". FIELD is time_s, value,
east_m or north_m. NAME is a CSV column; in a .tlog a field of a MAVLink message
("SCALED_PRESSURE2.temperature", "NAMED_VALUE_FLOAT.THERMAL"), of one sender with "@SYSTEM/COMPONENT" behind;
in a .mcap the reading's name. FACTOR brings the logged unit to ours:
"time_s=Time*0.001,value=Gas1L,east_m=X,north_m=Y".
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dslam_mav.errors import BadInputError
from dslam_mav.records import read_only
from sim_bridge.fields.field import Array

FIELDS = ("time_s", "value", "east_m", "north_m")
DEFAULT_VALUE = "NAMED_VALUE_FLOAT.THERMAL"


@dataclass(frozen=True, slots=True)
class Column:
    """Where a field comes from, and what brings it to SI units."""

    name: str
    factor: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Readings `value` (N,) at strictly increasing `time_s` (N,); `place_m` (N, 2) east, north where known.

    `dropped` counts logged readings that were no later than the one before them (repeats, a second link).
    """

    time_s: Array
    value: Array
    place_m: Array | None = None
    dropped: int = 0

    def __post_init__(self) -> None:
        n = len(self.time_s)
        object.__setattr__(self, "time_s", read_only(self.time_s, "time_s", (None,)))
        object.__setattr__(self, "value", read_only(self.value, "value", (n,)))
        if self.place_m is not None:
            object.__setattr__(self, "place_m", read_only(self.place_m, "place_m", (n, 2)))
        if n < 2 or not (np.diff(self.time_s) > 0.0).all():
            raise ValueError(f"time_s: expected at least 2 strictly increasing times, got {n} times")

    @property
    def duration_s(self) -> float:
        """From the first reading to the last."""
        return float(self.time_s[-1] - self.time_s[0])


class LoggedField:
    """A series replayed by time, whatever the place: linear between readings, NaN after the last."""

    def __init__(self, series: Series) -> None:
        self.duration_s = series.duration_s
        self._time_s = series.time_s - series.time_s[0]
        self._value = series.value

    def read(self, time_s: Array, place_m: Array) -> Array:  # noqa: ARG002 - a log knows no other place
        """Readings (M,) at `time_s` (M,) seconds after the first leg's start."""
        return np.asarray(np.interp(time_s, self._time_s, self._value, left=np.nan, right=np.nan))


def parse_columns(text: str | None, defaults: Mapping[str, Column] | None = None) -> dict[str, Column]:
    """The columns of the option "FIELD=NAME[*FACTOR],…" over the defaults; BadInputError names the part."""
    columns = dict(defaults or {})
    for part in (text or "").split(","):
        if not part.strip():
            continue
        field, found, name = (word.strip() for word in part.partition("="))
        if not found or field not in FIELDS or not name:
            raise BadInputError(f"--columns: {part.strip()}: expected FIELD=NAME with FIELD of {', '.join(FIELDS)}")
        base, star, factor = name.rpartition("*")
        if not star:
            columns[field] = Column(name)
            continue
        number = _number(factor)
        if number is None or number == 0.0 or not base:
            raise BadInputError(f"--columns: {part.strip()}: expected a number other than 0 after *, got {factor!r}")
        columns[field] = Column(base.strip(), number)
    return columns


def read_series(path: Path, columns: str | None = None) -> Series:
    """The readings logged in a .csv, .tlog or .mcap file; BadInputError names file, place and value."""
    readers = {".csv": read_csv, ".tlog": _read_tlog, ".mcap": _read_mcap}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise BadInputError(f"{path}: expected a .csv, .mcap or .tlog file, got {path.suffix or 'no ending'!r}")
    return reader(path, columns)


def read_csv(path: Path, columns: str | None = None) -> Series:
    """Readings in a CSV file with a header line; columns time_s, value and, where known, east_m, north_m."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise BadInputError(f"{path}: expected text with columns, got other bytes") from None
    rows = csv.reader(io.StringIO(text))
    header = [name.strip() for name in next(rows, [])]
    wanted = _csv_columns(path, header, columns)
    lines = [_csv_row(path, rows.line_num, row, wanted, header) for row in rows if any(map(str.strip, row))]
    table = np.array([values for _, values in lines], dtype=np.float64).reshape(-1, len(wanted))
    if len(table) < 2:
        raise BadInputError(f"{path}: expected at least 2 lines of readings, got {len(table)}")
    late = np.flatnonzero(np.diff(table[:, 0]) <= 0.0)
    if late.size:
        line, values = lines[int(late[0]) + 1]
        raise BadInputError(
            f"{path}: line {line}: {wanted['time_s'].name}: expected later than the line before, got {values[0]:g} s"
        )
    return Series(table[:, 0], table[:, 1], table[:, 2:4] if len(wanted) == len(FIELDS) else None)


def _csv_columns(path: Path, header: list[str], columns: str | None) -> dict[str, Column]:
    """The columns to read, in the order of FIELDS; places only where both are there."""
    asked = parse_columns(columns)
    wanted = {f: asked.get(f, Column(f)) for f in FIELDS}
    for field, column in wanted.items():
        if column.name not in header and (field in asked or field in ("time_s", "value")):
            raise BadInputError(f"{path}: line 1: column {column.name}: missing, it has {', '.join(header) or 'none'}")
    if not all(wanted[field].name in header for field in ("east_m", "north_m")):
        del wanted["east_m"], wanted["north_m"]
    return wanted


def _csv_row(
    path: Path, line: int, row: list[str], wanted: dict[str, Column], header: list[str]
) -> tuple[int, list[float]]:
    values = []
    for column in wanted.values():
        at = header.index(column.name)
        word = row[at].strip() if at < len(row) else ""
        number = _number(word)
        if number is None:
            raise BadInputError(f"{path}: line {line}: {column.name}: expected a finite number, got {word!r}")
        values.append(number * column.factor)
    return line, values


def _number(word: str) -> float | None:
    try:
        number = float(word)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


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
