"""The straight part of a leg, and the line it lies on (pure).

A vehicle comes out of a corner sideways and swings round the next one. What was read there lies beside the line that
the rest of the leg was flown on, by metres where legs are forty: it is set aside. The line is found in the leg's own
displacement, from scalars that turning or mirroring the frame leaves alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ASIDE_SHARE = 1.0 / 1000.0
"""Readings farther beside the line than this share of the leg are not of its straight part …"""

ASIDE_MEDIANS = 3.0
"""… where that is also so many times the median, …"""

UNSTEADY_SHARE = 1.0 / 500.0
UNSTEADY_MEDIANS = 5.0
"""… or so many where the median is beyond that share: there corners are not told so well from the rest."""

LEAST_SHARE = 0.5
"""A leg of whose way less would stay has no straight part: all stay."""

ROUNDS = 10


def straight_part(along_m: Array, across_m: Array, length_m: float) -> tuple[float, float, Mask]:
    """Of places `along_m` (N,) and `across_m` (N,) from the leg's chord, offset at the chord's start and slope of the
    line that most of the way lies on, and which readings (N,) lie on it: all of them where most of it lies on none.

    Each reading counts by the way flown about it: a vehicle that waits or turns on the spot flies none.
    """
    every = np.ones(along_m.size, dtype=np.bool_)
    way_m = np.abs(np.gradient(along_m)) if along_m.size > 1 else np.zeros(along_m.size)
    line, on_line = _line(along_m, across_m, way_m), every
    for _ in range(ROUNDS):
        beside = np.abs(across_m - line[0] - line[1] * along_m)
        near = beside <= _aside_m(beside, way_m, length_m)
        if way_m[near].sum() < LEAST_SHARE * way_m.sum() or np.array_equal(near, on_line):
            break
        line, on_line = _line(along_m, across_m, way_m * near), near
    return *line, on_line


def _aside_m(beside_m: Array, way_m: Array, length_m: float) -> float:
    median_m = 0.0
    if way_m.any():
        order = np.argsort(beside_m, kind="stable")
        share = np.cumsum(way_m[order])
        median_m = float(beside_m[order][np.searchsorted(share, 0.5 * share[-1])])
    times = ASIDE_MEDIANS if median_m <= UNSTEADY_SHARE * length_m else UNSTEADY_MEDIANS
    return max(ASIDE_SHARE * length_m, times * median_m)


def _line(along_m: Array, across_m: Array, weight: Array) -> tuple[float, float]:
    """Offset and slope of the weighted least-squares line through the places."""
    total = float(weight.sum())
    if total == 0.0:
        return 0.0, 0.0
    middle, mean = float((weight * along_m).sum()) / total, float((weight * across_m).sum()) / total
    s = along_m - middle
    spread = float((weight * s * s).sum())
    slope = float((weight * s * (across_m - mean)).sum()) / spread if spread > 0.0 else 0.0
    return mean - slope * middle, slope
