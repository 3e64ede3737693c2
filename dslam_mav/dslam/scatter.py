"""Starts where no map of corners exists: random ones, raced (parametric paths, and space)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.fit import Fit, fit
from dslam_mav.dslam.path import climb_of_rise, places
from dslam_mav.dslam.problem import Known, Problem
from dslam_mav.dslam.scale import spread_scale
from dslam_mav.dslam.starts import Starts, samples
from dslam_mav.dslam.state import State, climbs_unknown

Array = NDArray[np.float64]

DRAWN = 160
PATH_SPREADS = 1.5
OFFSET_SPREADS = 0.6
HEATS = ((6, 40), (12, 14), (60, 8))  # iterations, and how many go on


def scatter(prob: Problem, k_sources: int, rng: np.random.Generator) -> Starts:
    """The best of many random paths with sources where the signal is, best first."""
    bare = replace(prob, spreads="shared" if prob.spreads == "each" else prob.spreads, extent=0.0, known=Known())
    pool = [_draw(bare, k_sources, rng) for _ in range(DRAWN)]
    fits: list[Fit] = []
    for iterations, keep in HEATS:
        fits = [fit(bare, state, iterations=iterations) for state in pool]
        fits = sorted((f for f in fits if np.isfinite(f.cost)), key=lambda f: f.cost)[:keep]
        pool = [f.state for f in fits]
    sigma = float(np.sqrt(fits[0].cost / max(prob.n_readings, 1))) if fits else 1.0
    return Starts(tuple(pool), sigma, (0.0, 0), prob.n_readings, len(HEATS))


def _draw(prob: Problem, k_sources: int, rng: np.random.Generator) -> State:
    """A random path, and sources about readings drawn by their signal."""
    d, spread2 = prob.dimensions, _spread2(prob, rng)
    spread = float(np.sqrt(spread2))
    path = State.flat(prob, np.zeros(prob.n_legs), np.zeros((k_sources, d)), np.zeros(k_sources), np.log(spread2))
    if prob.basis is not None:
        size = np.sqrt(((prob.basis - prob.basis.mean(axis=0)) ** 2).mean(axis=0))
        terms = rng.standard_normal((prob.basis.shape[1], d)) / np.where(size > 1e-9 * size.max(), size, 1.0)[:, None]
        path = replace(path, coefficients=PATH_SPREADS * spread * terms)
    else:
        turn = rng.uniform(0.0, 2.0 * np.pi, prob.n_legs - 1)
        path = replace(path, theta=np.concatenate([[0.0], np.cumsum(turn)]), climb=_climb(prob, rng))
    signal = np.maximum(prob.y - (np.median(prob.y) if prob.ambient is None else prob.ambient), 0.0) ** 2
    chance = signal / signal.sum() if signal.sum() > 0.0 else None
    seen = rng.choice(prob.y.size, size=k_sources, p=chance)
    offset = rng.standard_normal((k_sources, d)) * OFFSET_SPREADS * spread
    peak = np.abs(prob.y[seen]) + 1e-3
    amplitude = np.log(peak) + 0.5 * d * np.log(np.pi * spread2) + (offset**2).sum(axis=1) / spread2
    rate = path.log_rate
    if prob.rate is None:
        age = float(prob.age.mean()) if prob.age is not None else float(prob.t[-1]) * 10.0 ** rng.uniform(-0.3, 1.3)
        rate = float(np.log(spread2 / age))
    ambient = float(prob.y.min()) if prob.ambient is None else prob.ambient
    return replace(path, s=places(prob, path)[seen] + offset, log_amplitude=amplitude, log_rate=rate, ambient=ambient)


def _spread2(prob: Problem, rng: np.random.Generator) -> float:
    if prob.spread2 is not None:
        return float(prob.spread2.mean())
    if prob.basis is not None:
        return 1.0  # the scale of a parametric path is free anyway: nothing else has a length
    scale = spread_scale(samples(prob, np.ones(prob.y.size)), prob.ambient is None)
    return scale.squared_spread * float(2.0 ** rng.uniform(-0.5, 2.5))


def _climb(prob: Problem, rng: np.random.Generator) -> Array:
    if not climbs_unknown(prob):
        return climb_of_rise(prob)
    climb = np.arcsin(rng.uniform(-1.0, 1.0, prob.n_legs))
    climb[:2] = 0.0
    return climb
