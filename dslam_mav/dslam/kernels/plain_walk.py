"""The least χ² across a direction, compiled, for plain problems: what `profile.py` walks along."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.plain_fit import downhill, factor, normal_of, solve
from dslam_mav.dslam.kernels.plain_model import Flown, residual_of
from dslam_mav.dslam.kernels.tables import OPTIONS, Array


class Across(NamedTuple):
    """How the steps across go: a reading's variance, how many, the gain in χ² that a further one must promise, damping
    at first and after a failure, and how many times an unknown's `limit` a step may be.
    """

    variance: float
    refits: int
    gain: float
    damping: float
    more: float
    most: float


@njit(**OPTIONS)
def least_across(flown: Flown, base: Array, x: Array, way: Array, limit: Array, how: Across) -> float:
    """Gauss–Newton steps from x (P,), in place, that change nothing along `way` (P,) (Lagrange); χ² where they end."""
    k_sources, n_par = base.size - 1, x.size
    n_rows = flown.s.size + 2 * k_sources
    residual, trial = np.empty(n_rows), np.empty(n_rows)
    columns, columns_try = np.empty((n_rows, n_par)), np.empty((n_rows, n_par))
    matrix, size, chol = np.zeros((n_par, n_par)), np.empty(n_par), np.zeros((n_par, n_par))
    residual_of(flown, base, x, k_sources, residual, columns)
    cost = (residual**2).sum()
    if not np.isfinite(cost):
        return np.inf
    normal_of(columns, size, matrix)
    damping = how.damping
    for _ in range(how.refits):
        if not factor(matrix, damping, chol):
            break
        down = downhill(columns, size, residual)
        free, along = down.copy(), way / size
        solve(chol, free)
        solve(chol, along)
        across = free - along * ((way / size) @ free) / ((way / size) @ along)
        if not (down @ across > how.gain * how.variance):
            break
        step = across / size
        if (np.abs(step) / limit).max() <= how.most:
            residual_of(flown, base, x + step, k_sources, trial, columns_try)
            cost_try = (trial**2).sum()
            if cost_try < cost:
                x += step
                cost = cost_try
                residual, trial = trial, residual
                columns, columns_try = columns_try, columns
                normal_of(columns, size, matrix)
                damping = max(0.1 * damping, how.damping)
                continue
        damping = max(10.0 * damping, how.more)
    chi2: float = cost / how.variance
    return chi2
