"""Linear algebra on lanes: rows, packed symmetric matrices, and the step of Levenberg and Marquardt."""

from __future__ import annotations

from numba import njit

from dslam_mav.dslam.kernels.lanes import Lanes, load, splat, square_root, store, where_less
from dslam_mav.dslam.kernels.products import INLINE
from dslam_mav.dslam.kernels.tables import OPTIONS, Array

TINY_PIVOT = 1e-12  # of a parameter's own: the matrix is as good as singular, and the step along it none


@njit(**INLINE)
def add(rows: Array, row: int, more: Lanes) -> None:
    """rows[row] += more."""
    store(rows, row, load(rows, row) + more)


@njit(**INLINE)
def triangle(i: int, j: int) -> int:
    """Row of element (i, j ≤ i) of a symmetric matrix."""
    return i * (i + 1) // 2 + j


@njit(**OPTIONS)
def damped_step(matrix: Array, gradient: Array, damping: Lanes, chol: Array, step: Array, n_par: int) -> None:
    """(JᵀJ + λ diag) δ = −Jᵀr by Cholesky, packed; `chol` and `step` are overwritten, the step is in `step`."""
    for i in range(n_par):
        total = 0.0 - load(gradient, i)
        for j in range(i):
            entry = load(matrix, triangle(i, j))
            for q in range(j):
                entry = entry - load(chol, triangle(i, q)) * load(chol, triangle(j, q))
            entry = entry * load(chol, triangle(j, j))
            store(chol, triangle(i, j), entry)
            total = total - entry * load(step, j)
        own = load(matrix, triangle(i, i)) * (1.0 + damping) + 1e-12
        pivot = own
        for q in range(i):
            entry = load(chol, triangle(i, q))
            pivot = pivot - entry * entry
        # the diagonal holds 1/pivot^½: one division a row
        inverse = where_less(own * TINY_PIVOT, pivot, 1.0 / square_root(pivot), splat(0.0))
        store(chol, triangle(i, i), inverse)
        store(step, i, total * inverse)
    for i in range(n_par - 1, -1, -1):
        total = load(step, i)
        for q in range(i + 1, n_par):
            total = total - load(chol, triangle(q, i)) * load(step, q)
        store(step, i, total * load(chol, triangle(i, i)))


@njit(**INLINE)
def clipped(step: Lanes, most: float) -> Lanes:
    """The step, at most `most` either way."""
    step = where_less(step, splat(most), step, splat(most))
    return where_less(splat(-most), step, step, splat(-most))


@njit(**INLINE)
def accept(better: Lanes, worse: Lanes, rows: Array, rows_try: Array) -> None:
    """Lanes where better < worse take their rows from `rows_try`."""
    for i in range(rows.shape[0]):
        store(rows, i, where_less(better, worse, load(rows_try, i), load(rows, i)))
