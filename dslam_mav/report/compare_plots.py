"""Pictures of many flights in drawing units: realised against predicted, and what runs from flight to flight."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dslam_mav.report.log_axis import LogAxis, log_axis
from dslam_mav.report.numbers import significant

WIDTH = 600.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 76.0, 16.0, 12.0, 52.0
_SQUARE = 440.0
_TREND_HEIGHT = 190.0
_BAND = 2.0  # times: the band about the line of equals
_DATES = 3
_DATE_ROOM = 150.0


@dataclass(frozen=True, slots=True)
class Dot:
    """A flight: the predicted median and 90 %, what was realised, and whether that is an error against truth."""

    number: int
    name: str
    predicted_m: tuple[float, float]
    realised_m: float
    true: bool


@dataclass(frozen=True, slots=True)
class Mark:
    """A dot's place, the end of its predicted range, and what it says."""

    number: int
    x: float
    y: float
    x_90: float
    true: bool
    text: str


@dataclass(frozen=True, slots=True)
class Scatter:
    """Both axes alike, so that equals lie on the diagonal; `band` are the corners of factor two about it."""

    size: float
    x_axis: LogAxis
    y_axis: LogAxis
    diagonal: str
    band: str
    marks: tuple[Mark, ...]
    left_out: int


@dataclass(frozen=True, slots=True)
class Line:
    """A quantity of every flight; `mark` names its mark."""

    name: str
    mark: str
    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class TrendLine:
    """A line's path, broken where a value is not known, and its marks (flight, x, y, text)."""

    name: str
    mark: str
    path: str
    marks: tuple[tuple[int, float, float, str], ...]


@dataclass(frozen=True, slots=True)
class Trend:
    """Flights from the oldest to the newest, evenly spaced; `dates` are (x, text) of some of them."""

    title: str
    height: float
    left: float
    right: float
    top: float
    bottom: float
    axis: LogAxis
    lines: tuple[TrendLine, ...]
    dates: tuple[tuple[float, str], ...]


def scatter(dots: Sequence[Dot]) -> Scatter | None:
    """None where no flight has both a finite prediction and a result."""
    shown = [d for d in dots if _told(d.predicted_m[0]) and _told(d.realised_m)]
    if not shown:
        return None
    values = [v for d in shown for v in (*d.predicted_m, d.realised_m)]
    x_axis, y_axis = log_axis(values, _LEFT, _SQUARE), log_axis(values, _TOP + _SQUARE, -_SQUARE)
    assert x_axis is not None
    assert y_axis is not None
    low, high = x_axis.low, x_axis.high
    corners = [
        (low, low * _BAND),
        (low, low),
        (low * _BAND, low),
        (high, high / _BAND),
        (high, high),
        (high / _BAND, high),
    ]
    return Scatter(
        size=_SQUARE,
        x_axis=x_axis,
        y_axis=y_axis,
        diagonal=_path([(x_axis.units(v), y_axis.units(v)) for v in (low, high)]),
        band=_path([(x_axis.units(x), y_axis.units(y)) for x, y in corners]) + "Z",
        marks=tuple(_mark(d, x_axis, y_axis) for d in shown),
        left_out=len(dots) - len(shown),
    )


def trend(title: str, numbers: Sequence[int], dates: Sequence[str], lines: Sequence[Line]) -> Trend | None:
    """None with fewer than two flights, or where nothing is known of any."""
    bottom = _TOP + _TREND_HEIGHT
    axis = log_axis([v for line in lines for v in line.values], bottom, -_TREND_HEIGHT)
    if axis is None or len(numbers) < 2:
        return None
    right = WIDTH - _RIGHT
    step = (right - _LEFT - 40.0) / (len(numbers) - 1)
    place = [_LEFT + 20.0 + i * step for i in range(len(numbers))]
    drawn = [_line(line, numbers, place, axis) for line in lines]
    return Trend(
        title=title,
        height=bottom + _BOTTOM,
        left=_LEFT,
        right=right,
        top=_TOP,
        bottom=bottom,
        axis=axis,
        lines=tuple(line for line in drawn if line.marks),
        dates=_dates(place, dates),
    )


def _mark(dot: Dot, x_axis: LogAxis, y_axis: LogAxis) -> Mark:
    median, p90 = dot.predicted_m
    x = x_axis.units(median)
    end = x_axis.units(p90) if math.isfinite(p90) else x_axis.start + x_axis.length
    what = "error" if dot.true else "own ±"
    text = f"{dot.name}: predicted {significant(median, 2)} m, {what} {significant(dot.realised_m, 2)} m"
    return Mark(dot.number, x, y_axis.units(dot.realised_m), end, dot.true, text)


def _line(line: Line, numbers: Sequence[int], place: Sequence[float], axis: LogAxis) -> TrendLine:
    parts, pen, marks = [], "M", []
    for number, x, value in zip(numbers, place, line.values, strict=True):
        if not _told(value):
            pen = "M"
            continue
        y = axis.units(value)
        parts.append(f"{pen}{x:.1f} {y:.1f}")
        pen = "L"
        marks.append((number, x, y, f"{line.name} {significant(value, 2)}"))
    return TrendLine(line.name, line.mark, "".join(parts), tuple(marks))


def _dates(place: Sequence[float], dates: Sequence[str]) -> tuple[tuple[float, str], ...]:
    """The first's, the last's, and one between where there is room."""
    picked = sorted({round(i * (len(place) - 1) / (_DATES - 1)) for i in range(_DATES)})
    out: list[tuple[float, str]] = []
    for i in picked:
        if not out or place[i] - out[-1][0] >= _DATE_ROOM:
            out.append((place[i], dates[i]))
    return tuple(out)


def _path(points: Sequence[tuple[float, float]]) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _told(value: float) -> bool:
    return math.isfinite(value) and value > 0.0
