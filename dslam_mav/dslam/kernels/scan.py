"""One leg more: its heading scanned (theory, section 8, step 5)."""

from __future__ import annotations

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.lanes import LANES, Lanes, exponential, load, splat, store
from dslam_mav.dslam.kernels.products import Products, node, value
from dslam_mav.dslam.kernels.tables import OPTIONS, Array


@njit(**OPTIONS)
def _headings_cost(
    prods: Products,
    j: int,
    bx: float,
    by: float,
    shift: float,
    s: Array,
    alpha: Array,
    cos: Lanes,
    sin: Lanes,
    leg: Array,
) -> Lanes:
    """Cost of leg j from (bx, by) at eight headings, for one candidate."""
    cost = splat(prods.energy[j])
    inv_c = 1.0 / prods.c[j]
    for k in range(alpha.shape[0]):
        px, py = s[k, 0] - bx, s[k, 1] - by
        y = px * cos + py * sin + shift
        d = py * cos - px * sin
        size = exponential(alpha[k] - d * d * inv_c)
        at, t = node(prods, y)
        store(leg, 3 * k, y)
        store(leg, 3 * k + 1, size)
        of_size = size * value(prods.pair, j, at, t) - 2.0 * value(prods.own, j, at, t)
        if prods.centred:
            mean = value(prods.mean, j, at, t)
            store(leg, 3 * k + 2, mean)
            of_size = of_size - size * mean * mean
        for o in range(k):
            other = load(leg, 3 * o)
            gap = y - other
            at, t = node(prods, 0.5 * (y + other))
            both = exponential(-0.5 * inv_c * gap * gap) * value(prods.pair, j, at, t)
            if prods.centred:
                both = both - load(leg, 3 * k + 2) * load(leg, 3 * o + 2)
            of_size = of_size + 2.0 * load(leg, 3 * o + 1) * both
        cost = cost + size * of_size
    return cost


@njit(**OPTIONS)
def scan_heading(
    prods: Products,
    j: int,
    start: Array,
    s: Array,
    alpha: Array,
    headings: Array,
    backwards: bool,
) -> tuple[Array, Array]:
    """Cost of leg j at every heading (a multiple of eight) for every candidate, and the two best local minima.

    `start` (B, 2) is the leg's start, or its end when `backwards`; s (B, K, 2) in the same frame. Returns
    (best headings (B, 2), their costs (B, 2)); a missing second minimum costs inf.
    """
    batch, k_sources = s.shape[0], s.shape[1]
    m = headings.shape[0]
    cos, sin = np.cos(headings).reshape(-1, LANES), np.sin(headings).reshape(-1, LANES)
    leg = np.empty((3 * k_sources, LANES))
    costs = np.empty((m // LANES, LANES))
    cost = costs.reshape(m)
    best = np.empty((batch, 2))
    best_cost = np.full((batch, 2), np.inf)
    shift = prods.length[j] if backwards else 0.0
    for b in range(batch):
        for a in range(m // LANES):
            here = _headings_cost(
                prods, j, start[b, 0], start[b, 1], shift, s[b], alpha[b], load(cos, a), load(sin, a), leg
            )
            store(costs, a, here)
        for a in range(m):
            low = cost[a]
            if low <= cost[a - 1] and low < cost[(a + 1) % m]:
                if low < best_cost[b, 0]:
                    best[b, 1], best_cost[b, 1] = best[b, 0], best_cost[b, 0]
                    best[b, 0], best_cost[b, 0] = headings[a], low
                elif low < best_cost[b, 1]:
                    best[b, 1], best_cost[b, 1] = headings[a], low
    return best, best_cost
