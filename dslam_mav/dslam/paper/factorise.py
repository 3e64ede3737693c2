"""III-C and Appendix E: K ≥ 3 (3-D: 4) sources and L ≥ 3 (6) legs, directions by factorisation.

Ω_qj = Y_{q+1,j} − Y_{q,j} = (S_{q+1} − S_q)ᵀ c_j has rank d; |c_j| = 1 undoes what the factorisation leaves open.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.paper.layout import Failure, Layout, Projections, complete

Array = NDArray[np.float64]

FLAT = 1e-7  # singular values below this share of the largest are zero


def factorise(p: Projections) -> Layout | Failure:
    """Directions, sources and amplitudes; or in words why this step, not the problem, has none."""
    k, n_legs = p.y.shape
    d = p.dimensions
    unknowns = d * (d + 1) // 2  # of the symmetric W
    if k < d + 1 or n_legs < unknowns:
        return Failure(f"The factorisation needs {d + 1} sources and {unknowns} legs, got {k} and {n_legs}.")
    omega = np.diff(p.y, axis=0)  # (12), rows q, columns j
    _, values, right = np.linalg.svd(omega, full_matrices=False)  # (13)
    if len(values) < d or values[d - 1] <= FLAT * values[0]:
        shape = "a line" if d == 2 else "a plane"
        return Failure(f"The sources seem to lie on {shape}: the differences of their projections have rank below {d}.")
    # c̃_j of (14) is Δ times column j of V_dᵀ; Δ goes into A, so that sources far apart one way do not hide the other.
    tilted = right[:d].T * np.sqrt(n_legs)
    rows, columns = np.triu_indices(d)
    # 1 = c̃ᵀ W c̃ with W = A^{−T} A^{−1}, linear in the entries on and above the diagonal.
    quadratic = tilted[:, rows] * tilted[:, columns] * np.where(rows == columns, 1.0, 2.0)
    spread = np.linalg.svd(quadratic, compute_uv=False)
    if spread[unknowns - 1] <= FLAT * spread[0]:
        kind = "Fewer than three leg axes" if d == 2 else "The legs' directions lie on a cone or in a plane"
        return Failure(f"{kind}: unit lengths do not settle the factorisation.")
    # PAPER DEVIATION: legs count by how surely their centres are known; the paper weighs all alike.
    variance = p.var_y.mean(axis=0)
    sure = 1.0 / np.sqrt(variance + 1e-6 * np.median(variance) + 1e-300)
    entries = np.linalg.lstsq(quadratic * sure[:, None], sure, rcond=None)[0]
    w = np.zeros((d, d))
    w[rows, columns] = entries
    w[columns, rows] = entries  # W is the symmetric one, not A as Appendix E has it (theory, section 4)
    eigenvalues, axes = np.linalg.eigh(w)
    if eigenvalues[0] <= 0.0:
        return Failure("No set of unit directions has these projections: W is not positive definite.")
    root = (axes * np.sqrt(eigenvalues)) @ axes.T  # A^{−1} = R W^{1/2}, R free: the gauge
    direction = tilted @ root  # (15)
    # PAPER DEVIATION: under noise the equations of W hold on average only; every direction is made of length one.
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return complete(direction, p, "factorisation")
