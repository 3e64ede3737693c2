"""Gauges (Remark 3) and errors against truth (V-A).

The canonical gauge: b_1 = 0, first leg along +x, the first turn with |sin| > 1e-3 towards +y. An alignment here is
proper: it moves and turns, mirrors only as the gauge says, and never scales.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dslam_mav.records import Truth

Array = NDArray[np.float64]

MIN_TURN_SINE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """x ↦ rotation · (x − origin_m); an improper rotation exchanges left and right."""

    rotation: Array
    origin_m: Array

    def apply(self, points_m: ArrayLike) -> Array:
        """Points (M, 2) of the old frame in the new one."""
        return (np.asarray(points_m, dtype=np.float64) - self.origin_m) @ self.rotation.T

    def invert(self, points_m: ArrayLike) -> Array:
        """Points (M, 2) of the new frame in the old one."""
        return np.asarray(points_m, dtype=np.float64) @ self.rotation + self.origin_m


def to_canonical(vertices_m: ArrayLike) -> Alignment:
    """The alignment that brings a path (L+1, d) into the canonical gauge, d = 2 or 3."""
    vertices = np.asarray(vertices_m, dtype=np.float64)
    legs = np.diff(vertices, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    directions = legs[lengths > 0.0] / lengths[lengths > 0.0, None]
    if not len(directions):
        raise ValueError("vertices_m: expected at least one leg of positive length")
    return Alignment(_axes(directions), vertices[0].copy())


def _axes(directions: Array) -> Array:
    """(d, d) rows +x, +y(, +z) of the canonical gauge: each the first way a leg leaves the ones before."""
    d = directions.shape[1]
    rows = [directions[0]]
    for leg in directions[1:]:
        off = leg - sum(float(row @ leg) * row for row in rows)
        size = float(np.linalg.norm(off))
        if len(rows) < d and size > MIN_TURN_SINE:
            rows.append(off / size)
    while len(rows) < d:  # a straight or flat path: any axis that makes a proper rotation
        spare = np.linalg.svd(np.array(rows))[2][-1]
        last = np.linalg.det(np.array([*rows, spare])) if len(rows) == d - 1 else 1.0
        rows.append(spare * np.sign(last))
    return np.array(rows)


def truth_in_canonical(truth: Truth) -> Truth:
    """Truth of the scene's frame, seen in the canonical gauge of its own path."""
    alignment = to_canonical(truth.vertices_m)
    return Truth(alignment.apply(truth.source_position_m), truth.amplitude, alignment.apply(truth.vertices_m))
