"""IV-C: the algebra of a parametric path r(t) = Σ_i c_i φ_i(t) with known φ_i, in units of √C.

Where source k alone is read, f = h_k e^{−|r − S_k|²}, and −ln f is linear in inner products of the unknowns:

    −ln f = Σ_ij φ_i φ_j c_iᵀc_j − 2 Σ_i φ_i c_iᵀS_k + |S_k|² − ln h_k,   h = a (πC)^{−d/2}

A regression gives them; the Gram matrix c_iᵀc_j, of rank d, gives the c_i up to a turn, these the S_k.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from dslam_mav.dslam.paper.layout import Failure

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SPAN = 1e-10  # singular values below this share of the largest: dependent functions
FLAT = 1e-9  # share of the Gram matrix's largest eigenvalue below which the path is a line
SETTLED = 1e-7  # singular values of the fit below this share of the largest: a direction left open
SAME = 1e-3  # shapes whose inner products differ by less than this share are one
STARTS = 24  # of the fit of dependent products
BEYOND = 1e9  # of the largest reading: where a wrong path is not followed further
D = 2
MOST_STEPS = 400
TIGHT = 1e-15  # tolerances of the fits: on to rounding


class Basis(NamedTuple):
    """Functions (N, r) as good as the known ones: independent, and zero at first where a shift is left open."""

    functions: Array


class Shape(NamedTuple):
    """Coefficients (r, 2) over a `Basis`, sources (K, 2), ln h (K,), all in units of √C."""

    coefficient: Array
    source: Array
    ln_height: Array


def independent(known: Array) -> Basis:
    """The known functions (N, P) as independent ones, without the shift that a constant among them leaves open."""
    ones = np.ones(len(known))
    constant = bool(np.abs(known @ np.linalg.lstsq(known, ones, rcond=SPAN)[0] - ones).max() < 1e-9)
    moved = known - known[0] if constant else known
    left, values, _ = np.linalg.svd(moved, full_matrices=False)
    rank = int((values > SPAN * max(values[0], 1e-300)).sum())
    return Basis(left[:, :rank] * np.sqrt(len(known)))


class Regression(NamedTuple):
    """Inner products x: the Gram matrix's upper triangle, then (c_iᵀS_k)_i and |S_k|² − ln h_k of every source.

    The readings say root @ x = right in the least-squares sense; `settled`: that they leave no other x.
    """

    x: Array
    root: Array
    right: Array
    settled: bool
    r: int
    k: int


def regress(basis: Basis, reading: Array, parts: list[Index]) -> Regression | Failure:
    """Inner products from the readings of each part (indices), one source to a part."""
    phi = basis.functions
    r, k = phi.shape[1], len(parts)
    i, j = np.triu_indices(r)
    products = phi[:, i] * phi[:, j] * np.where(i == j, 1.0, 2.0)
    rows, right = [], []
    for number, part in enumerate(parts):
        own = np.zeros((len(part), k * (r + 1)))
        own[:, number * (r + 1) : (number + 1) * (r + 1)] = np.column_stack((-2.0 * phi[part], np.ones(len(part))))
        weight = reading[part][:, None]  # noise of ln f is σ/f
        rows.append(np.hstack((products[part], own)) * weight)
        right.append(-np.log(reading[part]) * reading[part])
    matrix, measured = np.vstack(rows), np.concatenate(right)
    if len(matrix) < matrix.shape[1]:
        return Failure(f"{len(matrix)} readings near one source each, {matrix.shape[1]} inner products to find.")
    orthonormal, root = np.linalg.qr(matrix)
    size = np.linalg.norm(root, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    values = np.linalg.svd(root / size, compute_uv=False)
    told = orthonormal.T @ measured
    x = np.linalg.lstsq(root / size, told, rcond=SPAN)[0] / size
    return Regression(x, root, told, bool(values[-1] > SPAN * values[0]), r, k)


def shapes(found: Regression, rng: np.random.Generator) -> list[Shape] | Failure:
    """Every shape with these inner products: one where the readings settle them all, else those of rank d."""
    if found.r < D:
        return Failure("The path seems to be a straight line: on which side of it a source lies cannot be told.")
    if found.settled:
        one = _factorised(found)
        return one if isinstance(one, Failure) else [one]
    return _of_rank_two(found, rng)


def _gram(x: Array, r: int) -> Array:
    i, j = np.triu_indices(r)
    gram = np.zeros((r, r))
    gram[i, j] = gram[j, i] = x[: len(i)]
    return gram


def _factorised(found: Regression) -> Shape | Failure:
    r, k = found.r, found.k
    values, axes = np.linalg.eigh(_gram(found.x, r))
    if values[-D] <= FLAT * values[-1]:
        return Failure("The path seems to be a straight line: on which side of it a source lies cannot be told.")
    c = axes[:, -D:] * np.sqrt(values[-D:])  # c_iᵀc_j = Gram matrix, up to a turn
    own = found.x[r * (r + 1) // 2 :].reshape(k, r + 1)
    source = np.linalg.lstsq(c, own[:, :r].T, rcond=None)[0].T  # c_iᵀ S_k
    return Shape(c, source, (source**2).sum(axis=1) - own[:, r])


def _of_rank_two(found: Regression, rng: np.random.Generator) -> list[Shape] | Failure:
    """Shapes where products of the basis' functions are dependent, so that only rank d settles the Gram matrix.

    PAPER DEVIATION: the paper's regression has no answer there. The inner products of vectors in the plane are fitted
    in its place, from starts drawn about their size; every fit that leaves as little as the best is an answer.
    """
    r, k = found.r, found.k
    if len(found.right) < (r + k) * D + k - 1:
        return Failure("Products of the path's functions are dependent: the readings leave its size open.")
    reach = np.sqrt(max(float(np.trace(_gram(found.x, r))) / r, 1.0))
    fits = []
    for _ in range(STARTS):
        c, s = reach * rng.standard_normal((r, D)), reach * rng.standard_normal((k, D))
        x0 = np.concatenate((c.ravel(), s.ravel(), (s**2).sum(axis=1)))
        fits.append(
            least_squares(
                _off,
                x0,
                jac=_slope,
                args=(found,),
                method="lm",
                max_nfev=MOST_STEPS // 4,
                ftol=TIGHT,
                xtol=TIGHT,
                gtol=TIGHT,
            )
        )
    fits.sort(key=lambda fit: float(fit.cost))
    best = fits[0]
    jacobian = _slope(best.x, found)
    values = np.linalg.svd(jacobian / np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300), compute_uv=False)
    if len(values) < len(best.x) or values[len(best.x) - 2] <= SETTLED * values[0]:  # one direction is the turn
        return Failure("Products of the path's functions are dependent: the readings leave its size open.")
    limit = float(best.cost) * 1.01 + 1e-16 * float(found.right @ found.right)
    kept: list[Shape] = []
    for fit in fits:
        c, s, e = _unpack(fit.x, r, k)
        shape = Shape(c, s, (s**2).sum(axis=1) - e)
        if fit.cost <= limit and not any(alike(shape, other) for other in kept):
            kept.append(shape)
    return kept


def _unpack(x: Array, r: int, k: int) -> tuple[Array, Array, Array]:
    return x[: r * D].reshape(r, D), x[r * D : (r + k) * D].reshape(k, D), x[(r + k) * D :]


def _off(x: Array, found: Regression) -> Array:
    """By how much the inner products of these vectors miss the regression's; padded, the turn being no unknown."""
    c, s, e = _unpack(x, found.r, found.k)
    i, j = np.triu_indices(found.r)
    own = np.column_stack((s @ c.T, e))
    off = found.root @ np.concatenate(((c @ c.T)[i, j], own.ravel())) - found.right
    return np.append(off, 0.0)


def _slope(x: Array, found: Regression) -> Array:
    c, s, _ = _unpack(x, found.r, found.k)
    r, k = found.r, found.k
    i, j = np.triu_indices(r)
    slope = np.zeros((found.root.shape[1], x.size))
    for axis in range(D):
        pair = np.arange(len(i))
        np.add.at(slope, (pair, i * D + axis), c[j, axis])
        np.add.at(slope, (pair, j * D + axis), c[i, axis])
        for m in range(k):
            row = len(i) + m * (r + 1) + np.arange(r)
            slope[row, np.arange(r) * D + axis] = s[m, axis]
            slope[row, (r + m) * D + axis] = c[:, axis]
    ends = len(i) + np.arange(k) * (r + 1) + r
    slope[ends, (r + k) * D + np.arange(k)] = 1.0
    return np.vstack((found.root @ slope, np.zeros(x.size)))


def alike(a: Shape, b: Shape) -> bool:
    """Whether two shapes are one but for a turn, a mirror image and the order of their sources."""
    order = np.argsort(-a.ln_height, kind="stable"), np.argsort(-b.ln_height, kind="stable")
    u = np.vstack((a.coefficient, a.source[order[0]]))
    v = np.vstack((b.coefficient, b.source[order[1]]))
    gram_u, gram_v = u @ u.T, v @ v.T
    return bool(np.abs(gram_u - gram_v).max() <= SAME * np.abs(gram_u).max())


def polish(basis: Basis, reading: Array, start: Shape) -> tuple[Shape, Array, bool]:
    """Least squares over all readings, from the regression's answer; with measured − model (N,).

    And whether the readings settle it: whether every change but a turn of the whole changes them.

    PAPER DEVIATION: the regression takes each part to be one source's alone; the others' tails are in it too.
    """
    phi, (r, k) = basis.functions, (len(start.coefficient), len(start.source))
    parts = np.cumsum([r * D, k * D])

    def unpack(x: Array) -> Shape:
        return Shape(x[: parts[0]].reshape(r, D), x[parts[0] : parts[1]].reshape(k, D), x[parts[1] :])

    def terms(shape: Shape) -> tuple[Array, Array]:
        off = (phi @ shape.coefficient)[:, None, :] - shape.source  # (N, K, 2)
        with np.errstate(over="ignore"):
            return off, np.exp(shape.ln_height - (off**2).sum(axis=2))

    def residual(x: Array) -> Array:
        off = terms(unpack(x))[1].sum(axis=1) - reading
        return np.asarray(np.clip(np.nan_to_num(off, nan=BEYOND), -BEYOND, BEYOND))

    def slope(x: Array) -> Array:
        off, term = terms(unpack(x))
        term = np.minimum(term, BEYOND)
        by_place = -2.0 * off * term[:, :, None]  # ∂f/∂r, of every source
        by_c = phi[:, :, None] * by_place.sum(axis=1)[:, None, :]
        return np.asarray(np.hstack((by_c.reshape(len(phi), -1), -by_place.reshape(len(phi), -1), term)))

    x0 = np.concatenate((start.coefficient.ravel(), start.source.ravel(), start.ln_height))
    if len(reading) < len(x0):
        return start, -residual(x0), False
    with np.errstate(over="ignore"):
        fit = least_squares(
            residual, x0, jac=slope, method="lm", max_nfev=MOST_STEPS, ftol=TIGHT, xtol=TIGHT, gtol=TIGHT
        )
    jacobian = slope(fit.x)
    values = np.linalg.svd(jacobian / np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300), compute_uv=False)
    return unpack(fit.x), -np.asarray(fit.fun), bool(values[-2] > SETTLED * values[0])  # the last one is the turn
