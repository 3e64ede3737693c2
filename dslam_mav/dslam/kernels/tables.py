"""A leg's tabulated curves, and the small linear algebra every kernel needs."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Sums may be taken in any order, so that they vectorise; NaN and infinity keep their meaning.
OPTIONS: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz"},
}

MAX_EXPONENT = 300.0


class LegTables(NamedTuple):
    """The legs as kernels see them, in units of one spread and of the noise of a sample.

    `z` (L, R) generalised samples; `table` (L, G, 2, R) has φ(Y) and φ'(Y) at Y = y0 + g·h; `c` (L,) is the squared
    spread across each leg, `length` (L,) the leg's.
    """

    z: Array
    table: Array
    y0: float
    h: float
    c: Array
    length: Array


@njit(**OPTIONS)
def sample(table: Array, y0: float, h: float, y: float, phi: Array, dphi: Array) -> None:
    """φ and φ' at y by cubic Hermite interpolation of one leg's table (G, 2, R); zero outside the table."""
    u = (y - y0) / h
    g = int(math.floor(u))  # noqa: RUF046 - compiled, floor gives a float
    size = phi.shape[0]
    if g < 0 or g >= table.shape[0] - 1:
        for r in range(size):
            phi[r] = 0.0
            dphi[r] = 0.0
        return
    t = u - g
    t2 = t * t
    t3 = t2 * t
    h01 = 3.0 * t2 - 2.0 * t3
    h00 = 1.0 - h01
    h10 = (t3 - 2.0 * t2 + t) * h
    h11 = (t3 - t2) * h
    d01 = (6.0 * t - 6.0 * t2) / h
    d10 = 3.0 * t2 - 4.0 * t + 1.0
    d11 = 3.0 * t2 - 2.0 * t
    left, right = table[g], table[g + 1]
    for r in range(size):
        phi[r] = h00 * left[0, r] + h01 * right[0, r] + h10 * left[1, r] + h11 * right[1, r]
        dphi[r] = d01 * (right[0, r] - left[0, r]) + d10 * left[1, r] + d11 * right[1, r]


@njit(**OPTIONS)
def _solve(a: Array, b: Array, p: int) -> bool:
    """Solve a x = b in place for symmetric positive a[:p, :p] (Cholesky); False where it is not positive."""
    for i in range(p):
        for j in range(i + 1):
            total = a[i, j]
            for q in range(j):
                total -= a[i, q] * a[j, q]
            if i == j:
                if not total > 0.0:
                    return False
                a[i, i] = math.sqrt(total)
            else:
                a[i, j] = total / a[j, j]
    for i in range(p):
        total = b[i]
        for q in range(i):
            total -= a[i, q] * b[q]
        b[i] = total / a[i, i]
    for i in range(p - 1, -1, -1):
        total = b[i]
        for q in range(i + 1, p):
            total -= a[q, i] * b[q]
        b[i] = total / a[i, i]
    return True


@njit(**OPTIONS)
def damped_step(jtj: Array, jtr: Array, damping: float, least: float, chol: Array, step: Array) -> bool:
    """The step of (JᵀJ + λ diag + least) δ = −Jᵀr, of lower triangles; False where the matrix is not positive."""
    n_par = jtr.shape[0]
    for i in range(n_par):
        step[i] = -jtr[i]
        for j in range(i + 1):
            chol[i, j] = jtj[i, j]
        chol[i, i] = jtj[i, i] * (1.0 + damping) + least
    solved: bool = _solve(chol, step, n_par)
    return solved
