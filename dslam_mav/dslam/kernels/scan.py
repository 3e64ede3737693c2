"""One leg more: its heading scanned; and which candidates differ (theory, section 8, step 5)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.tables import MAX_EXPONENT, OPTIONS, Array, Indices, LegTables, sample


@njit(**OPTIONS)
def scan_heading(
    legs: LegTables,
    j: int,
    start: Array,
    s: Array,
    alpha: Array,
    headings: Array,
    backwards: bool,
) -> tuple[Array, Array]:
    """Cost of leg j at every heading for every candidate, and the two best local minima.

    `start` (B, 2) is the leg's start, or its end when `backwards`; s (B, K, 2) in the same frame. Returns
    (best headings (B, 2), their costs (B, 2)); a missing second minimum costs inf.
    """
    batch, k_sources = s.shape[0], s.shape[1]
    m = headings.shape[0]
    size = legs.z.shape[1]
    phi = np.empty(size)
    dphi = np.empty(size)
    res = np.empty(size)
    cost = np.empty(m)
    best = np.empty((batch, 2))
    best_cost = np.full((batch, 2), np.inf)
    for b in range(batch):
        for a in range(m):
            cx, cy = math.cos(headings[a]), math.sin(headings[a])
            shift = legs.length[j] if backwards else 0.0
            for r in range(size):
                res[r] = -legs.z[j, r]
            for k in range(k_sources):
                px, py = s[b, k, 0] - start[b, 0], s[b, k, 1] - start[b, 1]
                y = px * cx + py * cy + shift
                d = py * cx - px * cy
                exponent = alpha[b, k] - d * d / legs.c[j]
                if exponent < -30.0:
                    continue
                amp = math.exp(min(exponent, MAX_EXPONENT))
                sample(legs.table[j], legs.y0, legs.h, y, phi, dphi)
                for r in range(size):
                    res[r] += amp * phi[r]
            total = 0.0
            for r in range(size):
                total += res[r] * res[r]
            cost[a] = total
        for a in range(m):
            here = cost[a]
            if here <= cost[a - 1] and here < cost[(a + 1) % m]:
                if here < best_cost[b, 0]:
                    best[b, 1], best_cost[b, 1] = best[b, 0], best_cost[b, 0]
                    best[b, 0], best_cost[b, 0] = headings[a], here
                elif here < best_cost[b, 1]:
                    best[b, 1], best_cost[b, 1] = headings[a], here
    return best, best_cost


@njit(**OPTIONS)
def distinct(theta: Array, s: Array, alpha: Array, lo: int, hi: int, keep: int, tolerance: float) -> Indices:
    """Indices of the first `keep` candidates (given best first) that differ by more than `tolerance`.

    Sources are compared in order of x, headings by their cosine and sine.
    """
    batch, k_sources = alpha.shape
    chosen = np.empty(min(keep, batch), dtype=np.int64)
    count = 0
    order = np.empty((batch, k_sources), dtype=np.int64)
    for b in range(batch):
        order[b] = np.argsort(s[b, :, 0])
        same = False
        for i in range(count):
            o = chosen[i]
            far = 0.0
            for k in range(k_sources):
                p, q = order[b, k], order[o, k]
                far = max(far, abs(s[b, p, 0] - s[o, q, 0]))
                far = max(far, abs(s[b, p, 1] - s[o, q, 1]))
            for j in range(lo, hi + 1):
                far = max(far, abs(math.cos(theta[b, j]) - math.cos(theta[o, j])))
                far = max(far, abs(math.sin(theta[b, j]) - math.sin(theta[o, j])))
            if far < tolerance:
                same = True
                break
        if not same:
            chosen[count] = b
            count += 1
            if count == keep:
                break
    return chosen[:count]
