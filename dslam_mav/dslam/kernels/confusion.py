"""How far the readings of legs to come would tell one answer from another whose headings are free: compiled."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.tables import OPTIONS, Array

HEADINGS = 28  # tried for every leg of the other answer
FINER = 2  # rounds of seven about the best
LEAST_POINTS, POINTS_PER_SPREAD = 4, 3.0


@njit(**OPTIONS)
def _profile(
    x: float, y: float, heading: float, length: float, places: Array, peaks: Array, c: float, out: Array
) -> None:
    """Readings at the middles of `out.size` equal parts of a leg."""
    n = out.size
    along_x, along_y = math.cos(heading), math.sin(heading)
    for i in range(n):
        s = length * (i + 0.5) / n
        total = 0.0
        for k in range(places.shape[0]):
            u, v = x + s * along_x - places[k, 0], y + s * along_y - places[k, 1]
            total += peaks[k] * math.exp(-(u * u + v * v) / c)
        out[i] = total


@njit(**OPTIONS)
def _off(seen: Array, told: Array, weight: float) -> float:
    total = 0.0
    for i in range(seen.size):
        total += (seen[i] - told[i]) ** 2
    return weight * total


@njit(**OPTIONS)
def separations(
    ends: Array, headings: Array, places: Array, peaks: Array, spread2: Array, turns: Array, lengths: Array,
    per_noise2: float, wanted: Array,
) -> Array:  # fmt: skip
    """(M, M) χ² by which answer i's readings on the legs to come are told from answer j's, which may turn as it likes.

    `ends` (M, 2) and `headings` (M,) where each believes to be; `per_noise2` readings a metre over the noise's
    variance; pairs not `wanted` (M, M) stay 0. Leg after leg the other takes the heading that fits best.
    """
    m, n_legs = ends.shape[0], turns.size
    out = np.zeros((m, m))
    step = 2.0 * math.pi / HEADINGS
    for i in range(m):
        x, y, heading = ends[i, 0], ends[i, 1], headings[i]
        at = ends.copy()
        for leg in range(n_legs):
            heading += turns[leg]
            length = lengths[leg]
            n = max(LEAST_POINTS, int(POINTS_PER_SPREAD * length / math.sqrt(spread2[i])))
            seen, told = np.empty(n), np.empty(n)
            weight = per_noise2 * length / n
            _profile(x, y, heading, length, places[i], peaks[i], spread2[i], seen)
            for j in range(m):
                if wanted[i, j] == 0.0:
                    continue
                best, way = math.inf, 0.0
                for h in range(HEADINGS):
                    _profile(at[j, 0], at[j, 1], h * step, length, places[j], peaks[j], spread2[j], told)
                    off = _off(seen, told, weight)
                    if off < best:
                        best, way = off, h * step
                fine = step
                for _ in range(FINER):
                    middle = way
                    fine = fine / 4.0
                    for h in range(-3, 4):
                        trial = middle + h * fine
                        _profile(at[j, 0], at[j, 1], trial, length, places[j], peaks[j], spread2[j], told)
                        off = _off(seen, told, weight)
                        if off < best:
                            best, way = off, trial
                out[i, j] += best
                at[j, 0] += length * math.cos(way)
                at[j, 1] += length * math.sin(way)
            x += length * math.cos(heading)
            y += length * math.sin(heading)
    return out
