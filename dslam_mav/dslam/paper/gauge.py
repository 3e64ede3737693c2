"""Remark 3: what the readings leave open, and how it is fixed.

Canonical: b_1 = 0, first leg along +x, the first turn with |sin| > 1e-3 towards +y; in 3-D the first leg that leaves
that plane towards +z. With known points of the path: Procrustes, proper or not as the points tell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.align import MIN_TURN_SINE, to_canonical

Array = NDArray[np.float64]

FLAT = 1e-9  # share of their extent by which points on a line may leave it


class Move(NamedTuple):
    """x ↦ rotation · (x − origin) + target; `mirror_known`: whether left and right are settled."""

    rotation: Array
    origin: Array
    target: Array
    mirror_known: bool

    def points(self, x: Array) -> Array:
        """Points (M, d) moved."""
        return np.asarray((x - self.origin) @ self.rotation.T + self.target)


def canonical(direction: Array) -> Move:
    """The turn of a path that begins at 0, with leg directions (L, d), into the canonical gauge."""
    d = direction.shape[1]
    if d == 2:
        plane = to_canonical(np.vstack((np.zeros((1, 2)), np.cumsum(direction, axis=0))))
        return Move(plane.rotation, np.zeros(2), np.zeros(2), mirror_known=False)
    axes = [direction[0]]
    for c in direction[1:]:
        off = c - sum((c @ axis) * axis for axis in axes)
        size = float(np.linalg.norm(off))
        if size > MIN_TURN_SINE:
            axes.append(off / size)
        if len(axes) == d:
            break
    # Directions never flown: completed to a right-handed frame.
    for unit in np.eye(d):
        if len(axes) == d:
            break
        off = unit - sum((unit @ axis) * axis for axis in axes)
        if np.linalg.norm(off) > 0.5:
            axes.append(off / np.linalg.norm(off))
    return Move(np.array(axes), np.zeros(d), np.zeros(d), mirror_known=False)


def procrustes(points: Array, known: Array) -> Move:
    """The motion of points (M, d) onto known ones, least squares; mirrored where they say so.

    Points on a line (in 3-D: in a plane) leave the mirror image open: then the motion is proper, it keeps left left.
    """
    d = points.shape[1]
    origin, target = points.mean(axis=0), known.mean(axis=0)
    left, values, right = np.linalg.svd((known - target).T @ (points - origin))
    extent = float(np.linalg.norm(known - target) * np.linalg.norm(points - origin))
    told = bool(values[d - 1] > FLAT * extent)
    sign = np.ones(d)
    if not told and np.linalg.det(left @ right) < 0.0:
        sign[-1] = -1.0
    return Move((left * sign) @ right, origin, target, told)
