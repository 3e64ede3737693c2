"""Readings against resynthesised readings, leg by leg (the paper's Fig. 8 d), with residuals. Numbers only.

Few readings are drawn as points; many as one stroke per pixel column from the least to the greatest, so that
a million readings look the same and stay small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.records import Estimate, Flight, Leg
from dslam_mav.report import geometry as geo
from dslam_mav.report.numbers import nice_ticks, tick_labels

Array = NDArray[np.float64]

MAX_PANELS = 60
_POINTS_IN_ALL = 9000  # drawn over all legs together; beyond it, legs are drawn as strokes
_STROKES_IN_ALL = 7000
_MODEL_VERTICES = 200
_DENSE = 150  # readings on a leg from which on their points are drawn finer
_PAST_CORNER = 0.005  # share of the axis; readings nearer to a corner's line than this are at the corner

WIDTH, _LEFT, _RIGHT = 290.0, 54.0, 4.0
_SHORT, _DIGIT = 4, 6.4  # characters of a label that _LEFT has room for, and the room of each more
_READING = (8.0, 120.0)  # top and height of the upper panel
_RESIDUAL = (140.0, 56.0)


@dataclass(frozen=True, slots=True)
class Axis:
    """A range of values on a range of drawing units, and its labelled ticks."""

    low: float
    high: float
    start: float
    length: float  # negative: values grow upwards
    ticks: tuple[tuple[float, str], ...]

    def units(self, values: Array) -> Array:
        """Values -> drawing units."""
        return self.start + (np.asarray(values) - self.low) / (self.high - self.low) * self.length


@dataclass(frozen=True, slots=True)
class LegPanel:
    """One leg as SVG path data: points or strokes, the model's line, residuals and those beyond the panel.

    `corners` are the places of the path's corners (drawing units) that readings lie past: overshoot and hover.
    """

    number: int
    length_m: float
    heading_rad: float
    readings: int
    residual_rms: float
    reading_path: str
    residual_path: str
    as_strokes: bool
    dense: bool
    model_path: str
    beyond: tuple[tuple[float, float, bool], ...]
    corners: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class LegPlots:
    """All panels on common axes; `residual_axis` and `noise_band` (y, height) are None without a model."""

    panels: tuple[LegPanel, ...]
    x_axis: Axis
    reading_axis: Axis
    residual_axis: Axis | None
    noise_band: tuple[float, float] | None
    left_out: int


def leg_plots(flight: Flight, estimate: Estimate) -> LegPlots | None:
    """The panels of a flight; None where there is no reading at all."""
    legs = [leg for leg in flight.legs if leg.reading.size]
    if not legs:
        return None
    residuals = residual_by_leg(flight, estimate)
    low = min(float(leg.reading.min()) for leg in legs)
    high = max(float(leg.reading.max()) for leg in legs)
    pad = 0.06 * ((high - low) or abs(high) or 1.0)
    reading_axis = _axis(low - pad, high + pad, (_READING[0] + _READING[1], -_READING[1]), 6, False)
    residual_axis = None if residuals is None else _residual_axis(np.concatenate(residuals), estimate.noise_sd)
    left = _left(reading_axis, residual_axis)
    x_axis = _axis(
        min(0.0, *(float(leg.distance_m.min()) for leg in legs)),
        max(max(leg.length_m, float(leg.distance_m.max())) for leg in legs),
        (left + 4.0, WIDTH - left - _RIGHT - 8.0),
        5,
        False,
    )
    shown = min(MAX_PANELS, len(flight.legs))
    panels = [
        _panel(
            flight,
            estimate,
            j,
            None if residuals is None else residuals[j],
            (x_axis, reading_axis, residual_axis),
        )
        for j in range(shown)
    ]
    return LegPlots(
        panels=tuple(panels),
        x_axis=x_axis,
        reading_axis=reading_axis,
        residual_axis=residual_axis,
        noise_band=_noise_band(residual_axis, estimate.noise_sd),
        left_out=len(flight.legs) - shown,
    )


def _left(*axes: Axis | None) -> float:
    """Where the panels begin, so that the longest label of these axes stays clear of their names."""
    longest = max(len(label) for axis in axes if axis is not None for _, label in axis.ticks)
    return _LEFT + _DIGIT * max(0, longest - _SHORT)


def residual_by_leg(flight: Flight, estimate: Estimate) -> list[Array] | None:
    """The residuals of each leg; None where the estimate has none for these readings."""
    if estimate.residual.size != flight.n_readings or not np.isfinite(estimate.residual).all():
        return None
    return np.split(estimate.residual, np.cumsum([leg.reading.size for leg in flight.legs])[:-1])


def thinned(x: Array, y: Array, columns: int) -> tuple[Array, Array, Array]:
    """One stroke per column that holds a point: its x, the least and the greatest y (drawing units)."""
    start, stop = float(x.min()), float(x.max())
    width = (stop - start) / columns or 1.0
    column = np.minimum(((x - start) / width).astype(np.intp), columns - 1)
    low, high = np.full(columns, np.inf), np.full(columns, -np.inf)
    np.minimum.at(low, column, y)
    np.maximum.at(high, column, y)
    used = np.flatnonzero(low <= high)
    centre: Array = np.asarray(start + (used + 0.5) * width, dtype=np.float64)
    return centre, low[used], high[used]


def _panel(
    flight: Flight, estimate: Estimate, j: int, residual: Array | None, axes: tuple[Axis, Axis, Axis | None]
) -> LegPanel:
    leg, (x_axis, reading_axis, residual_axis) = flight.legs[j], axes
    legs = max(1, min(MAX_PANELS, len(flight.legs)))
    as_strokes = leg.reading.size > max(120, _POINTS_IN_ALL // legs)
    columns = int(np.clip(_STROKES_IN_ALL // legs, 60, 224))
    x = x_axis.units(leg.distance_m)
    model, residual_path = "", ""
    beyond: tuple[tuple[float, float, bool], ...] = ()
    if residual is not None and residual_axis is not None and residual.size:
        model = _model_path(x, reading_axis.units(leg.reading - residual))
        inside = np.clip(residual, residual_axis.low, residual_axis.high)
        y = residual_axis.units(inside)
        residual_path = _data_path(x, y, as_strokes, columns)
        beyond = tuple(
            (float(x[i]), float(y[i]), bool(residual[i] > 0.0)) for i in np.flatnonzero(inside != residual)[:40]
        )
    headings = estimate.path.heading_rad
    return LegPanel(
        number=j + 1,
        length_m=leg.length_m,
        heading_rad=float(headings[j]) if j < headings.size else float("nan"),
        readings=leg.reading.size,
        residual_rms=float(np.sqrt(np.mean(residual**2))) if residual is not None and residual.size else float("nan"),
        reading_path=_data_path(x, reading_axis.units(leg.reading), as_strokes, columns),
        residual_path=residual_path,
        as_strokes=as_strokes,
        dense=leg.reading.size > _DENSE,
        model_path=model,
        beyond=beyond,
        corners=_corners_passed(leg, x_axis),
    )


def _corners_passed(leg: Leg, axis: Axis) -> tuple[float, ...]:
    if not leg.distance_m.size:
        return ()
    near = _PAST_CORNER * (axis.high - axis.low)
    passed = (leg.distance_m.min() < -near, leg.distance_m.max() > leg.length_m + near)
    places = axis.units(np.array([0.0, leg.length_m]))
    return tuple(float(place) for place, past in zip(places, passed, strict=True) if past)


def _data_path(x: Array, y: Array, as_strokes: bool, columns: int) -> str:
    if not x.size:
        return ""
    if not as_strokes:
        return geo.svg_dots(np.stack([x, y], axis=1))
    centre, low, high = thinned(x, y, columns)
    return "".join(f"M{c:.1f} {a:.1f}V{max(b, a + 0.4):.1f}" for c, a, b in zip(centre, low, high, strict=True))


def _model_path(x: Array, y: Array) -> str:
    """The model's line in the order flown: smooth, so evenly picked readings carry it."""
    pick = np.unique(np.linspace(0, x.size - 1, min(x.size, _MODEL_VERTICES)).round().astype(np.intp))
    return geo.svg_path(np.stack([x[pick], y[pick]], axis=1))


def _residual_axis(residual: Array, noise_sd: float) -> Axis:
    """Symmetric, wide enough for the noise and for all but wild residuals, which are marked at the edge."""
    rms = float(np.sqrt(np.mean(residual**2)))
    scale = max(noise_sd if np.isfinite(noise_sd) else 0.0, rms)
    reach = max(3.0 * scale, min(float(np.abs(residual).max()), 6.0 * scale)) * 1.08 or 1e-9
    return _axis(-reach, reach, (_RESIDUAL[0] + _RESIDUAL[1], -_RESIDUAL[1]), 4, True)


def _noise_band(axis: Axis | None, noise_sd: float) -> tuple[float, float] | None:
    if axis is None or not (np.isfinite(noise_sd) and noise_sd > 0.0):
        return None
    upper, lower = axis.units(np.array([min(noise_sd, axis.high), max(-noise_sd, axis.low)]))
    return float(upper), float(lower - upper)


def _axis(low: float, high: float, place: tuple[float, float], about: int, symmetric: bool) -> Axis:
    start, length = place
    ticks = nice_ticks(low, high, about)
    if symmetric:
        while ticks.size < 3:  # zero alone is no scale
            about *= 2
            ticks = nice_ticks(low, high, about)
        ticks = np.array([ticks[0], 0.0, ticks[-1]])
    units = start + (ticks - low) / (high - low) * length
    labelled = tuple((float(u), label) for u, label in zip(units, tick_labels(ticks), strict=True))
    return Axis(low, high, start, length, labelled)
