"""Levenberg–Marquardt on compressed legs in space, for many candidates at once.

As in the plane (theory, section 8, step 2), with every leg's direction a unit vector c_j: a leg sees a source
at p = S − b_j by Y = pᵀc and |p|² − Y². Turning leg i moves all that follows, so that the columns of earlier legs'
turns are combinations of the sums of the sources' columns, −l_i Tᵢᵀ Σ_k ∂/∂S_k.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.fit import STEP_HEADING_RAD, inner_products, move_sources
from dslam_mav.dslam.kernels.tables import MAX_EXPONENT, OPTIONS, Array, LegTables, damped_step, sample

LEAST_DAMPING = 1e-9


class SpaceFit(NamedTuple):
    """How a batch is fitted: on legs lo … hi, for so many iterations, with a weak prior on log amplitude.

    `turns`: what is unknown of every direction but the first: 0 nothing, 1 the heading, 2 heading and climb.
    """

    lo: int
    hi: int
    turns: int
    alpha_mean: float
    alpha_sd: float
    iterations: int


@njit(**OPTIONS)
def _tangents(c: Array, turns: int, out: Array) -> None:
    """What turning does to a direction (3,): about the vertical, and for two turns also up and down, into (2, 3)."""
    out[:, :] = 0.0
    out[0, 0], out[0, 1] = -c[1], c[0]
    if turns == 2:
        flat = math.sqrt(c[0] * c[0] + c[1] * c[1])
        if flat < 1e-6:
            out[0, 0], out[0, 1] = 1.0, 0.0
            out[1, 1] = 1.0
            return
        for q in range(3):
            out[0, q] /= flat
        out[1, 0], out[1, 1], out[1, 2] = -c[0] * c[2] / flat, -c[1] * c[2] / flat, flat


@njit(**OPTIONS)
def _columns(
    legs: LegTables, j: int, b: Array, c: Array, tangents: Array, s: Array, alpha: Array, col: Array, phi: Array
) -> None:
    """Residual and derivatives of one leg from b along c, into the rows of `col`.

    Rows: (x, y, z, α) of every source, their sums over x, y, z, the leg's own two turns, the residual.
    """
    k_sources, size = alpha.shape[0], legs.z.shape[1]
    n_own = 4 * k_sources
    col[n_own : n_own + 5] = 0.0
    col[n_own + 5] = -legs.z[j]
    spread2 = legs.c[j]
    fading = 0.5 * math.log(spread2)  # the tables carry C_ref/C; in space it is to the power 3/2
    for k in range(k_sources):
        px, py, pz = s[k, 0] - b[0], s[k, 1] - b[1], s[k, 2] - b[2]
        y = px * c[0] + py * c[1] + pz * c[2]
        d2 = px * px + py * py + pz * pz - y * y
        amplitude = math.exp(min(alpha[k] - d2 / spread2 - fading, MAX_EXPONENT))
        sample(legs.table[j], legs.y0, legs.h, y, phi[0], phi[1])
        ox, oy, oz = px - y * c[0], py - y * c[1], pz - y * c[2]
        first = px * tangents[0, 0] + py * tangents[0, 1] + pz * tangents[0, 2]
        second = px * tangents[1, 0] + py * tangents[1, 1] + pz * tangents[1, 2]
        for r in range(size):
            g = amplitude * phi[0, r]
            along = amplitude * phi[1, r]
            across = -2.0 / spread2 * g
            sx, sy, sz = along * c[0] + across * ox, along * c[1] + across * oy, along * c[2] + across * oz
            turned = along - across * y
            col[4 * k, r], col[4 * k + 1, r], col[4 * k + 2, r], col[4 * k + 3, r] = sx, sy, sz, g
            col[n_own, r] += sx
            col[n_own + 1, r] += sy
            col[n_own + 2, r] += sz
            col[n_own + 3, r] += turned * first
            col[n_own + 4, r] += turned * second
            col[n_own + 5, r] += g


@njit(**OPTIONS)
def _accumulate(
    col: Array, gram: Array, combo: Array, mixed: Array, shape: tuple[int, int, int], jtj: Array, jtr: Array
) -> float:
    """Add one leg to the normal equations (lower triangle); `combo` (active, 5) makes turns from its columns."""
    n_active, n_head, n_own = shape
    n_col = col.shape[0]
    inner_products(col, gram)
    for a in range(n_active):
        for q in range(n_col):
            total = 0.0
            for m in range(5):
                total += combo[a, m] * gram[n_own + m, q]
            mixed[a, q] = total
        jtr[a] += mixed[a, n_col - 1]
        for b in range(a + 1):
            total = 0.0
            for m in range(5):
                total += combo[b, m] * mixed[a, n_own + m]
            jtj[a, b] += total
        for q in range(n_own):
            jtj[n_head + q, a] += mixed[a, q]
    for p in range(n_own):
        jtr[n_head + p] += gram[p, n_col - 1]
        for q in range(p + 1):
            jtj[n_head + p, n_head + q] += gram[p, q]
    return float(gram[n_col - 1, n_col - 1])


@njit(**OPTIONS)
def _normal_equations(
    legs: LegTables, how: SpaceFit, c: Array, s: Array, alpha: Array, work: tuple[Array, ...], jtj: Array, jtr: Array
) -> float:
    """Cost of a candidate and its normal equations."""
    col, phi, gram, combo, mixed, tangents, b = work
    n_own, n_head = 4 * alpha.shape[0], how.turns * (how.hi - how.lo)
    jtj[:, :] = 0.0
    jtr[:] = 0.0
    b[:] = 0.0
    cost = 0.0
    for j in range(how.lo, how.hi + 1):
        _tangents(c[j], how.turns, tangents)
        _columns(legs, j, b, c[j], tangents, s, alpha, col, phi)
        n_active = how.turns * (j - how.lo)
        own = n_active - how.turns
        if j > how.lo:
            for m in range(how.turns):
                combo[own + m, :] = 0.0
                combo[own + m, 3 + m] = 1.0
        cost += _accumulate(col, gram, combo, mixed, (n_active, n_head, n_own), jtj, jtr)
        if j > how.lo:  # from the next leg on, these turns only shift
            for m in range(how.turns):
                for q in range(3):
                    combo[own + m, q] = -legs.length[j] * tangents[m, q]
                combo[own + m, 3 + m] = 0.0
        for q in range(3):
            b[q] += legs.length[j] * c[j, q]
    weight = 1.0 / (how.alpha_sd * how.alpha_sd)
    for k in range(alpha.shape[0]):
        excess = alpha[k] - how.alpha_mean
        index = n_head + 4 * k + 3
        cost += weight * excess * excess
        jtr[index] += weight * excess
        jtj[index, index] += weight
    return cost


@njit(**OPTIONS)
def _take_step(
    step: Array, how: SpaceFit, c: Array, s: Array, alpha: Array, to: tuple[Array, Array, Array], tangents: Array
) -> float:
    """The candidate after a clipped step, into `to`; returns the largest move."""
    to_c, to_s, to_alpha = to
    n_head = how.turns * (how.hi - how.lo)
    biggest = 0.0
    to_c[:, :] = c
    for j in range(how.lo + 1, how.hi + 1):
        _tangents(c[j], how.turns, tangents)
        for m in range(how.turns):
            move = min(max(step[how.turns * (j - how.lo - 1) + m], -STEP_HEADING_RAD), STEP_HEADING_RAD)
            biggest = max(biggest, abs(move))
            if how.turns == 1:
                to_c[j, 0] = math.cos(move) * c[j, 0] - math.sin(move) * c[j, 1]
                to_c[j, 1] = math.sin(move) * c[j, 0] + math.cos(move) * c[j, 1]
            else:
                to_c[j] += math.tan(move) * tangents[m]
        to_c[j] /= math.sqrt(to_c[j, 0] ** 2 + to_c[j, 1] ** 2 + to_c[j, 2] ** 2)
    of_sources: float = move_sources(step[n_head:], s, alpha, to_s, to_alpha)
    return max(biggest, of_sources)


@njit(**OPTIONS)
def fit_in_space(legs: LegTables, how: SpaceFit, c: Array, s: Array, alpha: Array) -> Array:
    """Fit every candidate in place; returns costs (B,).

    c (B, L, 3) unit directions, s (B, K, 3) from the start of leg lo, alpha (B, K); the tables' units.
    """
    batch, k_sources = alpha.shape
    n_head, n_col, size = how.turns * (how.hi - how.lo), 4 * k_sources + 6, legs.z.shape[1]
    n_par = n_head + 4 * k_sources
    tangents = np.empty((2, 3))
    work = (
        np.empty((n_col, size)), np.empty((2, size)), np.empty((n_col, n_col)), np.zeros((n_head + 2, 5)),
        np.empty((n_head + 2, n_col)), np.empty((2, 3)), np.empty(3),
    )  # fmt: skip
    jtj, jtr, jtj_try, jtr_try = np.empty((n_par, n_par)), np.empty(n_par), np.empty((n_par, n_par)), np.empty(n_par)
    chol, step = np.empty((n_par, n_par)), np.empty(n_par)
    to = (np.empty(c.shape[1:]), np.empty((k_sources, 3)), np.empty(k_sources))
    costs = np.empty(batch)
    for b in range(batch):
        cost = _normal_equations(legs, how, c[b], s[b], alpha[b], work, jtj, jtr)
        damping = 1e-3
        for _ in range(how.iterations):
            if not damped_step(jtj, jtr, damping, LEAST_DAMPING, chol, step):
                damping = damping * 10.0 + 1e-6
                continue
            biggest = _take_step(step, how, c[b], s[b], alpha[b], to, tangents)
            cost_try = _normal_equations(legs, how, to[0], to[1], to[2], work, jtj_try, jtr_try)
            if cost_try < cost:
                gain = cost - cost_try
                cost = cost_try
                c[b], s[b], alpha[b] = to[0], to[1], to[2]
                jtj, jtj_try, jtr, jtr_try = jtj_try, jtj, jtr_try, jtr
                damping = max(damping * 0.2, 1e-9)
                if gain < 1e-9 * (1.0 + cost) and biggest < 1e-2:
                    break
            else:
                damping *= 8.0
                if biggest < 1e-7 or damping > 1e12:
                    break
        costs[b] = cost
    return costs
