"""Inverses of many information matrices at once, of which some may be singular or have overflowed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.bound import SINGULAR, UNSEEN_SD

Array = NDArray[np.float64]


def factors(information: Array) -> Array:
    """(M, P, P) G with GGᵀ the inverse, through scaled eigenvectors as in `bound.information`: what is not seen has a
    huge variance, and so has all of a matrix that is not finite.
    """
    size = np.sqrt(np.einsum("mpp->mp", information))
    scale = np.where(size > SINGULAR * size.max(axis=1, keepdims=True), size, 1.0)
    scaled = information / (scale[:, :, None] * scale[:, None, :])
    values, vectors = np.linalg.eigh(finite(scaled, np.zeros(scaled.shape[1:])))
    blind = values <= SINGULAR * values[:, -1:]
    root = np.where(blind, UNSEEN_SD, 1.0 / np.sqrt(np.where(blind, 1.0, values)))
    return np.asarray(vectors * root[:, None, :] / scale[:, :, None])


def inverses(information: Array, known: Array) -> Array:
    """(M, P, P) inverses; of a matrix that has none, that of what is `known` (M, P) of anything: nothing is seen."""
    own = np.arange(known.shape[1])
    least = np.zeros_like(information)
    least[:, own, own] = 1.0 / known
    try:
        inverse = np.linalg.inv(information)
    except np.linalg.LinAlgError:  # of one is of all
        inverse = np.array([_inverse(one) for one in information])
    return np.where(np.isfinite(inverse).all(axis=(1, 2), keepdims=True), inverse, least)


def _inverse(information: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(information))
    except np.linalg.LinAlgError:
        return np.full_like(information, np.nan)


def finite(matrices: Array, instead: Array) -> Array:
    """(…, P, P) with `instead` (P, P) for those that are not finite: their eigenvalues would not converge."""
    return np.where(np.isfinite(matrices).all(axis=(-2, -1), keepdims=True), matrices, instead)
