"""Where a mission may fly: inside every inclusion polygon, outside every keep-out. Pure geometry, metres.

Circles are polygons too: drawn inside the circle they bound where they include, about it where they keep out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

CIRCLE_SIDES = 36
TOUCH_M = 1e-6
SAMPLES = 64  # of a leg
ROOM_HALVINGS = 10  # of the extent: to a thousandth


@dataclass(frozen=True, slots=True, eq=False)
class Fence:
    """`within` and `keep_out`: polygons (V, 2), corners in order, closed by themselves. No `within`: no outer bound."""

    within: tuple[Array, ...] = ()
    keep_out: tuple[Array, ...] = ()

    @property
    def polygons(self) -> tuple[Array, ...]:
        """All of them."""
        return (*self.within, *self.keep_out)

    def extent(self) -> tuple[Array, Array]:
        """Lowest and highest [east, north] that all inclusion polygons share; they may share none (low > high)."""
        low = np.max([p.min(axis=0) for p in self.within], axis=0)
        high = np.min([p.max(axis=0) for p in self.within], axis=0)
        return low, high

    def allows(self, points_m: ArrayLike) -> Flags:
        """(n,) whether places (n, 2) may be flown over."""
        return self.clearance(points_m)[0] >= -TOUCH_M

    def clearance(self, points_m: ArrayLike) -> tuple[Array, Array]:
        """(n,) metres to the nearest bound, negative where it is crossed, and (n, 2) the way to more of it."""
        points = np.asarray(points_m, dtype=np.float64)
        best, way = np.full(len(points), np.inf), np.zeros_like(points)
        for polygon in self.polygons:
            sign = 1.0 if any(polygon is p for p in self.within) else -1.0
            distance, towards = _to_edge(polygon, points)
            inside = contains(polygon, points)
            signed = sign * np.where(inside, distance, -distance)
            # towards the edge where it is on the wrong side, away from it where on the right one
            gain = np.where((signed < 0.0)[:, None], towards, -towards)
            nearer = signed < best
            best = np.where(nearer, signed, best)
            way = np.where(nearer[:, None], gain, way)
        return best, way

    def room(self, wanted_m: float) -> float:
        """Metres a place has to all bounds: of the first found with `wanted_m` or more, else the most there is."""
        if not self.within:
            return math.inf
        low, high = self.extent()
        half = 0.5 * (high - low)
        if not (half > 0.0).all():
            return -math.inf
        middles, most = (0.5 * (low + high))[None], -math.inf
        for _ in range(ROOM_HALVINGS):
            clear = self.clearance(middles)[0]
            most = max(most, float(clear.max()))
            # no place of a box is farther from the bounds than its middle by more than half the diagonal
            hopeful = middles[clear + np.linalg.norm(half) > most]
            if most >= wanted_m or not len(hopeful):
                break
            half = 0.5 * half
            quarters = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
            middles = (hopeful[:, None] + quarters).reshape(-1, 2)
        return most

    def lets_pass(self, vertices_m: ArrayLike, margin_m: float = 0.0) -> bool:
        """Whether every leg of the path (L+1, 2) lies where it may, exactly."""
        path = np.asarray(vertices_m, dtype=np.float64)
        if not self.polygons:
            return True
        u = np.linspace(0.0, 1.0, SAMPLES)[None, :, None]  # a leg that slips through a corner crosses no edge
        along = (path[:-1, None] + u * np.diff(path, axis=0)[:, None]).reshape(-1, 2)
        if not (self.clearance(along)[0] >= margin_m - TOUCH_M).all():
            return False
        gaps = [_gap(path, polygon, margin_m) for polygon in self.polygons]
        return bool(min(gaps) >= margin_m - TOUCH_M)


def box(extent_m: Sequence[float], centre_m: Sequence[float] = (0.0, 0.0)) -> Array:
    """(4, 2) corners of an upright box."""
    half, middle = 0.5 * np.asarray(extent_m), np.asarray(centre_m)
    return np.asarray(middle + half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]))


def circle(centre_m: Sequence[float], radius_m: float, *, keep_out: bool) -> Array:
    """A polygon that lies inside the circle, or about it where it keeps out."""
    angle = 2.0 * math.pi * np.arange(CIRCLE_SIDES) / CIRCLE_SIDES
    radius = radius_m / math.cos(math.pi / CIRCLE_SIDES) if keep_out else radius_m
    return np.asarray(centre_m) + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def area_m2(polygon: Array) -> float:
    """What a polygon that does not cross itself encloses."""
    x, y = polygon.T
    return float(0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def crosses_itself(polygon: Array) -> bool:
    """Whether two edges that are no neighbours meet."""
    n = len(polygon)
    for i in range(n):
        later = [j for j in range(i + 2, n) if (j + 1) % n != i]
        if later:
            a, b = polygon[[i]], polygon[[(i + 1) % n]]
            if _crossing(a, b, polygon[later], polygon[[(j + 1) % n for j in later]]).any():
                return True
    return False


def contains(polygon: Array, points: Array) -> Flags:
    """(n,) whether the points lie in the polygon, by how often a ray to the east meets its edges."""
    x, y = points[:, 0][:, None], points[:, 1][:, None]
    (x1, y1), (x2, y2) = polygon.T, np.roll(polygon, -1, axis=0).T
    spans = (y1 > y) != (y2 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        meets = x < x1 + (y - y1) * (x2 - x1) / (y2 - y1)
    return np.asarray((spans & meets).sum(axis=1) % 2 == 1)


def _to_edge(polygon: Array, points: Array) -> tuple[Array, Array]:
    """(n,) distance to the nearest edge and (n, 2) the direction to it."""
    a, edge = polygon, np.roll(polygon, -1, axis=0) - polygon
    off = points[:, None] - a[None]
    share = np.clip((off * edge).sum(axis=2) / np.maximum((edge**2).sum(axis=1), 1e-300), 0.0, 1.0)
    to = share[:, :, None] * edge - off
    distance = np.linalg.norm(to, axis=2)
    nearest = distance.argmin(axis=1)
    rows = np.arange(len(points))
    least = distance[rows, nearest]
    return least, to[rows, nearest] / np.maximum(least, 1e-12)[:, None]


def _gap(path: Array, polygon: Array, margin_m: float) -> float:
    """Least distance between legs and edges: 0 where they meet, else from the corners of one to the other."""
    after = np.roll(polygon, -1, axis=0)
    for a, b in pairwise(path):
        if _crossing(a[None], b[None], polygon, after).any():
            return -np.inf
    if margin_m <= 0.0:
        return 0.0
    legs = np.stack([path[:-1], path[1:]], axis=1)
    return float(min(_to_edge(leg, polygon)[0].min() for leg in legs))


def _crossing(a: Array, b: Array, c: Array, d: Array) -> Flags:
    """Whether the open segments a–b and c–d cross (touching is none)."""

    def side(p: Array, q: Array, r: Array) -> Array:
        scale = np.linalg.norm(q - p, axis=1) + 1e-300
        across = (q[:, 0] - p[:, 0]) * (r[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (r[:, 0] - p[:, 0])
        distance = across / scale
        return np.where(np.abs(distance) < TOUCH_M, 0.0, distance)

    return np.asarray((side(a, b, c) * side(a, b, d) < 0.0) & (side(c, d, a) * side(c, d, b) < 0.0))
