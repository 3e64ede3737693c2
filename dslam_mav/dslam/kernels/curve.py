"""Levenberg–Marquardt along a parametric path r = Σ_i c_i φ_i (IV-C), for many candidates at once."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.tables import MAX_EXPONENT, OPTIONS, Array, damped_step

MOST_STEP = 1.0  # of a place in √C, or of a log amplitude
LEAST_DAMPING = 1e-9
LOG_SD = 4.0  # of the weak prior on log amplitude, in units of the readings' noise


class Curve(NamedTuple):
    """Readings y (N,) in units of their noise at φ (P, N), the sources' squared spread C (N,) at each.

    `ambient`: whether the ambient level is unknown; `alpha` the log of the largest reading.
    """

    phi: Array
    y: Array
    spread2: Array
    ambient: bool
    alpha: float


@njit(**OPTIONS)
def _rows(curve: Curve, c: Array, s: Array, alpha: Array, level: float, rows: Array, place: Array) -> None:
    """Derivatives by c (P·d), S (K·d), α (K), the ambient level; the residual last; into `rows` (P + 1, N)."""
    terms, d = c.shape
    k_sources, n = alpha.shape[0], curve.y.shape[0]
    to_s, to_alpha, last = terms * d, (terms + k_sources) * d, rows.shape[0] - 1
    for q in range(d):
        for i in range(n):
            place[q, i] = 0.0
            place[d + q, i] = 0.0
        for p in range(terms):
            for i in range(n):
                place[q, i] += c[p, q] * curve.phi[p, i]
    for i in range(n):
        rows[last, i] = level - curve.y[i]
    if curve.ambient:
        rows[last - 1] = 1.0
    for k in range(k_sources):
        for i in range(n):
            square = 0.0
            for q in range(d):
                square += (place[q, i] - s[k, q]) ** 2
            exponent = alpha[k] - square / curve.spread2[i] - 0.5 * d * math.log(curve.spread2[i])
            value = math.exp(min(exponent, MAX_EXPONENT))
            rows[to_alpha + k, i] = value
            rows[last, i] += value
            for q in range(d):
                slope = 2.0 / curve.spread2[i] * (place[q, i] - s[k, q]) * value
                rows[to_s + k * d + q, i] = slope
                place[d + q, i] -= slope
    for p in range(terms):
        for q in range(d):
            for i in range(n):
                rows[p * d + q, i] = curve.phi[p, i] * place[d + q, i]


@njit(**OPTIONS)
def _normal_equations(
    curve: Curve, c: Array, s: Array, alpha: Array, level: float, rows: Array, place: Array, jtj: Array, jtr: Array
) -> float:
    _rows(curve, c, s, alpha, level, rows, place)
    last, n = rows.shape[0] - 1, rows.shape[1]
    for p in range(last + 1):
        for q in range(p + 1):
            total = 0.0
            for i in range(n):
                total += rows[p, i] * rows[q, i]
            if p < last:
                jtj[p, q] = total
            elif q < last:
                jtr[q] = total
    cost = 0.0
    for i in range(n):
        cost += rows[last, i] * rows[last, i]
    first = (c.shape[0] + alpha.shape[0]) * c.shape[1]
    for k in range(alpha.shape[0]):
        excess = (alpha[k] - curve.alpha) / (LOG_SD * LOG_SD)
        cost += (alpha[k] - curve.alpha) * excess
        jtr[first + k] += excess
        jtj[first + k, first + k] += 1.0 / (LOG_SD * LOG_SD)
    return cost


@njit(**OPTIONS)
def _moved(at: Array, step: Array, begin: int, to: Array) -> float:
    """at + step, clipped, into `to` (both M × d); returns the largest move."""
    biggest = 0.0
    for m in range(at.shape[0]):
        for q in range(at.shape[1]):
            move = min(max(step[begin + m * at.shape[1] + q], -MOST_STEP), MOST_STEP)
            biggest = max(biggest, abs(move))
            to[m, q] = at[m, q] + move
    return biggest


@njit(**OPTIONS)
def fit_on_curve(curve: Curve, c: Array, s: Array, alpha: Array, level: Array, iterations: int) -> Array:
    """Fit every candidate in place: c (B, P, d), S (B, K, d), α (B, K, 1), ambient level (B,); returns costs (B,).

    The path's turn, and its shift where the φ_i span a constant, stay as they begin.
    """
    batch, terms, d = c.shape
    k_sources, n = alpha.shape[1], curve.y.shape[0]
    n_par = terms * d + k_sources * (d + 1) + int(curve.ambient)
    to_s, to_alpha = terms * d, (terms + k_sources) * d
    rows, place = np.empty((n_par + 1, n)), np.empty((2 * d, n))
    jtj, jtr, jtj_try, jtr_try = np.empty((n_par, n_par)), np.empty(n_par), np.empty((n_par, n_par)), np.empty(n_par)
    chol, step = np.empty((n_par, n_par)), np.empty(n_par)
    c_try, s_try, alpha_try = np.empty((terms, d)), np.empty((k_sources, d)), np.empty((k_sources, 1))
    costs = np.empty(batch)
    for b in range(batch):
        cost = _normal_equations(curve, c[b], s[b], alpha[b, :, 0], level[b], rows, place, jtj, jtr)
        damping = 1e-2
        for _ in range(iterations):
            if not damped_step(jtj, jtr, damping, LEAST_DAMPING, chol, step):
                damping = damping * 10.0 + 1e-6
                continue
            biggest = _moved(c[b], step, 0, c_try)
            biggest = max(biggest, _moved(s[b], step, to_s, s_try))
            biggest = max(biggest, _moved(alpha[b], step, to_alpha, alpha_try))
            level_try = level[b] + (step[n_par - 1] if curve.ambient else 0.0)
            cost_try = _normal_equations(curve, c_try, s_try, alpha_try[:, 0], level_try, rows, place, jtj_try, jtr_try)
            if cost_try < cost:
                gain = cost - cost_try
                cost = cost_try
                c[b], s[b], alpha[b], level[b] = c_try, s_try, alpha_try, level_try
                jtj, jtj_try, jtr, jtr_try = jtj_try, jtj, jtr_try, jtr
                damping = max(damping * 0.2, 1e-9)
                if gain < 1e-9 * (1.0 + cost) and biggest < 1e-2:
                    break
            else:
                damping *= 6.0
                if biggest < 1e-7 or damping > 1e12:
                    break
        costs[b] = cost
    return costs
