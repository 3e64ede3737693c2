"""The map: reconstructed field, path and sources of one solution, truth beside it. Numbers, no markup."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.field import field
from dslam_mav.dslam.scoring import has_positions
from dslam_mav.records import Estimate, Truth
from dslam_mav.records.words import count
from dslam_mav.report import geometry as geo
from dslam_mav.report.colours import image_uri
from dslam_mav.report.numbers import nice_step, nice_ticks, significant, tick_labels

Array = NDArray[np.float64]

_WIDTH, _LEFT, _RIGHT, _TOP, _BOTTOM = 600.0, 60.0, 12.0, 10.0, 58.0
_ASPECT = (0.66, 1.0)
_IMAGE_COLUMNS = 264
_CONTOUR_COLUMNS = 88


@dataclass(frozen=True, slots=True)
class Mark:
    """A source: its place, its label's place, half axes and turn (degrees) of its 95 % ellipse if known."""

    x: float
    y: float
    label: str
    label_x: float
    label_y: float
    ellipse: tuple[float, float, float] | None


@dataclass(frozen=True, slots=True)
class FieldMap:
    """One map in drawing units, ready for the template."""

    width: float
    height: float
    window: geo.Window
    image: str
    contours: str
    x_ticks: tuple[tuple[float, str], ...]
    y_ticks: tuple[tuple[float, str], ...]
    x_title: str
    y_title: str
    path: str
    legs: tuple[str, ...]
    arrows: tuple[tuple[float, float, float], ...]
    leg_numbers: tuple[tuple[float, float, int], ...]
    sources: tuple[Mark, ...]
    truth_path: str
    truth_sources: tuple[tuple[float, float], ...]
    scale_bar: tuple[float, str]
    colour_ticks: tuple[tuple[float, str], ...]
    description: str


def common_window(estimates: Sequence[Estimate], truths: Sequence[Truth | None]) -> geo.Window:
    """One window for all solutions, so that they can be compared by eye."""
    shown = [e for e in estimates if has_positions(e)]
    points = [p[:, :2] for e in shown for p in (e.sources.position_m, e.path.vertices_m)]
    points += [p[:, :2] for t in truths if t is not None for p in (t.source_position_m, t.vertices_m)]
    spread = max((e.spread_m for e in shown if np.isfinite(e.spread_m)), default=0.0)
    everything = np.concatenate(points)
    span = float(np.ptp(everything, axis=0).max())
    margin = max(0.07 * span, min(0.45 * spread, 0.2 * span))
    return geo.fit_window(everything, margin, (_LEFT, _TOP), _WIDTH - _LEFT - _RIGHT, _ASPECT)


def field_map(estimate: Estimate, truth: Truth | None, window: geo.Window) -> FieldMap:
    """The map of one solution; `truth` is in the estimate's gauge already."""
    image, contours, colour_ticks = _field_picture(estimate, window)
    vertices = window.units(estimate.path.vertices_m)
    centres = window.units(estimate.sources.position_m)
    numbers = geo.place_leg_numbers(vertices, centres, 26.0)
    true_path = window.units(truth.vertices_m) if truth is not None else np.empty((0, 2))
    x_ticks = nice_ticks(window.low_x_m, window.high_x_m, 6)
    y_ticks = nice_ticks(window.low_y_m, window.high_y_m, 6)
    # A round length of at most a third of the map; rounding up grows it by no more than 2.5.
    bar_m = nice_step((window.high_x_m - window.low_x_m) / 7.5, 1)
    anchored = estimate.gauge == "anchored"
    return FieldMap(
        width=_WIDTH,
        height=window.top + window.height + _BOTTOM,
        window=window,
        image=image,
        contours=contours,
        x_ticks=_ticks(x_ticks, window.left - window.low_x_m * window.scale, window.scale),
        y_ticks=_ticks(y_ticks, window.top + window.height + window.low_y_m * window.scale, -window.scale),
        x_title="east of home (m)" if anchored else "x (m), along leg 1",
        y_title="north of home (m)" if anchored else "y (m)",
        path=geo.svg_path(vertices),
        legs=tuple(geo.svg_path(vertices[j : j + 2]) for j in range(len(vertices) - 1)),
        arrows=_arrows(vertices),
        leg_numbers=tuple((float(x), float(y), j + 1) for j, (x, y) in enumerate(numbers)),
        sources=_marks(estimate, window, vertices, true_path, numbers),
        truth_path=geo.svg_path(true_path),
        truth_sources=_points(window.units(truth.source_position_m)) if truth is not None else (),
        scale_bar=(bar_m * window.scale, f"{significant(bar_m, 2)} m"),
        colour_ticks=colour_ticks,
        description=_description(estimate, truth),
    )


def field_values(estimate: Estimate, x_m: Array, y_m: Array) -> Array:
    """(rows of y, columns of x): the field at the first reading, above ambient; in 3-D at the path's mean height."""
    sources = estimate.sources
    spread2 = np.where(sources.squared_spread_m2 > 0.0, sources.squared_spread_m2, estimate.spread_m**2)
    known = np.flatnonzero(np.isfinite(spread2) & (spread2 > 0.0))
    x, y = np.meshgrid(x_m, y_m)
    height_m = [np.full(x.size, height) for height in estimate.path.vertices_m.mean(axis=0)[2:]]
    points_m = np.column_stack([x.ravel(), y.ravel(), *height_m])
    return field(points_m, spread2[known], sources.position_m[known], sources.amplitude[known]).reshape(x.shape)


def _field_picture(estimate: Estimate, window: geo.Window) -> tuple[str, str, tuple[tuple[float, str], ...]]:
    """The image, its contour lines, and the colour bar's ticks as (share of the bar, label)."""
    values, _, _ = _sampled(estimate, window, _IMAGE_COLUMNS, edge=0.5)
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    if not high > low:
        high = low + 1.0
    ticks = nice_ticks(low, high, 6)
    coarse, x, y = _sampled(estimate, window, _CONTOUR_COLUMNS, edge=0.0)  # so that lines end at the frame
    corners = window.units(np.array([[x[0], y[0]], [x[-1], y[-1]]]))
    x_units = np.linspace(corners[0, 0], corners[1, 0], x.size)
    y_units = np.linspace(corners[0, 1], corners[1, 1], y.size)
    contours = "".join(geo.contour_path(coarse, level, x_units, y_units) for level in ticks if low < level < high)
    bar = tuple((float((t - low) / (high - low)), label) for t, label in zip(ticks, tick_labels(ticks), strict=True))
    return image_uri((values - low) / (high - low)), contours, bar


def _sampled(estimate: Estimate, window: geo.Window, columns: int, edge: float) -> tuple[Array, Array, Array]:
    """The field on a grid that begins `edge` steps inside the window, top row first; x of columns, y of rows."""
    rows = max(2, round(columns * window.height / window.width))
    across, down = (np.linspace(edge, n - 1 + edge, n) / (n - 1 + 2.0 * edge) for n in (columns, rows))
    x = window.low_x_m + across * (window.high_x_m - window.low_x_m)
    y = window.high_y_m - down * (window.high_y_m - window.low_y_m)
    return field_values(estimate, x, y), x, y


def _marks(
    estimate: Estimate, window: geo.Window, vertices: Array, true_path: Array, numbers: Array
) -> tuple[Mark, ...]:
    centres = window.units(estimate.sources.position_m)
    bounds = (window.left, window.top, window.left + window.width, window.top + window.height)
    labels = geo.place_labels(centres, (vertices, true_path), numbers, 24.0, bounds)
    marks = []
    for k, (centre, label) in enumerate(zip(centres, labels, strict=True)):
        axes = geo.ellipse(estimate.position_covariance_m2[k][:2, :2])
        # The drawing's y points down, so the turn changes sign.
        drawn = None if axes is None else (axes[0] * window.scale, axes[1] * window.scale, -float(np.degrees(axes[2])))
        marks.append(Mark(centre[0], centre[1], f"S{k + 1}", label[0], label[1], drawn))
    return tuple(marks)


def _arrows(vertices: Array) -> tuple[tuple[float, float, float], ...]:
    """Arrow heads (x, y, turn in degrees) a little past the middle of each leg."""
    legs = np.diff(vertices, axis=0)
    places = vertices[:-1] + 0.56 * legs
    turns = np.degrees(np.arctan2(legs[:, 1], legs[:, 0]))
    return tuple((float(x), float(y), float(turn)) for (x, y), turn in zip(places, turns, strict=True))


def _ticks(values: Array, offset: float, scale: float) -> tuple[tuple[float, str], ...]:
    return tuple((offset + float(v) * scale, label) for v, label in zip(values, tick_labels(values), strict=True))


def _points(points: Array) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in points)


def _description(estimate: Estimate, truth: Truth | None) -> str:
    sources = ", ".join(
        f"S{k + 1} at ({significant(p[0], 3)}, {significant(p[1], 3)}) m"
        for k, p in enumerate(estimate.sources.position_m)
    )
    beside = " Truth is drawn beside it." if truth is not None else ""
    legs = len(estimate.path.heading_rad)
    return f"Map of the field with a path of {count(legs, 'leg')} and the sources {sources}.{beside}"
