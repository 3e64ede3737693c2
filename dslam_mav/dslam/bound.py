"""Fisher information of the joint model: how well anything can be known (theory, section 9).

F = JᵀJ/σ² in the canonical gauge; F⁻¹ is the Cramér–Rao bound, reported as the covariance of every estimate, and
widened where the model bends within it (profile.py). Its near-null directions say what the readings cannot see. Local:
other minima are the search's to find.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.path import corners, path_columns
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import Layout, State

Array = NDArray[np.float64]

SINGULAR = 1e-13  # eigenvalues of the scaled information below this are no information at all
UNSEEN_SD = 1e9  # standard deviation, in the parameter's own scale, given to what is not seen


@dataclass(frozen=True, slots=True, eq=False)
class Information:
    """Covariance (P, P) and the directions that are not seen: columns of `unseen` (P, U), unit length when scaled."""

    covariance: Array
    unseen: Array


def information(jacobian: Array, noise_variance: float) -> Information:
    """Invert JᵀJ/σ² through its scaled eigenvectors, so that a singular one gives huge variances, not garbage."""
    size = np.sqrt((jacobian**2).sum(axis=0))
    scale = np.where(size > SINGULAR * size.max(), size, 1.0)
    values, vectors = np.linalg.eigh((jacobian / scale).T @ (jacobian / scale))
    blind = values <= SINGULAR * max(float(values[-1]), 1e-300)
    inverse = np.where(blind, UNSEEN_SD**2, noise_variance / np.where(blind, 1.0, values))
    covariance = (vectors * inverse) @ vectors.T / np.outer(scale, scale)
    return Information(covariance, vectors[:, blind])


def source_columns(at: Layout, k_sources: int) -> Array:
    """(K, d, P): what every unknown does to the sources' places."""
    d = (at.place.stop - at.place.start) // k_sources
    columns = np.zeros((k_sources, d, at.size))
    columns[:, :, at.place] = np.eye(k_sources * d).reshape(k_sources, d, k_sources * d)
    return columns


def blocks(columns: Array, covariance: Array) -> Array:
    """(M, d, d) covariance of each of M points, from what every unknown does to them (M, d, P)."""
    return np.asarray(np.einsum("map,pq,mbq->mab", columns, covariance, columns))


def aligned_columns(prob: Problem, state: State, at: Layout) -> Array:
    """(K, d, P) the sources' with the gauge fixed by the whole path: its vertices' least-squares motion taken out.

    The first leg is a poor anchor: an error of its direction turns every source about the start.
    """
    k_sources = len(state.s)
    moved = path_columns(prob, state, at)
    motion = np.linalg.pinv(_rigid(corners(prob, state))) @ moved.reshape(-1, at.size)
    taken = (_rigid(state.s) @ motion).reshape(k_sources, -1, at.size)
    return source_columns(at, k_sources) - taken


def _rigid(points: Array) -> Array:
    """(M·d, shifts and turns) what a small rigid motion does to points (M, d)."""
    n, d = points.shape
    planes = [(0, 1)] if d == 2 else [(0, 1), (0, 2), (1, 2)]
    rows = np.zeros((n, d, d + len(planes)))
    rows[:, :, :d] = np.eye(d)
    for i, (a, b) in enumerate(planes):
        rows[:, a, d + i] = -points[:, b]
        rows[:, b, d + i] = points[:, a]
    return rows.reshape(n * d, -1)
