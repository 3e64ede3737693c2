"""What small rigid motions do to points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rigid(points: Array) -> Array:
    """(M·d, motions) what shifts and turns in the plane do to points (M, d)."""
    return rigid_of(points).reshape(points.size, -1)


def rigid_of(points: Array) -> Array:
    """(…, d, d + 1) the same, point by point. Turns about the vertical only: climbs are known."""
    d = points.shape[-1]
    rows = np.zeros((*points.shape, d + 1))
    rows[..., :d] = np.eye(d)
    rows[..., 0, d] = -points[..., 1]
    rows[..., 1, d] = points[..., 0]
    return rows
