"""One leg more in space: its direction scanned (theory, section 8, step 5)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.tables import MAX_EXPONENT, OPTIONS, Array, LegTables, sample

FAINT = -30.0  # log amplitude below which a source is not seen at all


@njit(**OPTIONS)
def scan_directions(legs: LegTables, j: int, start: Array, s: Array, alpha: Array, ways: Array, back: float) -> Array:
    """(B, M) cost of leg j of every candidate in every direction `ways` (M, 3).

    `start` (B, 3) is the leg's start, or its end when `back` is the leg's length; s (B, K, 3) in the same frame.
    """
    batch, k_sources = alpha.shape
    size, spread2 = legs.z.shape[1], legs.c[j]
    phi, slope, off = np.empty(size), np.empty(size), np.empty(size)
    costs = np.empty((batch, ways.shape[0]))
    fading = 0.5 * math.log(spread2)
    for b in range(batch):
        for a in range(ways.shape[0]):
            for r in range(size):
                off[r] = -legs.z[j, r]
            for k in range(k_sources):
                y, square = 0.0, 0.0
                for q in range(3):
                    p = s[b, k, q] - start[b, q]
                    y += p * ways[a, q]
                    square += p * p
                exponent = alpha[b, k] - (square - y * y) / spread2 - fading
                if exponent < FAINT:
                    continue
                amplitude = math.exp(min(exponent, MAX_EXPONENT))
                sample(legs.table[j], legs.y0, legs.h, y + back, phi, slope)
                for r in range(size):
                    off[r] += amplitude * phi[r]
            total = 0.0
            for r in range(size):
                total += off[r] * off[r]
            costs[b, a] = total
    return costs
