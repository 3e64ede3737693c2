"""The joint fit of the plain case, compiled: the search's workhorse where C is unknown.

Free of Python's lock, two threads run two fits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.plain_model import Flown, medium_of, residual_of
from dslam_mav.dslam.kernels.tables import OPTIONS, Array

SINGULAR = 1e-14  # a pivot below this: the damped matrix, of unit diagonal, is not positive


class Damping(NamedTuple):
    """How the fit steps; the largest changes of a heading, a place (in spreads) and a logarithm in one step."""

    first: float
    least: float
    most: float
    probe: float
    bend: float
    gain: float
    heading: float
    place: float
    log: float


@njit(**OPTIONS)
def normal_of(columns: Array, size: Array, matrix: Array) -> None:
    """JᵀJ scaled to a unit diagonal, and the columns' lengths."""
    across = np.ascontiguousarray(columns.T)
    n_par, n = across.shape
    for p in range(n_par):
        for q in range(p + 1):
            total = 0.0
            for i in range(n):
                total += across[p, i] * across[q, i]
            matrix[p, q] = total
        size[p] = math.sqrt(matrix[p, p]) if matrix[p, p] > 0.0 else 1.0
    for p in range(n_par):
        for q in range(p + 1):
            matrix[p, q] /= size[p] * size[q]


@njit(**OPTIONS)
def factor(matrix: Array, damping: float, chol: Array) -> bool:
    """Cholesky of matrix + λ·1; False where it is not positive."""
    for p in range(matrix.shape[0]):
        for q in range(p + 1):
            total = matrix[p, q] + (damping if p == q else 0.0)
            for i in range(q):
                total -= chol[p, i] * chol[q, i]
            if p > q:
                chol[p, q] = total / chol[q, q]
            elif total > SINGULAR:
                chol[p, p] = math.sqrt(total)
            else:
                return False
    return True


@njit(**OPTIONS)
def downhill(columns: Array, size: Array, residual: Array) -> Array:
    """−Jᵀ r in the columns' own lengths."""
    out = np.zeros(size.size)
    for i in range(residual.size):
        for p in range(size.size):
            out[p] -= columns[i, p] * residual[i]
    for p in range(size.size):
        out[p] /= size[p]
    return out


@njit(**OPTIONS)
def solve(chol: Array, x: Array) -> None:
    """x becomes (JᵀJ + λ)⁻¹ x, both in the columns' own lengths."""
    for p in range(x.size):
        for q in range(p):
            x[p] -= chol[p, q] * x[q]
        x[p] /= chol[p, p]
    for p in range(x.size - 1, -1, -1):
        for q in range(p + 1, x.size):
            x[p] -= chol[q, p] * x[q]
        x[p] /= chol[p, p]


@njit(**OPTIONS)
def _moved(flown: Flown, how: Damping, base: Array, x: Array, step: Array, k_sources: int) -> Array:
    """The vector after a step, each part of it kept within what the model is linear in."""
    n_turns = flown.length.size - 1
    logs = medium_of(flown, base, x, k_sources)
    reach = how.place * math.exp(0.5 * logs[:k_sources].min())
    out = x.copy()
    for p in range(x.size):
        most = how.heading if p < n_turns else reach if p < n_turns + 2 * k_sources else how.log
        if flown.ambient_free and p == x.size - 1:
            most = np.inf
        out[p] += min(max(step[p], -most), most)
    return out


@njit(**OPTIONS)
def _step(
    flown: Flown, how: Damping, base: Array, x: Array, residual: Array, columns: Array,
    normal: tuple[Array, Array, Array], damping: float,
) -> Array:  # fmt: skip
    """Velocity and half its acceleration; empty where the path bends too much for a step of this size."""
    matrix, size, chol = normal
    k_sources = base.size - 1
    none = np.empty(0)
    if not factor(matrix, damping, chol):
        return none
    velocity = downhill(columns, size, residual)
    solve(chol, velocity)
    ahead = np.empty_like(residual)
    probed = _moved(flown, how, base, x, how.probe * velocity / size, k_sources)
    residual_of(flown, base, probed, k_sources, ahead, np.empty((0, 0)))
    bend = np.empty_like(residual)
    for i in range(residual.size):
        along = 0.0
        for p in range(size.size):
            along += columns[i, p] * velocity[p] / size[p]
        bend[i] = 2.0 / how.probe * ((ahead[i] - residual[i]) / how.probe - along)
    acceleration = downhill(columns, size, bend)
    solve(chol, acceleration)
    fast, bent = math.sqrt((velocity**2).sum()), math.sqrt((acceleration**2).sum())
    if not (2.0 * bent <= how.bend * fast):
        return none
    step: Array = (velocity + 0.5 * acceleration) / size
    return step


@njit(**OPTIONS)
def plain_fit(flown: Flown, how: Damping, base: Array, x: Array, iterations: int) -> tuple[float, bool]:
    """Levenberg–Marquardt with geodesic acceleration from x (P,), in place; the cost, and whether it settled.

    As `dslam.fit.fit`, which names the source.
    """
    k_sources, n_par = base.size - 1, x.size
    n_rows = flown.s.size + 2 * k_sources
    residual, trial = np.empty(n_rows), np.empty(n_rows)
    columns, columns_try = np.empty((n_rows, n_par)), np.empty((n_rows, n_par))
    matrix, size, chol = np.zeros((n_par, n_par)), np.empty(n_par), np.zeros((n_par, n_par))
    residual_of(flown, base, x, k_sources, residual, columns)
    normal_of(columns, size, matrix)
    cost = (residual**2).sum()
    damping = how.first
    for _ in range(iterations):
        step = _step(flown, how, base, x, residual, columns, (matrix, size, chol), damping)
        if step.size > 0:
            x_try = _moved(flown, how, base, x, step, k_sources)
            residual_of(flown, base, x_try, k_sources, trial, columns_try)
            cost_try = (trial**2).sum()
            if cost_try <= cost:
                gain = cost - cost_try
                x[:] = x_try
                residual, trial = trial, residual
                columns, columns_try = columns_try, columns
                cost = cost_try
                damping = max(damping * 0.2, how.least)
                if gain <= how.gain * (cost + flown.outside) / flown.n_readings:
                    return cost, True
                normal_of(columns, size, matrix)
                continue
        damping *= 3.0
        if damping > how.most:
            return cost, True
    return cost, False
