"""Readings in a CSV file, whoever wrote it: a table with a header line.

Which columns are read is said by "FIELD=NAME[*FACTOR][:UNIT],…". FIELD is time_s, value, east_m or north_m, and so are
the columns named where nothing is said. FACTOR or UNIT bring the logged unit to ours:
"time_s=Time:ms,value=Gas1L*-1,east_m=X,north_m=Y".
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dslam_mav.errors import BadInputError, unreadable
from dslam_mav.records.arrays import Array, read_only

FIELDS = ("time_s", "value", "east_m", "north_m")
DELIMITERS = ",;\t"


UNITS = {
    "time_s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "east_m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "ft": 0.3048},
}
UNITS["north_m"] = UNITS["east_m"]


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


def parse_columns(text: str | None, defaults: Mapping[str, Column] | None = None) -> dict[str, Column]:
    """The columns of the option "FIELD=NAME[*FACTOR],…" over the defaults; BadInputError names the part."""
    columns = dict(defaults or {})
    for part in (text or "").split(","):
        if not part.strip():
            continue
        field, found, name = (word.strip() for word in part.partition("="))
        if not found or field not in FIELDS or not name:
            raise BadInputError(f"--columns: {part.strip()}: expected FIELD=NAME with FIELD of {', '.join(FIELDS)}")
        name, unit = _unit(field, name)
        base, star, factor = name.rpartition("*")
        if not star:
            columns[field] = Column(name, unit)
            continue
        number = _number(factor)
        if number is None or number == 0.0 or not base:
            raise BadInputError(f"--columns: {part.strip()}: expected a number other than 0 after *, got {factor!r}")
        columns[field] = Column(base.strip(), number * unit)
    return columns


def _unit(field: str, name: str) -> tuple[str, float]:
    """The name without its unit, and what the unit is of ours; a colon before no unit of the field is of the name."""
    base, colon, unit = name.rpartition(":")
    factor = UNITS.get(field, {}).get(unit.strip()) if colon and base else None
    return (name, 1.0) if factor is None else (base.strip(), factor)


def read_csv(path: Path, columns: str | None = None) -> Series:
    """Readings in a CSV file with a header line; columns time_s, value and, where known, east_m, north_m."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise unreadable(path, error) from None
    except UnicodeDecodeError:
        raise BadInputError(f"{path}: expected text with columns, got other bytes") from None
    if not text.strip():
        raise BadInputError(f"{path}: is empty; expected a line of column names and readings below it")
    head = text.lstrip().partition("\n")[0]
    rows = csv.reader(io.StringIO(text), delimiter=max(DELIMITERS, key=head.count))
    header = [name.strip() for name in next(rows, [])]
    wanted = _columns(path, header, columns)
    lines = [_row(path, rows.line_num, row, wanted, header) for row in rows if any(map(str.strip, row))]
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


def _columns(path: Path, header: list[str], columns: str | None) -> dict[str, Column]:
    """The columns to read, in the order of FIELDS; places only where both are there."""
    asked = parse_columns(columns)
    wanted = {f: asked.get(f, Column(f)) for f in FIELDS}
    for field, column in wanted.items():
        if column.name not in header and (field in asked or field in ("time_s", "value")):
            name_it = "" if field in asked else f"; --columns {field}=NAME says which it is"
            raise BadInputError(f"{path}: line 1: column {column.name}: missing, it has {', '.join(header)}{name_it}")
    if not all(wanted[field].name in header for field in ("east_m", "north_m")):
        del wanted["east_m"], wanted["north_m"]
    return wanted


def _row(
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
