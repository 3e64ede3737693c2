"""Fisher information of the joint model: how well anything can be known (theory, section 9).

F = JᵀJ/σ² in the canonical gauge; F⁻¹ is the Cramér–Rao bound, reported as the covariance of every estimate. Its
near-null directions say what the readings cannot see. Local: other minima are the search's to find.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.problem import vertices

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


def source_blocks(covariance: Array, n_legs: int, k_sources: int) -> Array:
    """(K, 2, 2) covariance of each source's position."""
    first = n_legs - 1
    blocks = [
        covariance[first + 2 * k : first + 2 * k + 2, first + 2 * k : first + 2 * k + 2] for k in range(k_sources)
    ]
    return np.array(blocks)


def turned_blocks(covariance: Array, n_legs: int, s: Array) -> Array:
    """(K, 2, 2) the same where the last parameter is a turn of everything about the origin."""
    first, last = n_legs - 1, covariance.shape[0] - 1
    blocks = []
    for k, (x, y) in enumerate(s):
        index = [first + 2 * k, first + 2 * k + 1, last]
        moved = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
        blocks.append(moved @ covariance[np.ix_(index, index)] @ moved.T)
    return np.array(blocks)


def path_aligned(covariance: Array, theta: Array, length: Array, s: Array) -> Array:
    """(K, 2, 2) the same with the gauge fixed by the whole path: the least-squares motion of its vertices taken out.

    The first leg is a poor anchor: an error of its direction turns every source about the start.
    """
    n_legs, k_sources = length.size, s.shape[0]
    v = vertices(theta, length)
    n_par = covariance.shape[0]
    moved = np.zeros((2 * (n_legs + 1), n_par))
    for i in range(1, n_legs):
        moved[2 * (i + 1) :: 2, i - 1] = -length[i] * np.sin(theta[i])
        moved[2 * (i + 1) + 1 :: 2, i - 1] = length[i] * np.cos(theta[i])
    motion = np.linalg.pinv(_rigid(v)) @ moved
    places = np.zeros((2 * k_sources, n_par))
    places[:, n_legs - 1 : n_legs - 1 + 2 * k_sources] = np.eye(2 * k_sources)
    places -= _rigid(s) @ motion
    full = places @ covariance @ places.T
    return np.array([full[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(k_sources)])


def _rigid(points: Array) -> Array:
    """(2M, 3) what a small shift (x, y) and turn of the plane does to points (M, 2)."""
    rows = np.zeros((2 * len(points), 3))
    rows[0::2, 0] = 1.0
    rows[1::2, 1] = 1.0
    rows[0::2, 2] = -points[:, 1]
    rows[1::2, 2] = points[:, 0]
    return rows
