"""A leg's readings as a sum of K Gaussians, f(s) = Σ_k A_k exp(−(s − Y_k)²/C_k)   (3), and its least-squares fit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_STEPS = 80
LONGEST_STEP = 0.5  # of a centre, in spreads; of ln C
EXACT = 3e-17  # residual, over the largest reading, that no step betters
GAIN = 1e-10  # a step that lowers the cost by less than this share is the last


class Gaussians(NamedTuple):
    """Centres Y (K,), heights A (K,) and squared spreads C (K,) on one leg."""

    y: Array
    a: Array
    c: Array


class LegFit(NamedTuple):
    """Gaussians with the covariance (2K, 2K) of (Y, A), or (3K, 3K) of (Y, A, ln C), for a unit noise variance.

    `condition`: sd of the worst centre, in √C, over the noise as a share of the leg's largest reading. Its log10 is how
    many digits the leg's step loses: to centres close together, and to sources that are faint on this leg.
    """

    gaussians: Gaussians
    covariance: Array
    condition: float
    cost: float


def model(s: Array, g: Gaussians) -> Array:
    """(N,) the sum (3) at distances s (N,)."""
    return np.asarray(np.exp(-((s[:, None] - g.y) ** 2) / g.c) @ g.a)


def jacobian(s: Array, g: Gaussians, free_spread: bool) -> Array:
    """(N, 2K or 3K): derivatives of the sum in Y, A and, where it is free, ln C."""
    u = s[:, None] - g.y
    shape = np.exp(-(u**2) / g.c)
    columns = [2.0 * u / g.c * shape * g.a, shape]
    if free_spread:
        columns.append(u**2 / g.c * shape * g.a)
    return np.hstack(columns)


def heights(s: Array, reading: Array, y: Array, c: Array) -> Array:
    """(K,) the heights that fit best for given centres: Appendix B's linear system, over all readings."""
    shape = np.exp(-((s[:, None] - y) ** 2) / c)
    return np.asarray(np.linalg.lstsq(shape, reading, rcond=1e-14)[0])


def assess(s: Array, reading: Array, g: Gaussians, free_spread: bool = False) -> LegFit:
    """How well these Gaussians fit a leg, and how surely they are known from it."""
    j = jacobian(s, g, free_spread)
    n = j.shape[1]
    size = np.linalg.norm(j, axis=0)
    size = np.where(size > 1e-150, size, 1e-150)
    _, values, right = np.linalg.svd(j / size, full_matrices=False)
    inverse = np.full((n, n), np.inf)
    if len(values) == n and values[-1] > 0.0:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            inverse = (right.T / values**2) @ right / size[:, None] / size[None, :]
    residual = reading - model(s, g)
    k = len(g.y)
    condition = float((np.sqrt(np.diag(inverse)[:k]) / np.sqrt(g.c)).max() * np.abs(reading).max())
    return LegFit(g, inverse, condition, float(residual @ residual))


def polish(s: Array, reading: Array, start: Gaussians, free_spread: bool = False) -> LegFit:
    """Levenberg–Marquardt on the leg's own readings, from Prony's answer.

    PAPER DEVIATION: the paper stops at Prony. Its filter loses as many digits as the leg is ill-conditioned, twice
    over; one fit to the readings gives half of them back, and is the maximum-likelihood answer under white noise.
    """
    k = len(start.y)
    g, damping = start, 1e-3
    residual = reading - model(s, g)
    cost = float(residual @ residual)
    rounding = s.size * (EXACT * float(np.abs(reading).max())) ** 2
    for _ in range(MOST_STEPS):
        j = jacobian(s, g, free_spread)
        size = np.linalg.norm(j, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        lowered = False
        for _ in range(8):
            padded = np.vstack((j / size, np.sqrt(damping) * np.eye(j.shape[1])))
            step = np.linalg.lstsq(padded, np.concatenate((residual, np.zeros(j.shape[1]))), rcond=None)[0] / size
            trial = _moved(g, step, k, free_spread)
            off = reading - model(s, trial)
            new = float(off @ off)
            if new < cost:
                lowered = cost - new > GAIN * cost
                g, residual, cost, damping = trial, off, new, max(damping * 0.03, 1e-18)
                break
            damping *= 10.0
        if not lowered or cost <= rounding:
            break
    return assess(s, reading, g, free_spread)


def _moved(g: Gaussians, step: Array, k: int, free_spread: bool) -> Gaussians:
    spread = np.sqrt(g.c)
    y = g.y + np.clip(step[:k], -LONGEST_STEP * spread, LONGEST_STEP * spread)
    c = g.c * np.exp(np.clip(step[2 * k :], -LONGEST_STEP, LONGEST_STEP)) if free_spread else g.c
    return Gaussians(y, g.a + step[k : 2 * k], c)
