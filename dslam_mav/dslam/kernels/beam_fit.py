"""Levenberg–Marquardt on a leg's inner products, eight candidates at a time (theory, section 8, step 2).

Parameters: (x, y, α) of every source, then the turns at the starts of legs lo+1 … hi. A turn moves all that follows
rigidly: seen from the path, the sources turn the other way about the vertex b, so that its column on every later leg
is Σ_k (S_k − b)_y ∂/∂x_k − (S_k − b)_x ∂/∂y_k. Going through the legs from the last, the sources' own products so far
are all that the turns need.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.algebra import accept, add, clipped, damped_step, triangle
from dslam_mav.dslam.kernels.fit import STEP_HEADING_RAD, STEP_LOG_AMPLITUDE, STEP_POSITION, FitOptions
from dslam_mav.dslam.kernels.lanes import LANES, Lanes, exponential, load, splat, store, where_less
from dslam_mav.dslam.kernels.products import INLINE, Products, products_of, put_source
from dslam_mav.dslam.kernels.tables import OPTIONS, Array

STUCK = 1e6  # damping at which no step helps any more


@njit(**OPTIONS)
def _sources_on_leg(prods: Products, j: int, k_sources: int, state: Array, where: Array, leg: Array) -> None:
    """Every source as leg j sees it, into its rows of `leg`."""
    n_legs = prods.length.size
    cos, sin = load(state, j), load(state, n_legs + j)
    bx, by = load(where, 2 * j), load(where, 2 * j + 1)
    inv_c = 1.0 / prods.c[j]
    for k in range(k_sources):
        at = 2 * n_legs + 3 * k
        px, py = load(state, at) - bx, load(state, at + 1) - by
        y = px * cos + py * sin
        d = py * cos - px * sin
        size = exponential(load(state, at + 2) - d * d * inv_c)
        put_source(prods, j, leg, k, y, size, d * (-2.0 * inv_c))


@njit(**OPTIONS)
def _add_leg(
    prods: Products, j: int, k_sources: int, state: Array, leg: Array, matrix: Array, gradient: Array
) -> Lanes:
    """Add leg j's products of the sources' columns to the matrix and gradient; returns the leg's cost."""
    n_legs = prods.length.size
    cos, sin = load(state, j), load(state, n_legs + j)
    cost = splat(prods.energy[j])
    for k in range(k_sources):
        cost = cost + load(leg, 7 * k + 3)
    for k in range(k_sources):
        qk = load(leg, 7 * k + 2)
        for o in range(k + 1):
            qo = load(leg, 7 * o + 2)
            gg, ga, ag, aa = products_of(prods, j, leg, k, o)
            add(leg, 7 * k + 3, gg)
            add(leg, 7 * k + 4, ag)
            if o < k:
                add(leg, 7 * o + 3, gg)
                add(leg, 7 * o + 4, ga)
            # rows of source k turned from along and across the leg to x and y, then columns of source o
            xs = cos * ag - sin * (qk * gg)
            ys = sin * ag + cos * (qk * gg)
            xa = cos * aa - sin * (qk * ga)
            ya = sin * aa + cos * (qk * ga)
            row = triangle(3 * k, 3 * o)
            add(matrix, row, cos * xa - sin * (qo * xs))
            row_y = triangle(3 * k + 1, 3 * o)
            add(matrix, row_y, cos * ya - sin * (qo * ys))
            add(matrix, row_y + 1, sin * ya + cos * (qo * ys))
            row_s = triangle(3 * k + 2, 3 * o)
            add(matrix, row_s, cos * ga - sin * (qo * gg))
            add(matrix, row_s + 1, sin * ga + cos * (qo * gg))
            add(matrix, row_s + 2, gg)
            if o < k:
                add(matrix, row + 1, sin * xa + cos * (qo * xs))
                add(matrix, row + 2, xs)
                add(matrix, row_y + 2, ys)
    for k in range(k_sources):
        g, a, q = load(leg, 7 * k + 3), load(leg, 7 * k + 4), load(leg, 7 * k + 2)
        cost = cost + g
        add(gradient, 3 * k, cos * a - sin * (q * g))
        add(gradient, 3 * k + 1, sin * a + cos * (q * g))
        add(gradient, 3 * k + 2, g)
    return cost


@njit(**INLINE)
def _entry(matrix: Array, i: int, j: int) -> Lanes:
    return load(matrix, triangle(max(i, j), min(i, j)))


@njit(**OPTIONS)
def _add_turn(
    j: int, lo: int, n_legs: int, k_sources: int, state: Array, where: Array, matrix: Array, gradient: Array
) -> None:
    """The row of the turn at the start of leg j, from the sources' products on legs j … hi."""
    index = 3 * k_sources + j - lo - 1
    own = triangle(index, 0)
    for column in range(3 * k_sources):
        total = splat(0.0)
        for k in range(k_sources):
            px = load(state, 2 * n_legs + 3 * k) - load(where, 2 * j)
            py = load(state, 2 * n_legs + 3 * k + 1) - load(where, 2 * j + 1)
            total = total + py * _entry(matrix, 3 * k, column) - px * _entry(matrix, 3 * k + 1, column)
        store(matrix, own + column, total)
    for i in range(lo + 1, j + 1):
        total = splat(0.0)
        for k in range(k_sources):
            px = load(state, 2 * n_legs + 3 * k) - load(where, 2 * i)
            py = load(state, 2 * n_legs + 3 * k + 1) - load(where, 2 * i + 1)
            total = total + py * load(matrix, own + 3 * k) - px * load(matrix, own + 3 * k + 1)
        store(matrix, own + 3 * k_sources + i - lo - 1, total)
    total = splat(0.0)
    for k in range(k_sources):
        px = load(state, 2 * n_legs + 3 * k) - load(where, 2 * j)
        py = load(state, 2 * n_legs + 3 * k + 1) - load(where, 2 * j + 1)
        total = total + py * load(gradient, 3 * k) - px * load(gradient, 3 * k + 1)
    store(gradient, index, total)


@njit(**OPTIONS)
def _normal_equations(
    prods: Products,
    how: FitOptions,
    k_sources: int,
    state: Array,
    where: Array,
    leg: Array,
    matrix: Array,
    gradient: Array,
) -> Lanes:
    """Cost of eight candidates and their normal equations (packed lower triangle)."""
    n_legs = prods.length.size
    matrix[:, :] = 0.0
    gradient[:, :] = 0.0
    store(where, 2 * how.lo, 0.0)
    store(where, 2 * how.lo + 1, 0.0)
    for j in range(how.lo, how.hi):
        store(where, 2 * j + 2, load(where, 2 * j) + prods.length[j] * load(state, j))
        store(where, 2 * j + 3, load(where, 2 * j + 1) + prods.length[j] * load(state, n_legs + j))
    cost = splat(0.0)
    for j in range(how.hi, how.lo - 1, -1):
        _sources_on_leg(prods, j, k_sources, state, where, leg)
        cost = cost + _add_leg(prods, j, k_sources, state, leg, matrix, gradient)
        if j > how.lo:
            _add_turn(j, how.lo, n_legs, k_sources, state, where, matrix, gradient)
    weight = 1.0 / (how.alpha_sd * how.alpha_sd)
    for k in range(k_sources):
        excess = load(state, 2 * n_legs + 3 * k + 2) - how.alpha_mean
        cost = cost + weight * excess * excess
        add(gradient, 3 * k + 2, weight * excess)
        add(matrix, triangle(3 * k + 2, 3 * k + 2), splat(weight))
    return cost


@njit(**OPTIONS)
def _move(how: FitOptions, n_legs: int, k_sources: int, state: Array, step: Array, trial: Array) -> None:
    """The state after a clipped step; headings are kept as cosines and sines, turned by a short series."""
    for i in range(3 * k_sources):
        most = STEP_LOG_AMPLITUDE if i % 3 == 2 else STEP_POSITION
        store(trial, 2 * n_legs + i, load(state, 2 * n_legs + i) + clipped(load(step, i), most))
    cos_all, sin_all = splat(1.0), splat(0.0)
    for j in range(how.lo, how.hi + 1):
        if j > how.lo:
            a = clipped(load(step, 3 * k_sources + j - how.lo - 1), STEP_HEADING_RAD)
            a2 = a * a
            c = 1.0 - a2 * (0.5 - a2 * (1.0 / 24.0 - a2 * (1.0 / 720.0 - a2 * (1.0 / 40320.0 - a2 / 3628800.0))))
            s = a * (1.0 - a2 * (1.0 / 6.0 - a2 * (1.0 / 120.0 - a2 * (1.0 / 5040.0 - a2 * (1.0 / 362880.0)))))
            cos_all, sin_all = cos_all * c - sin_all * s, sin_all * c + cos_all * s
        cos, sin = load(state, j), load(state, n_legs + j)
        store(trial, j, cos * cos_all - sin * sin_all)
        store(trial, n_legs + j, sin * cos_all + cos * sin_all)


@njit(**OPTIONS)
def _read(theta: Array, s: Array, alpha: Array, first: int, state: Array) -> None:
    n_legs, k_sources = theta.shape[1], alpha.shape[1]
    for w in range(LANES):
        b = min(first + w, theta.shape[0] - 1)  # a last block that is not full repeats the last candidate
        for j in range(n_legs):
            state[j, w], state[n_legs + j, w] = math.cos(theta[b, j]), math.sin(theta[b, j])
        for k in range(k_sources):
            at = 2 * n_legs + 3 * k
            state[at, w], state[at + 1, w], state[at + 2, w] = s[b, k, 0], s[b, k, 1], alpha[b, k]


@njit(**OPTIONS)
def _write(state: Array, how: FitOptions, first: int, theta: Array, s: Array, alpha: Array) -> None:
    n_legs, k_sources = theta.shape[1], alpha.shape[1]
    for w in range(min(LANES, theta.shape[0] - first)):
        b = first + w
        for j in range(how.lo, how.hi + 1):
            theta[b, j] = math.atan2(state[n_legs + j, w], state[j, w])
        for k in range(k_sources):
            at = 2 * n_legs + 3 * k
            s[b, k, 0], s[b, k, 1], alpha[b, k] = state[at, w], state[at + 1, w], state[at + 2, w]


@njit(**OPTIONS)
def beam_fits(prods: Products, how: FitOptions, theta: Array, s: Array, alpha: Array) -> Array:
    """Fit every candidate in place for at most `how.iterations`; returns the costs (B,).

    theta (B, L), s (B, K, 2) from the start of leg lo, alpha (B, K). A step is clipped to 0.5 rad, one spread, 1 in α.
    """
    batch, k_sources = alpha.shape
    n_legs = theta.shape[1]
    n_par = 3 * k_sources + how.hi - how.lo
    state, trial = np.empty((2 * n_legs + 3 * k_sources, LANES)), np.empty((2 * n_legs + 3 * k_sources, LANES))
    where, leg = np.empty((2 * n_legs, LANES)), np.empty((7 * k_sources, LANES))
    size = n_par * (n_par + 1) // 2
    matrix, gradient = np.empty((size, LANES)), np.empty((n_par, LANES))
    matrix_try, gradient_try = np.empty((size, LANES)), np.empty((n_par, LANES))
    chol, step = np.empty((size, LANES)), np.empty((n_par, LANES))
    out = np.empty((1, LANES))
    costs = np.empty(batch)
    for first in range(0, batch, LANES):
        _read(theta, s, alpha, first, state)
        trial[:, :] = state
        cost = _normal_equations(prods, how, k_sources, state, where, leg, matrix, gradient)
        damping = splat(1e-3)
        settled = splat(0.0)
        for _ in range(how.iterations):
            damped_step(matrix, gradient, damping, chol, step, n_par)
            _move(how, n_legs, k_sources, state, step, trial)
            cost_try = _normal_equations(prods, how, k_sources, trial, where, leg, matrix_try, gradient_try)
            accept(cost_try, cost, state, trial)
            accept(cost_try, cost, matrix, matrix_try)
            accept(cost_try, cost, gradient, gradient_try)
            gain = cost - cost_try
            small = where_less(gain, how.tolerance * (1.0 + cost), splat(1.0), settled)
            settled = where_less(cost_try, cost, small, where_less(splat(STUCK), damping, splat(1.0), settled))
            less = damping * 0.2
            less = where_less(less, splat(1e-9), splat(1e-9), less)
            damping = where_less(cost_try, cost, less, damping * 8.0)
            cost = where_less(cost_try, cost, cost_try, cost)
            store(out, 0, settled)
            if out.min() > 0.0:
                break
        store(out, 0, cost)
        _write(state, how, first, theta, s, alpha)
        for w in range(min(LANES, batch - first)):
            costs[first + w] = out[0, w]
    return costs
