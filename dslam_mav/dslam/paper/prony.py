"""Appendix B: the nodes u_k of s_m = Σ_k b_k u_k^m, and Cadzow's denoising before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from dslam_mav.dslam.paper.options import Solver

Complex = NDArray[np.complex128]


def toeplitz_matrix(samples: Complex, width: int) -> Complex:
    """(M − width + 1, width): the matrix S of (20), rows [s_{m+width−1} … s_m], for samples (M,)."""
    return np.asarray(toeplitz(samples[width - 1 :], samples[width - 1 :: -1]), dtype=np.complex128)


def strided_matrix(samples: Complex, width: int, stride: int) -> Complex:
    """S of (20) built from every `stride`-th sample, one row for every sample it can begin with."""
    rows = len(samples) - stride * (width - 1)
    columns = [samples[stride * i : stride * i + rows] for i in reversed(range(width))]
    return np.column_stack(columns).astype(np.complex128)


def cadzow(samples: Complex, k: int, iterations: int) -> Complex:
    """The samples (M,) made nearly those of K nodes: rank K and Toeplitz in turn (IV-D's denoising)."""
    width = len(samples) // 2 + 1
    if k >= min(width, len(samples) - width + 1):
        return samples
    index = (np.arange(len(samples) - width + 1)[:, None] + np.arange(width)[::-1][None, :]).ravel()
    count = np.bincount(index).astype(np.float64)
    for _ in range(iterations):
        left, values, right = np.linalg.svd(toeplitz_matrix(samples, width), full_matrices=False)
        low = ((left[:, :k] * values[:k]) @ right[:k]).ravel()
        mean = (np.bincount(index, low.real) + 1j * np.bincount(index, low.imag)) / count
        samples = np.asarray(mean, dtype=np.complex128)
    return samples


def nodes(matrix: Complex, k: int, solver: Solver) -> Complex:
    """(K,) the nodes u_k, from S of (20) with K + 1 columns (the pencil also takes more)."""
    if solver == "pencil":  # [48]–[50]: u_k are the eigenvalues of the pencil of S less its last, and its first, column
        _, _, right = np.linalg.svd(matrix, full_matrices=False)
        # Rows of `right` span the rows [u^{w−1} … 1] of S: the row space is invariant to the shift by one column.
        basis = right[:k].T
        return np.asarray(np.linalg.eigvals(np.linalg.lstsq(basis[1:], basis[:-1], rcond=None)[0]), dtype=np.complex128)
    if solver == "tls":  # h is the singular vector of the smallest singular value
        h = np.asarray(np.linalg.svd(matrix, full_matrices=True)[2][-1].conj(), dtype=np.complex128)
    else:  # (19) with h_0 = 1, least squares where there are more rows than K
        filtered = np.linalg.lstsq(matrix[:, 1:], -matrix[:, 0], rcond=None)[0]
        h = np.concatenate((np.ones(1, dtype=np.complex128), filtered))
    found = np.roots(h) if np.isfinite(h).all() else np.zeros(0)  # zeros of H(z), (18)
    # where h_0 is nothing a zero has gone to infinity; nodes that are none are 0
    return np.concatenate((found, np.zeros(k - len(found)))).astype(np.complex128)
