"""A track of known places -> the corners between its straight pieces (pure).

Only where legs begin and end, and how far along them a reading was taken, is made of the places: no direction.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STRAIGHT_SHARE = 0.05
"""How far off a straight line a piece may stray, as a share of the diagonal of the box around the track."""

NEAR_SHARE = 0.25
"""How far a track may pass a vertex of its plan, as a share of the plan's shortest leg."""


def straight_pieces(place_m: Array) -> NDArray[np.int64]:
    """(C,) the samples of a track (N, 2) at which its straight pieces begin and end, first and last included.

    Split at the sample farthest from the piece, until none is farther than may be (Douglas and Peucker, 1973).
    """
    far_m = STRAIGHT_SHARE * float(np.linalg.norm(np.ptp(place_m, axis=0)))
    corners, pieces = {0, len(place_m) - 1}, [(0, len(place_m) - 1)]
    while pieces:
        start, end = pieces.pop()
        if end - start < 2:
            continue
        off_m = _off_piece_m(place_m[start + 1 : end], place_m[start], place_m[end])
        middle = start + 1 + int(np.argmax(off_m))
        if off_m[middle - start - 1] > far_m:
            corners.add(middle)
            pieces += [(start, middle), (middle, end)]
    return np.array(sorted(corners), dtype=np.int64)


def passes(place_m: Array, vertices_m: Array) -> tuple[NDArray[np.int64], Array]:
    """Where a track (N, 2) passes the vertices (V, 2) of its plan, in their order: samples (V,), and how far off (V,).

    The samples with the least sum of squared distances, by dynamic programming. ValueError for fewer samples than
    vertices.
    """
    count = len(vertices_m)
    if len(place_m) < count:
        raise ValueError(f"place_m: expected at least {count} places, got {len(place_m)}")
    offset = place_m[None] - vertices_m[:, None]
    squared = (offset * offset).sum(axis=2)
    total, chosen = squared[0].copy(), []
    for row in squared[1:]:
        best = np.minimum.accumulate(total[:-1])
        at = np.maximum.accumulate(np.where(total[:-1] == best, np.arange(len(best)), 0))  # the last best so far
        chosen.append(np.concatenate([[0], at]))
        total = np.concatenate([[np.inf], best + row[1:]])
    corner = [int(np.argmin(total))]
    for back in reversed(chosen):
        corner.append(int(back[corner[-1]]))
    corners = np.array(corner[::-1], dtype=np.int64)
    return corners, np.sqrt(squared[np.arange(count), corners])


def _off_piece_m(place_m: Array, start_m: Array, end_m: Array) -> Array:
    """Distances (N,) of places from the straight piece between two of them, its ends included."""
    way = end_m - start_m
    squared = float(way @ way)
    along = np.clip((place_m - start_m) @ way / squared, 0.0, 1.0) if squared > 0.0 else np.zeros(len(place_m))
    return np.asarray(np.linalg.norm(place_m - start_m - along[:, None] * way, axis=1))
