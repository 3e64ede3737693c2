"""The diffusion field of K instantaneous sources: Green's function (1)–(3), in d dimensions (Appendix E).

f(x, t) = Σ_k a_k (πC_k)^(−d/2) exp(−|x − S_k|²/C_k),   C_k(t) = 4μ(t − τ_k),   zero for t ≤ τ_k
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def squared_spread_m2(time_s: ArrayLike, diffusivity_m2_s: float, activation_s: ArrayLike) -> Array:
    """C = 4μ(t − τ), broadcast over times and activations; at or below zero where the source is not yet active."""
    age_s = np.asarray(time_s, dtype=np.float64) - np.asarray(activation_s, dtype=np.float64)
    return np.asarray(4.0 * diffusivity_m2_s * age_s)


def peak_reading(amplitude: ArrayLike, squared_spread: ArrayLike, dimensions: int) -> Array:
    """a (πC)^(−d/2): what a sensor reads at the source itself, above ambient."""
    return np.asarray(
        np.asarray(amplitude, dtype=np.float64) * (np.pi * np.asarray(squared_spread)) ** (-0.5 * dimensions)
    )


def field(points_m: ArrayLike, squared_spread: ArrayLike, position_m: ArrayLike, amplitude: ArrayLike) -> Array:
    """Field at `points_m` (M, d) of sources at `position_m` (K, d), `amplitude` (K,); C is a scalar, (K,) or (M, K).

    Returns (M,), without ambient. A source whose C is not positive has not been released yet and adds nothing.
    """
    points = np.asarray(points_m, dtype=np.float64)
    sources = np.asarray(position_m, dtype=np.float64)
    dimensions = points.shape[1]
    distance2 = ((points[:, None, :] - sources[None, :, :]) ** 2).sum(axis=2)
    c = np.broadcast_to(np.asarray(squared_spread, dtype=np.float64), distance2.shape)
    active = c > 0.0
    safe = np.where(active, c, 1.0)
    terms = peak_reading(np.asarray(amplitude)[None, :], safe, dimensions) * np.exp(-distance2 / safe)
    return np.asarray(np.where(active, terms, 0.0).sum(axis=1))
