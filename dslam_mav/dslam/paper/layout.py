"""What passes between the steps after the legs: paired projections in, directions and sources out.

K sources, L legs, d dimensions. Lengths are in the unit the readings' distances are in; b_1 = 0 throughout.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Projections(NamedTuple):
    """Y (K, L), A (K, L), C (K, L), one row for each source, with the variances of Y and ln A; `length` (L,).

    `c_first` (K,): C at the flight's first reading.
    """

    y: Array
    a: Array
    c: Array
    var_y: Array
    var_ln_a: Array
    c_first: Array
    length: Array
    dimensions: int

    @property
    def ln_height(self) -> Array:
        """(K, L) ln(A (πC)^{d/2}) = ln a − d²/C   (8), with π and C kept."""
        return np.asarray(np.log(self.a) + 0.5 * self.dimensions * np.log(np.pi * self.c))


class Layout(NamedTuple):
    """Directions c (L, d), sources S (K, d), ln a (K,); `how`: the step that found it.

    `rounded`: it leaves no more than rounding of any reading.
    """

    direction: Array
    source: Array
    ln_amplitude: Array
    how: str
    rounded: bool = False


class Failure(NamedTuple):
    """A step that has no answer, and why, as a sentence; `searched`: it had answers, but none that can be."""

    reason: str
    searched: bool = False


def vertices(direction: Array, length: Array) -> Array:
    """(L+1, d): b_1 = 0 and b_{j+1} = b_j + l_j c_j   (2)."""
    steps = length[:, None] * direction
    return np.vstack((np.zeros((1, direction.shape[1])), np.cumsum(steps, axis=0)))


def sources_from(direction: Array, p: Projections) -> Array:
    """(K, d): c_jᵀ S_k = Y_kj + c_jᵀ b_j for all legs (last display of III-C; (31) with two), by least squares.

    PAPER DEVIATION: each leg counts by how surely its centre is known; the paper weighs all alike.
    """
    b = vertices(direction, p.length)[:-1]
    right = p.y + np.einsum("jd,jd->j", direction, b)
    found = np.empty((len(p.y), direction.shape[1]))
    for k, variance in enumerate(p.var_y):
        weight = 1.0 / np.sqrt(variance + np.median(variance) + 1e-300)
        found[k] = np.linalg.lstsq(direction * weight[:, None], right[k] * weight, rcond=None)[0]
    return found


def squared_offsets(direction: Array, source: Array, p: Projections) -> Array:
    """(K, L): d²_kj = |S_k − b_j|² − Y²_kj, with Y from the layout itself so that it cannot be negative."""
    b = vertices(direction, p.length)[:-1]
    to_source = source[:, None, :] - b[None, :, :]
    along = np.einsum("kjd,jd->kj", to_source, direction)
    return np.asarray(np.maximum((to_source**2).sum(axis=2) - along**2, 0.0))


def ln_amplitudes(direction: Array, source: Array, p: Projections) -> Array:
    """(K,): ln a_k = ln(A_kj (πC)^{d/2}) + d²_kj/C from (8), legs weighed by how surely each tells it."""
    d2 = squared_offsets(direction, source, p)
    place = np.median(p.var_y, axis=1)[:, None]  # how surely a source is placed, roughly: across the leg as along it
    weight = 1.0 / (p.var_ln_a + (4.0 * d2 / p.c**2) * place + place / p.c)
    return np.asarray((weight * (p.ln_height + d2 / p.c)).sum(axis=1) / weight.sum(axis=1))


def complete(direction: Array, p: Projections, how: str) -> Layout:
    """Sources and amplitudes for known directions."""
    source = sources_from(direction, p)
    return Layout(direction, source, ln_amplitudes(direction, source, p), how)
