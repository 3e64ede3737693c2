"""Levenberg–Marquardt on compressed legs, for many candidates at once (theory, section 8, step 2).

Parameters in order: headings of legs lo+1 … hi, then (x, y, α) of every source. Turning leg i moves all that follows,
so the columns of earlier headings are combinations of the sources' columns, −l_i n_iᵀ Σ_k ∂/∂S_k: a leg needs inner
products of 3K + 3 columns only, the sources' own, their sums over x and y, and its own heading's.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.tables import MAX_EXPONENT, OPTIONS, Array, Flags, LegTables, damped_step, sample

STEP_HEADING_RAD = 0.5
STEP_POSITION = 1.0
STEP_LOG_AMPLITUDE = 1.0
LEAST_DAMPING = 1e-12


class FitOptions(NamedTuple):
    """How a batch is fitted: on legs lo … hi, with a weak prior on log amplitude, for so many iterations."""

    lo: int
    hi: int
    alpha_mean: float
    alpha_sd: float
    iterations: int
    tolerance: float


@njit(**OPTIONS)
def _columns(
    legs: LegTables, j: int, bx: float, by: float, heading: float, s: Array, alpha: Array, col: Array, phi: Array
) -> None:
    """Residual and derivatives of one leg that starts at (bx, by), into the rows of `col`.

    Rows: (x, y, α) of every source, their sums over x and over y, the leg's own heading, the residual.
    """
    k_sources = alpha.shape[0]
    size = legs.z.shape[1]
    n_own = 3 * k_sources
    cx, cy = math.cos(heading), math.sin(heading)
    for r in range(size):
        col[n_own, r] = 0.0
        col[n_own + 1, r] = 0.0
        col[n_own + 2, r] = 0.0
        col[n_own + 3, r] = -legs.z[j, r]
    for k in range(k_sources):
        px, py = s[k, 0] - bx, s[k, 1] - by
        y = px * cx + py * cy
        d = py * cx - px * cy
        amplitude = math.exp(min(alpha[k] - d * d / legs.c[j], MAX_EXPONENT))
        sample(legs.table[j], legs.y0, legs.h, y, phi[0], phi[1])
        across = -2.0 * d / legs.c[j]
        for r in range(size):
            g = amplitude * phi[0, r]
            along = amplitude * phi[1, r]
            sx = along * cx - across * g * cy
            sy = along * cy + across * g * cx
            col[3 * k, r] = sx
            col[3 * k + 1, r] = sy
            col[3 * k + 2, r] = g
            col[n_own, r] += sx
            col[n_own + 1, r] += sy
            col[n_own + 2, r] += along * d - across * g * y
            col[n_own + 3, r] += g


@njit(**OPTIONS)
def inner_products(col: Array, gram: Array) -> None:
    """col colᵀ, its lower triangle mirrored."""
    size = col.shape[1]
    for p in range(col.shape[0]):
        for q in range(p + 1):
            total = 0.0
            for r in range(size):
                total += col[p, r] * col[q, r]
            gram[p, q] = total
            gram[q, p] = total


@njit(**OPTIONS)
def _accumulate(gram: Array, combo: Array, n_active: int, n_head: int, n_own: int, jtj: Array, jtr: Array) -> None:
    """Add one leg's inner products to the normal equations; `combo` (n_active, 3) makes headings from its columns."""
    ix, iy, ih, ir = n_own, n_own + 1, n_own + 2, n_own + 3
    for a in range(n_active):
        a0, a1, a2 = combo[a, 0], combo[a, 1], combo[a, 2]
        jtr[a] += a0 * gram[ix, ir] + a1 * gram[iy, ir] + a2 * gram[ih, ir]
        for b in range(a + 1):
            b0, b1, b2 = combo[b, 0], combo[b, 1], combo[b, 2]
            jtj[a, b] += (
                a0 * (b0 * gram[ix, ix] + b1 * gram[ix, iy] + b2 * gram[ix, ih])
                + a1 * (b0 * gram[iy, ix] + b1 * gram[iy, iy] + b2 * gram[iy, ih])
                + a2 * (b0 * gram[ih, ix] + b1 * gram[ih, iy] + b2 * gram[ih, ih])
            )
        for q in range(n_own):
            jtj[n_head + q, a] += a0 * gram[ix, q] + a1 * gram[iy, q] + a2 * gram[ih, q]
    for p in range(n_own):
        jtr[n_head + p] += gram[p, ir]
        for q in range(p + 1):
            jtj[n_head + p, n_head + q] += gram[p, q]


@njit(**OPTIONS)
def _normal_equations(
    legs: LegTables,
    how: FitOptions,
    theta: Array,
    s: Array,
    alpha: Array,
    work: tuple[Array, ...],
    jtj: Array,
    jtr: Array,
) -> float:
    """Cost of a candidate and its normal equations (lower triangle)."""
    col, phi, gram, combo = work
    n_own = 3 * alpha.shape[0]
    n_head = how.hi - how.lo
    for i in range(jtr.shape[0]):
        jtr[i] = 0.0
        for j in range(i + 1):
            jtj[i, j] = 0.0
    cost = 0.0
    bx = 0.0
    by = 0.0
    for j in range(how.lo, how.hi + 1):
        _columns(legs, j, bx, by, theta[j], s, alpha, col, phi)
        inner_products(col, gram)
        cost += gram[n_own + 3, n_own + 3]
        n_active = j - how.lo
        if n_active > 0:
            combo[n_active - 1, 0] = 0.0
            combo[n_active - 1, 1] = 0.0
            combo[n_active - 1, 2] = 1.0
        _accumulate(gram, combo, n_active, n_head, n_own, jtj, jtr)
        step_x, step_y = legs.length[j] * math.cos(theta[j]), legs.length[j] * math.sin(theta[j])
        if n_active > 0:  # from the next leg on, this heading only shifts
            combo[n_active - 1, 0] = step_y
            combo[n_active - 1, 1] = -step_x
            combo[n_active - 1, 2] = 0.0
        bx += step_x
        by += step_y
    weight = 1.0 / (how.alpha_sd * how.alpha_sd)
    for k in range(alpha.shape[0]):
        excess = alpha[k] - how.alpha_mean
        index = n_head + 3 * k + 2
        cost += weight * excess * excess
        jtr[index] += weight * excess
        jtj[index, index] += weight
    return cost


@njit(**OPTIONS)
def move_sources(step: Array, s: Array, alpha: Array, to_s: Array, to_alpha: Array) -> float:
    """Sources after their part of a step, (S, α) of each in turn, clipped; returns the largest move."""
    d = s.shape[1]
    biggest = 0.0
    for k in range(alpha.shape[0]):
        for q in range(d):
            move = min(max(step[(d + 1) * k + q], -STEP_POSITION), STEP_POSITION)
            biggest = max(biggest, abs(move))
            to_s[k, q] = s[k, q] + move
        move = min(max(step[(d + 1) * k + d], -STEP_LOG_AMPLITUDE), STEP_LOG_AMPLITUDE)
        biggest = max(biggest, abs(move))
        to_alpha[k] = alpha[k] + move
    return biggest


@njit(**OPTIONS)
def _take_step(
    step: Array, how: FitOptions, theta: Array, s: Array, alpha: Array, to_theta: Array, to_s: Array, to_alpha: Array
) -> float:
    """The candidate after a clipped step; returns the largest move."""
    n_head = how.hi - how.lo
    biggest = 0.0
    to_theta[:] = theta
    for i in range(n_head):
        move = min(max(step[i], -STEP_HEADING_RAD), STEP_HEADING_RAD)
        biggest = max(biggest, abs(move))
        to_theta[how.lo + 1 + i] = theta[how.lo + 1 + i] + move
    of_sources: float = move_sources(step[n_head:], s, alpha, to_s, to_alpha)
    return max(biggest, of_sources)


@njit(**OPTIONS)
def fit_batch(legs: LegTables, how: FitOptions, theta: Array, s: Array, alpha: Array) -> tuple[Array, Flags]:
    """Fit every candidate in place; returns (costs (B,), converged (B,)).

    theta (B, L), s (B, K, 2) from the start of leg lo, alpha (B, K). A step is clipped to 0.5 rad, one spread, 1 in α.
    """
    batch, k_sources = alpha.shape
    n_par = how.hi - how.lo + 3 * k_sources
    n_col = 3 * k_sources + 4
    size = legs.z.shape[1]
    work = (np.empty((n_col, size)), np.empty((2, size)), np.empty((n_col, n_col)), np.zeros((n_par, 3)))
    jtj, jtr = np.empty((n_par, n_par)), np.empty(n_par)
    jtj_try, jtr_try = np.empty((n_par, n_par)), np.empty(n_par)
    chol, step = np.empty((n_par, n_par)), np.empty(n_par)
    theta_try, s_try, alpha_try = np.empty(theta.shape[1]), np.empty((k_sources, 2)), np.empty(k_sources)
    costs = np.empty(batch)
    converged = np.zeros(batch, dtype=np.bool_)
    for b in range(batch):
        cost = _normal_equations(legs, how, theta[b], s[b], alpha[b], work, jtj, jtr)
        damping = 1e-3
        for _ in range(how.iterations):
            if not damped_step(jtj, jtr, damping, LEAST_DAMPING, chol, step):
                damping = damping * 10.0 + 1e-6
                continue
            biggest = _take_step(step, how, theta[b], s[b], alpha[b], theta_try, s_try, alpha_try)
            cost_try = _normal_equations(legs, how, theta_try, s_try, alpha_try, work, jtj_try, jtr_try)
            if cost_try < cost:
                gain = cost - cost_try
                cost = cost_try
                theta[b] = theta_try
                s[b] = s_try
                alpha[b] = alpha_try
                jtj, jtj_try = jtj_try, jtj
                jtr, jtr_try = jtr_try, jtr
                damping = max(damping * 0.2, 1e-9)
                if gain < how.tolerance * (1.0 + cost) and biggest < 1e-2:
                    converged[b] = True
                    break
            else:
                if biggest < 1e-7:
                    converged[b] = True
                    break
                damping *= 8.0
                if damping > 1e12:
                    break
        costs[b] = cost
    return costs, converged
