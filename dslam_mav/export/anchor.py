"""An answer on the ground: from its own gauge to places in WGS-84, once home and the first heading are known.

The canonical gauge leaves open where leg 1 begins, which way it goes, and to which side the first turn is. Who knows
the first two alone gets the answer and its mirror image, marked as such.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pymap3d
from numpy.typing import NDArray

from dslam_mav.mission import Home
from dslam_mav.records import Estimate

Array = NDArray[np.float64]

INSIDE = 0.95
RIM = 72
"""Corners of a circle as drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """Where the answer lies: `start_m` (2,) leg 1's begin, east and north of `home`, and leg 1's direction
    `heading_rad`, counter-clockwise from east. `left`: the first turn is to the left; None: nobody knows.
    """

    home: Home
    start_m: Array
    heading_rad: float
    left: bool | None


@dataclass(frozen=True, slots=True, eq=False)
class PlacedSource:
    """A source on the map. `radius_m`: the circle that holds it with 95 % (NaN: not known); the 95 % ellipse has
    semi-axes `axes_m`, the longer one towards `axis_deg`, clockwise from north.
    """

    position_m: Array
    radius_m: float
    axes_m: tuple[float, float]
    axis_deg: float
    amplitude: float
    peak_reading: float
    activation_s: float
    sd_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """One solution on the map, metres east and north of home. `mirrored`: the mirror image of another one here."""

    name: str
    mirrored: bool
    log_likelihood: float
    path_m: Array
    sources: tuple[PlacedSource, ...]


def solutions(estimate: Estimate, anchor: Anchor | None) -> Iterator[Solution]:
    """The answer, its alternatives, and where the first turn's side is unknown the mirror image of each.

    `anchor` None: the estimate is anchored already.
    """
    others = [(f"alternative {n}", other) for n, other in enumerate(estimate.alternatives, 1)]
    for name, each in [("answer", estimate), *others]:
        if not np.isfinite(each.sources.position_m).all():
            continue
        if anchor is None:
            yield _solution(name, False, each, np.eye(2), np.zeros(2))
            continue
        sides = (True, False) if anchor.left is None else (anchor.left,)
        for left in sides:
            mirrored = anchor.left is None and not left
            title = f"{name}, mirror image" if mirrored else name
            yield _solution(title, mirrored, each, _rotation(anchor.heading_rad, left), anchor.start_m)


def to_wgs84(points_m: Array, home: Home) -> Array:
    """(N, 2) longitude and latitude, degrees, of points (N, 2) east and north of home; not wrapped at ±180°."""
    latitude, longitude, _ = pymap3d.enu2geodetic(
        points_m[:, 0], points_m[:, 1], 0.0, home.latitude_deg, home.longitude_deg, 0.0
    )
    turns = np.round((np.asarray(longitude) - home.longitude_deg) / 360.0)
    return np.column_stack([np.asarray(longitude) - 360.0 * turns, np.asarray(latitude)])


def circle_m(centre_m: Array, radius_m: float) -> Array:
    """(RIM + 1, 2) a circle, counter-clockwise and closed."""
    angle = np.linspace(0.0, 2.0 * np.pi, RIM + 1)
    angle[-1] = 0.0
    return np.asarray(centre_m + radius_m * np.column_stack([np.cos(angle), np.sin(angle)]))


def circle_radius_m(covariance_m2: Array, inside: float = INSIDE) -> float:
    """Radius of the circle around the mean that a normal error (2, 2) stays in with probability `inside`.

    The radial integral is closed, the one over directions a sum; NaN where the covariance is not finite.
    """
    if not np.isfinite(covariance_m2).all():
        return math.nan
    low, high = np.maximum(np.linalg.eigvalsh(covariance_m2), 0.0)
    if high <= 0.0:
        return 0.0
    ratio = max(low / high, 1e-12)
    angle = np.linspace(0.0, np.pi, 4096, endpoint=False)
    # by the angle t of the whitened error, x = (√high r cos t, √low r sin t): |x|² = r² high (cos² + ratio sin²)
    squared = np.cos(angle) ** 2 + ratio * np.sin(angle) ** 2
    small, large = 0.0, 5.0
    for _ in range(60):
        middle = 0.5 * (small + large)
        held = float(np.mean(1.0 - np.exp(-0.5 * middle * middle / squared)))
        small, large = (middle, large) if held < inside else (small, middle)
    return math.sqrt(high) * large


def _rotation(heading_rad: float, left: bool) -> Array:
    """From the canonical gauge, whose first turn is to the left, to the ground."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    side = 1.0 if left else -1.0
    return np.array([[cos, -sin * side], [sin, cos * side]])


def _solution(name: str, mirrored: bool, estimate: Estimate, rotation: Array, start_m: Array) -> Solution:
    sources, sd_m = estimate.sources, estimate.sd_m
    placed = []
    for k in range(len(sources)):
        covariance = rotation @ estimate.position_covariance_m2[k][:2, :2] @ rotation.T
        axes_m, axis_deg = _ellipse(covariance)
        placed.append(
            PlacedSource(
                rotation @ sources.position_m[k, :2] + start_m,
                circle_radius_m(covariance), axes_m, axis_deg,
                float(sources.amplitude[k]), float(sources.peak_reading[k]), float(sources.activation_s[k]),
                float(sd_m[k]),
            )
        )  # fmt: skip
    path_m = estimate.path.vertices_m[:, :2] @ rotation.T + start_m
    return Solution(name, mirrored, estimate.log_likelihood, path_m, tuple(placed))


def _ellipse(covariance_m2: Array) -> tuple[tuple[float, float], float]:
    if not np.isfinite(covariance_m2).all():
        return (math.nan, math.nan), math.nan
    variance, axes = np.linalg.eigh(covariance_m2)
    scale = -2.0 * math.log(1.0 - INSIDE)  # χ² with two degrees of freedom
    minor, major = np.sqrt(scale * np.maximum(variance, 0.0))
    east, north = axes[:, 1]
    return (float(major), float(minor)), math.degrees(math.atan2(east, north)) % 180.0
