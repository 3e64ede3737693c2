"""Which candidates differ (theory, section 8, step 5), and by how much."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.tables import OPTIONS, Array, Indices

Path = tuple[Array, Array, Array]


@njit(**OPTIONS)
def distinct(marks: Array, keep: int, tolerance: float) -> Indices:
    """Indices of the first `keep` rows of `marks` (B, M), given best first, that differ by more than `tolerance`."""
    batch, size = marks.shape
    chosen = np.empty(min(keep, batch), dtype=np.int64)
    count = 0
    for b in range(batch):
        same = False
        for i in range(count):
            same = True
            for m in range(size):
                if abs(marks[b, m] - marks[chosen[i], m]) >= tolerance:
                    same = False
                    break
            if same:
                break
        if not same:
            chosen[count] = b
            count += 1
            if count == keep:
                break
    return chosen[:count]


@njit(**OPTIONS)
def farthest_apart(s: Array, other_s: Array, path: Path, other: Path) -> float:
    """The largest distance from a source (K, 2) to the other answer's nearest, or between corners of straight legs.

    A path is headings (L,), lengths (L,) and how far each leg begins beside the corner (L, 2).
    """
    largest = 0.0
    for a in range(s.shape[0]):
        nearest = np.inf
        for b in range(other_s.shape[0]):
            nearest = min(nearest, (s[a, 0] - other_s[b, 0]) ** 2 + (s[a, 1] - other_s[b, 1]) ** 2)
        largest = max(largest, nearest)
    x, y = 0.0, 0.0
    for j in range(path[0].size):
        x += path[1][j] * math.cos(path[0][j]) - other[1][j] * math.cos(other[0][j]) + path[2][j, 0] - other[2][j, 0]
        y += path[1][j] * math.sin(path[0][j]) - other[1][j] * math.sin(other[0][j]) + path[2][j, 1] - other[2][j, 1]
        largest = max(largest, x * x + y * y)
    return math.sqrt(largest)
