"""What the points of a sweep come to, group by group."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dslam_mav.records.arrays import Array
from dslam_mav.sweep.points.columns import Row

FAILED = "failed"
LEVELS = ("mission", "noise", "method")


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Points alike in `labels`. Errors and bounds are medians in metres, `error_p90_m` holds for 90 % of the points,
    all of the same points: those with an answer; NaN where there is none. `over_bound`: RMS of error over bound, of
    the points that found the truth; 1 is efficient. Shares are of all points whose truth is known.
    """

    labels: Mapping[str, str]
    points: int
    verdicts: Mapping[str, int]
    error_m: float
    error_p90_m: float
    bound_m: float
    over_bound: float
    found_share: float
    listed_share: float
    seconds: float


def grouped(rows: Sequence[Row], by: Sequence[str] = LEVELS) -> list[Group]:
    """One group for every combination of values of `by` that occurs, in the order they first do."""
    parts: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        parts.setdefault(tuple(str(row[name]) for name in by), []).append(row)
    return [_group(dict(zip(by, labels, strict=True)), part) for labels, part in parts.items()]


def _group(labels: Mapping[str, str], rows: Sequence[Row]) -> Group:
    verdicts = Counter(str(row["verdict"] or FAILED) for row in rows)
    told = [row for row in rows if row["source_error_rms_m"] is not None]
    error = numbers(told, "source_error_rms_m")
    return Group(
        labels,
        len(rows),
        dict(verdicts.most_common()),
        _percentile(error, 50.0),
        _percentile(error, 90.0),
        _percentile(numbers(told, "bound_m"), 50.0),
        _rms(numbers([row for row in told if row["found"]], "error_over_bound")),
        _share(rows, "found"),
        _share(rows, "listed"),
        _percentile(numbers(rows, "seconds"), 50.0),
    )


def numbers(rows: Sequence[Row], name: str) -> Array:
    """The column's values, of the rows that have one."""
    return np.array([row[name] for row in rows if row[name] is not None], dtype=np.float64)


def _percentile(values: Array, percent: float) -> float:
    return float(np.percentile(values, percent)) if values.size else float("nan")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def _share(rows: Sequence[Row], name: str) -> float:
    told = [bool(row[name]) for row in rows if row[name] is not None]
    return float(np.mean(told)) if told else float("nan")
