"""Plane geometry of the pictures: the window, contour lines, ellipses, and where labels fit. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CHI2_95_TWO_DOF = 5.991464547107979  # the 95 % quantile of χ² with 2 degrees of freedom


@dataclass(frozen=True, slots=True)
class Window:
    """A rectangle of metres in one of drawing units; y grows upwards in metres, downwards in units."""

    low_x_m: float
    low_y_m: float
    scale: float  # drawing units per metre
    left: float
    top: float
    width: float
    height: float

    @property
    def high_x_m(self) -> float:
        """Right edge in metres."""
        return self.low_x_m + self.width / self.scale

    @property
    def high_y_m(self) -> float:
        """Upper edge in metres."""
        return self.low_y_m + self.height / self.scale

    def units(self, points_m: Array) -> Array:
        """Metres (M, 2) -> drawing units (M, 2)."""
        points = np.asarray(points_m, dtype=np.float64)[:, :2]
        x = self.left + (points[:, 0] - self.low_x_m) * self.scale
        y = self.top + self.height - (points[:, 1] - self.low_y_m) * self.scale
        return np.stack([x, y], axis=1)


def fit_window(
    points_m: Array, margin_m: float, corner: tuple[float, float], width: float, aspect: tuple[float, float]
) -> Window:
    """The window at `corner` (upper left) that shows all points; height / width stays within `aspect`."""
    low, high = points_m[:, :2].min(axis=0) - margin_m, points_m[:, :2].max(axis=0) + margin_m
    span = np.maximum(high - low, 1e-9)
    ratio = float(np.clip(span[1] / span[0], *aspect))
    scale = min(width / span[0], ratio * width / span[1])
    height = ratio * width
    middle = 0.5 * (low + high)
    return Window(
        low_x_m=float(middle[0] - 0.5 * width / scale),
        low_y_m=float(middle[1] - 0.5 * height / scale),
        scale=float(scale),
        left=corner[0],
        top=corner[1],
        width=width,
        height=height,
    )


def svg_path(points: Array, closed: bool = False) -> str:
    """SVG path data of a polyline (M, 2) in drawing units, to a tenth of a unit."""
    if not len(points):
        return ""
    text = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
    return f"M{text}{'Z' if closed else ''}"


def svg_dots(points: Array) -> str:
    """SVG path data of points (M, 2): zero-length strokes, round when the stroke's caps are."""
    return "".join(f"M{x:.1f} {y:.1f}h0" for x, y in points)


def ellipse(covariance: Array, chi2: float = CHI2_95_TWO_DOF) -> tuple[float, float, float] | None:
    """Half axes and major axis' angle (rad, counter-clockwise) of a (2, 2) covariance; None if unknown."""
    if not np.isfinite(covariance).all():
        return None
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    if values[1] <= 0.0:
        return None
    minor, major = np.sqrt(chi2 * np.maximum(values, 0.0))
    return float(major), float(minor), float(np.arctan2(vectors[1, 1], vectors[0, 1]))


def contour_path(values: Array, level: float, x: Array, y: Array) -> str:
    """SVG path data of the line `values` (rows along y, columns along x) = `level`, by marching squares."""
    above = values > level
    corners = (values[:-1, :-1], values[:-1, 1:], values[1:, 1:], values[1:, :-1])
    mixed = above[:-1, :-1] ^ above[:-1, 1:] | above[1:, 1:] ^ above[1:, :-1] | above[:-1, :-1] ^ above[1:, 1:]
    rows, columns = np.nonzero(mixed)
    v = np.stack([c[rows, columns] for c in corners], axis=1)
    corner_x = np.stack([x[columns], x[columns + 1], x[columns + 1], x[columns]], axis=1)
    corner_y = np.stack([y[rows], y[rows], y[rows + 1], y[rows + 1]], axis=1)
    nxt = np.roll(np.arange(4), -1)
    crosses = (v > level) ^ (v[:, nxt] > level)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(crosses, (level - v) / (v[:, nxt] - v), 0.0)
    cut_x = corner_x + share * (corner_x[:, nxt] - corner_x)
    cut_y = corner_y + share * (corner_y[:, nxt] - corner_y)
    parts = []
    for cx, cy, hit in zip(cut_x, cut_y, crosses, strict=True):
        # Two cut edges make one segment; a saddle has four and makes two.
        edges = np.flatnonzero(hit)
        parts += [
            f"M{cx[a]:.1f} {cy[a]:.1f}L{cx[b]:.1f} {cy[b]:.1f}" for a, b in zip(edges[::2], edges[1::2], strict=True)
        ]
    return "".join(parts)


def distance_to_segments(point: Array, polyline: Array) -> float:
    """The least distance of a point (2,) to a polyline (M, 2)."""
    if len(polyline) < 2:
        return np.inf
    start, along = polyline[:-1], np.diff(polyline, axis=0)
    square = np.maximum((along * along).sum(axis=1), 1e-12)
    share = np.clip(((point - start) * along).sum(axis=1) / square, 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * along - point, axis=1).min())


def place_leg_numbers(vertices: Array, keep_clear: Array, room: float) -> Array:
    """(L, 2) places of the legs' numbers: near its start, clear of `keep_clear` and of one another."""
    taken = np.concatenate([keep_clear, np.full((max(len(vertices) - 1, 0), 2), np.inf)])
    share = np.array([0.16, 0.24, 0.32, 0.42, 0.1, 0.6, 0.75])[:, None]
    for j, (start, end) in enumerate(pairwise(vertices), start=len(keep_clear)):
        candidates = start + share * (end - start)
        nearest = np.sqrt(((candidates[:, None] - taken[:j]) ** 2).sum(axis=2).min(axis=1, initial=np.inf))
        taken[j] = candidates[int(np.argmax(np.minimum(room, nearest)))]
    return np.asarray(taken[len(keep_clear) :])


def place_labels(
    marks: Array,
    lines: Sequence[Array],
    taken: Array,
    reach: float,
    bounds: tuple[float, float, float, float],
) -> Array:
    """(K, 2) centres of labels beside their marks, where there is most room from lines, marks and edges."""
    obstacles = [*taken, *marks]
    directions = np.radians([45, 315, 135, 225, 0, 180, 90, 270, 22, 338, 158, 202])
    left, top, right, bottom = bounds
    places = []
    for mark in marks:
        best, best_room = mark, -np.inf
        for far in (1.0, 1.6):
            for direction in directions:
                spot = mark + far * reach * np.array([np.cos(direction), -np.sin(direction)])
                edge = min(spot[0] - left, right - spot[0], spot[1] - top, bottom - spot[1])
                room = min(
                    [0.6 * edge, reach, _nearest(spot, obstacles)] + [distance_to_segments(spot, q) for q in lines]
                )
                if room - 2.0 * far > best_room:
                    best, best_room = spot, room - 2.0 * far
        obstacles.append(best)
        places.append(best)
    return np.array(places).reshape(-1, 2)


def _nearest(point: Array, others: Sequence[Array]) -> float:
    if not len(others):
        return float("inf")
    return float(np.sqrt(((np.asarray(others) - point) ** 2).sum(axis=1).min()))
