"""Two adjacent legs alone: sources by their projections, then one angle (theory, section 8, steps 3 and 4)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.algebra import accept, add, clipped, damped_step, triangle
from dslam_mav.dslam.kernels.lanes import LANES, Lanes, exponential, load, splat, store, where_less
from dslam_mav.dslam.kernels.products import Products, products_of, put_source
from dslam_mav.dslam.kernels.tables import OPTIONS, Array

STEP = 1.0  # largest move of U, V or W in one iteration


@njit(**OPTIONS)
def _add_leg(
    prods: Products,
    j: int,
    shift: float,
    which: int,
    k_sources: int,
    uvw: Array,
    leg: Array,
    matrix: Array,
    gradient: Array,
) -> Lanes:
    """Add one leg's products to the normal equations in (U, V, W); returns its cost.

    A source adds e^{V + U²/C} φ(shift + U) to the leg, U being row `which` of the source's three.
    """
    cost = splat(prods.energy[j])
    inv_c = 1.0 / prods.c[j]
    for k in range(k_sources):
        u, v = load(uvw, 3 * k + which), load(uvw, 3 * k + 1)
        size = exponential(v + u * u * inv_c)
        put_source(prods, j, leg, k, u + shift, size, u * (2.0 * inv_c))
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
            us = ag + qk * gg
            ku, kv, ou, ov = 3 * k + which, 3 * k + 1, 3 * o + which, 3 * o + 1
            add(matrix, triangle(ku, ou), aa + qk * ga + qo * us)
            add(matrix, triangle(kv, ov), gg)
            if o < k or which == 2:
                add(matrix, triangle(ku, ov), us)
            if o < k or which == 0:
                add(matrix, triangle(kv, ou), ga + qo * gg)
    for k in range(k_sources):
        g = load(leg, 7 * k + 3)
        cost = cost + g
        add(gradient, 3 * k + which, load(leg, 7 * k + 4) + load(leg, 7 * k + 2) * g)
        add(gradient, 3 * k + 1, g)
    return cost


@njit(**OPTIONS)
def corner_fits(prods: Products, j: int, uvw: Array, prior_sd: float, iterations: int) -> Array:
    """Fit (U, V, W) of every source on legs j and j+1, their angle left out; in place, returns the data costs (B,).

    uvw (B, K, 3): U and W are the source's projections on the two legs from their common corner, V its log
    contribution at the corner: leg j sees e^{V+U²/C} φ(l+U), leg j+1 sees e^{V+W²/C} φ(W). This is pairing (11) built
    into the model. A weak prior anchored at each start keeps the starts apart.
    """
    batch, k_sources = uvw.shape[0], uvw.shape[1]
    n_par = 3 * k_sources
    size = n_par * (n_par + 1) // 2
    leg = np.empty((7 * k_sources, LANES))
    matrix, gradient = np.empty((size, LANES)), np.empty((n_par, LANES))
    matrix_try, gradient_try = np.empty((size, LANES)), np.empty((n_par, LANES))
    chol, step = np.empty((size, LANES)), np.empty((n_par, LANES))
    anchor, best, trial = np.empty((n_par, LANES)), np.empty((n_par, LANES)), np.empty((n_par, LANES))
    out = np.empty((1, LANES))
    costs = np.empty(batch)
    weight = 1.0 / (prior_sd * prior_sd)
    for first in range(0, batch, LANES):
        for w in range(LANES):
            for i in range(n_par):
                anchor[i, w] = uvw[min(first + w, batch - 1), i // 3, i % 3]
        trial[:, :] = anchor
        best[:, :] = anchor
        matrix[:, :] = 0.0
        gradient[:, :] = 0.0
        lowest, lowest_data = splat(np.inf), splat(np.inf)
        damping = splat(1e-2)
        for it in range(iterations + 1):
            matrix_try[:, :] = 0.0
            gradient_try[:, :] = 0.0
            data = _add_leg(prods, j, prods.length[j], 0, k_sources, trial, leg, matrix_try, gradient_try)
            data = data + _add_leg(prods, j + 1, 0.0, 2, k_sources, trial, leg, matrix_try, gradient_try)
            total = data
            for i in range(n_par):
                off = load(trial, i) - load(anchor, i)
                total = total + weight * off * off
                add(gradient_try, i, weight * off)
                add(matrix_try, triangle(i, i), splat(weight))
            accept(total, lowest, best, trial)
            accept(total, lowest, matrix, matrix_try)
            accept(total, lowest, gradient, gradient_try)
            less = damping * 0.3
            less = where_less(less, splat(1e-9), splat(1e-9), less)
            damping = where_less(total, lowest, less, damping * 6.0)
            lowest_data = where_less(total, lowest, data, lowest_data)
            lowest = where_less(total, lowest, total, lowest)
            if it == iterations:
                break
            damped_step(matrix, gradient, damping, chol, step, n_par)
            for i in range(n_par):
                store(trial, i, load(best, i) + clipped(load(step, i), STEP))
        store(out, 0, lowest_data)
        for w in range(min(LANES, batch - first)):
            costs[first + w] = out[0, w]
            for i in range(n_par):
                uvw[first + w, i // 3, i % 3] = best[i, w]
    return costs


@njit(**OPTIONS)
def open_corner(
    uvw: Array, c1: float, c2: float, length: float, angles: Array, max_offset: float, max_alpha: float
) -> tuple[Array, Array, Array]:
    """Source maps of corner solutions at every turn angle ψ: one angle, and nothing K-dimensional is guessed.

    The offset of a source from the first leg is d = (W − U cos ψ)/sin ψ; maps with |d| > max_offset or an amplitude
    above max_alpha are left out. Returns turn angles (B,), S (B, K, 2) from the first leg's start, α (B, K).
    """
    n, k_sources = uvw.shape[0], uvw.shape[1]
    m = angles.shape[0]
    turn = np.empty(n * m)
    s = np.empty((n * m, k_sources, 2))
    alpha = np.empty((n * m, k_sources))
    count = 0
    mean_c = 0.5 * (c1 + c2)
    for i in range(n):
        for a in range(m):
            cos_a, sin_a = math.cos(angles[a]), math.sin(angles[a])
            fits = True
            for k in range(k_sources):
                u, v, w = uvw[i, k, 0], uvw[i, k, 1], uvw[i, k, 2]
                d = (w - u * cos_a) / sin_a
                s[count, k, 0] = length + u
                s[count, k, 1] = d
                alpha[count, k] = v + (u * u + d * d) / mean_c
                if abs(d) > max_offset or alpha[count, k] > max_alpha:
                    fits = False
                    break
            if fits:
                turn[count] = angles[a]
                count += 1
    return turn[:count], s[:count], alpha[:count]
