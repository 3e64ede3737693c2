"""How the information grew leg by leg: the bound of the first legs as lines, what the flight knew as points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.growth import Growth, path_sd_m
from dslam_mav.dslam.scoring import has_positions, match
from dslam_mav.records import Estimate
from dslam_mav.report.log_axis import LogAxis, log_axis
from dslam_mav.report.numbers import significant

Array = NDArray[np.float64]

WIDTH, _LEFT, _RIGHT, _TOP, _HEIGHT = 600.0, 60.0, 52.0, 22.0, 240.0
_FIRST = 3  # legs: with fewer nothing can be said
_LABEL_ROOM = 18.0  # of a phone's larger letters
_MOST_TICKS = 12
_MARGIN = 22.0  # from the frame to the first and the last leg


@dataclass(frozen=True, slots=True)
class Point:
    """What was known after `leg` legs; `unsure`: another answer fitted as well."""

    leg: int
    x: float
    y: float
    unsure: bool
    text: str


@dataclass(frozen=True, slots=True)
class Series:
    """One source (`source` from 1), or the path (0): the bound's line, the points, where its label stands."""

    source: int
    name: str
    line: str
    points: tuple[Point, ...]
    label_y: float


@dataclass(frozen=True, slots=True)
class GrowthRow:
    """After so many legs: ± of every source and of the path as text, realised and by the bound."""

    legs: int
    realised: tuple[str, ...]
    bound: tuple[str, ...]
    verdict: str


@dataclass(frozen=True, slots=True)
class GrowthPlot:
    """The picture in drawing units, and the same as rows; `columns` are (leg, x) of every leg drawn."""

    width: float
    height: float
    left: float
    right: float
    top: float
    bottom: float
    axis: LogAxis
    columns: tuple[tuple[int, float], ...]
    column_width: float
    labelled: tuple[tuple[int, float], ...]
    unanswered: tuple[tuple[int, float], ...]
    series: tuple[Series, ...]
    rows: tuple[GrowthRow, ...]


def growth_plot(
    grown: Growth | None, estimate: Estimate, under_way: Sequence[tuple[int, Estimate]]
) -> GrowthPlot | None:
    """None where nothing was known at any time, or fewer than four legs were flown."""
    n_legs = len(estimate.path.heading_rad)
    if grown is None or n_legs <= _FIRST:
        return None
    told = [(legs, other) for legs, other in under_way if _FIRST <= legs <= n_legs]
    known = {legs: _sds(other, estimate) for legs, other in told if has_positions(other)}
    known[n_legs] = _sds(estimate, estimate)
    verdicts = {**{legs: other.verdict.name for legs, other in told}, n_legs: estimate.verdict.name}
    unsure = {legs for legs, other in told if other.alternatives} | ({n_legs} if estimate.alternatives else set())
    bound = np.column_stack([grown.source_sd_m, grown.path_sd_m])[_FIRST - 1 :]
    spread = estimate.spread_m
    shown = [v for v in (*bound.ravel(), *(v for own in known.values() for v in own)) if v < 30.0 * spread]
    axis = log_axis(shown, _TOP + _HEIGHT, -_HEIGHT)
    if axis is None:
        return None
    right = WIDTH - _RIGHT
    step = (right - _LEFT - 2.0 * _MARGIN) / (n_legs - _FIRST)
    place = {n: _LEFT + _MARGIN + (n - _FIRST) * step for n in range(_FIRST, n_legs + 1)}
    each = max(1, math.ceil(len(place) / _MOST_TICKS))
    answered = set(known)
    return GrowthPlot(
        width=WIDTH,
        height=_TOP + _HEIGHT + 46.0,
        left=_LEFT,
        right=right,
        top=_TOP,
        bottom=_TOP + _HEIGHT,
        axis=axis,
        columns=tuple(place.items()),
        column_width=step,
        labelled=tuple((n, x) for n, x in place.items() if (n - _FIRST) % each == 0),
        unanswered=tuple((n, place[n]) for n in sorted({legs for legs, _ in told} - answered)),
        series=_series(bound, known, unsure, place, axis),
        rows=_rows(bound, known, verdicts, place),
    )


def _sds(other: Estimate, final: Estimate) -> Array:
    """(K + 1,) ± of the final answer's sources, and of the path; NaN where the other has no such source."""
    own = np.full(len(final.sources) + 1, np.nan)
    own[-1] = path_sd_m(other)
    if other.sources.position_m.shape[1] == final.sources.position_m.shape[1]:
        theirs, mine = match(other.sources.position_m, final.sources.position_m)
        own[mine] = other.sd_m[theirs]
    return own


def _series(
    bound: Array, known: dict[int, Array], unsure: set[int], place: dict[int, float], axis: LogAxis
) -> tuple[Series, ...]:
    count = bound.shape[1]
    names = [*(f"S{k + 1}" for k in range(count - 1)), "path"]
    lines = [_line(bound[:, k], list(place.values()), axis) for k in range(count)]
    ends = [_end(bound[:, k], known, k, axis) for k in range(count)]
    labels = _apart(ends, axis)
    return tuple(
        Series(
            source=k + 1 if k < count - 1 else 0,
            name=names[k],
            line=lines[k],
            points=tuple(
                Point(n, place[n], axis.units(own[k]), n in unsure, f"{names[k]} ± {significant(own[k], 2)} m")
                for n, own in sorted(known.items())
                if axis.low <= own[k] <= axis.high
            ),
            label_y=labels[k],
        )
        for k in range(count)
    )


def _line(values: Array, x: list[float], axis: LogAxis) -> str:
    """SVG path data, broken where a value is beyond the axis."""
    parts, pen = [], "M"
    for value, at in zip(values, x, strict=True):
        if not 0.0 < value <= axis.high:
            pen = "M"
            continue
        parts.append(f"{pen}{at:.1f} {axis.units(float(value)):.1f}")
        pen = "L"
    return "".join(parts)


def _end(values: Array, known: dict[int, Array], k: int, axis: LogAxis) -> float:
    last = known[max(known)][k]
    value = last if np.isfinite(last) else values[-1]
    return axis.units(float(value)) if np.isfinite(value) and value > 0.0 else axis.start


def _apart(wanted: list[float], axis: LogAxis) -> list[float]:
    """Labels at their lines' ends, pushed apart downwards, then up again from the lower edge."""
    order = np.argsort(wanted)
    placed = [wanted[i] for i in order]
    for i in range(1, len(placed)):
        placed[i] = max(placed[i], placed[i - 1] + _LABEL_ROOM)
    floor = axis.start - 4.0
    for i in reversed(range(len(placed))):
        placed[i] = min(placed[i], floor)
        floor = placed[i] - _LABEL_ROOM
    out = [0.0] * len(placed)
    for i, y in zip(order, placed, strict=True):
        out[int(i)] = y
    return out


def _rows(
    bound: Array, known: dict[int, Array], verdicts: dict[int, str], place: dict[int, float]
) -> tuple[GrowthRow, ...]:
    unknown = np.full(bound.shape[1], np.nan)
    return tuple(
        GrowthRow(
            n,
            tuple(significant(float(v), 2) for v in known.get(n, unknown)),
            tuple(significant(float(v), 2) for v in bound[i]),
            verdicts.get(n, ""),
        )
        for i, n in enumerate(place)
    )
