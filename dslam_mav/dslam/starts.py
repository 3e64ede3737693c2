"""Starts for the joint fit: the search on legs compressed at one C(t) (theory, section 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.beam import corners_by_energy, search_round
from dslam_mav.dslam.compress import Compressed, Samples, compress
from dslam_mav.dslam.fit import fit
from dslam_mav.dslam.folds import refitted, with_folds
from dslam_mav.dslam.joint import model_of
from dslam_mav.dslam.modes import Modes, misfit
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.search import search
from dslam_mav.dslam.state import State

Array = NDArray[np.float64]

SPREAD_GRID = (0.9, 2.1, 5.0)  # times the scale of the readings: C tried when nothing is known of it
GROWTHS = (0.05, 0.4, 1.5)  # flight time over age tried when the age is unknown
MAX_STARTS = 96
START_WINDOW = 12.0  # of χ² on compressed legs: an answer further behind does not come within nine of the best, …
GROWING_WINDOW = 16.0  # … and where the field grows on the way, and legs are compressed less exactly


@dataclass(frozen=True, slots=True, eq=False)
class Starts:
    """States to begin the joint fit from; `sigma`: the residuals' level the best of them has left; the energy and
    freedom that lie outside what sources can do.
    """

    states: tuple[State, ...]
    sigma: float
    outside: tuple[float, int]
    freedom_inside: int
    rounds: int


def medium_grid(prob: Problem, squared_spread_m2: float) -> list[tuple[float, float]]:
    """(ln C, ln 4μ) at the first reading to begin from: one pair where both are known, C of all sources alike."""
    fixed = -np.inf if prob.rate is None or prob.rate == 0.0 else float(np.log(prob.rate))
    if prob.spread2 is not None:
        return [(float(np.log(prob.spread2).mean()), fixed)]
    logs = [float(np.log(squared_spread_m2 * factor)) for factor in SPREAD_GRID]
    if prob.rate is not None:
        return [(c, fixed) for c in logs]
    if prob.age is not None:
        return [(c, c - float(np.log(prob.age).mean())) for c in logs]
    duration = max(float(prob.t[-1]), 1e-9)
    return [(c, c + float(np.log(growth / duration))) for c in logs for growth in GROWTHS]


def samples(prob: Problem, spread2: Array) -> list[Samples]:
    """The legs' readings less what is known of the ambient level, with C at every reading (n,).

    A reading more than a leg's length beyond either end counts as one there: no table need reach it. A slow sensor
    reads what lay its time constant behind.
    """
    out = []
    for j, length in enumerate(prob.length):
        own = prob.leg == j
        distance = prob.s[own]
        if prob.lag and distance.size > 1:
            distance = distance - prob.lag * np.gradient(distance, prob.t[own])
        distance = np.clip(distance, -length, 2.0 * length)
        out.append(Samples(float(length), distance, prob.y[own] - (prob.ambient or 0.0), spread2[own]))
    return out


def compressed(prob: Problem, at: tuple[float, float], sigma: float | None) -> Compressed:
    """The legs compressed at one C(t), the mean of the sources'."""
    spread2 = np.exp(at[0]) + np.exp(at[1]) * prob.t
    reference2 = float(spread2.mean())
    return compress(samples(prob, spread2), reference2, ambient_unknown=prob.ambient is None, sigma=sigma)


def states(prob: Problem, comp: Compressed, modes: Modes, at: tuple[float, float]) -> list[State]:
    """The modes in the problem's units, with the ambient level that suits them."""
    out = []
    to_amplitude = np.log(comp.sigma * np.pi * comp.scale**2)
    for theta, s, alpha in zip(modes.theta, modes.s, modes.alpha, strict=True):
        state = State.flat(prob, theta.copy(), s * comp.scale, alpha + to_amplitude, at[0])
        state = replace(state, log_rate=at[1])
        if prob.ambient is None:
            state = replace(state, ambient=float((prob.y - model_of(prob, state)).mean()))
        out.append(state)
    return out


def modes_of(comp: Compressed, found: Sequence[State]) -> Modes:
    """States as modes of compressed legs, their χ² left open."""
    to_amplitude = np.log(comp.sigma * np.pi * comp.scale**2)
    return Modes(
        np.stack([state.theta for state in found]),
        np.stack([state.s / comp.scale for state in found]),
        np.stack([state.log_amplitude - to_amplitude for state in found]),
        np.full(len(found), np.nan),
    )


def starts(prob: Problem, k_sources: int, rng: np.random.Generator) -> Starts:
    """All that the search finds at the known C, in the order of its cost."""
    (at,) = medium_grid(prob, 1.0)
    comp = compressed(prob, at, None)
    doubt = prob.doubt / comp.sigma**2
    modes = search(comp, k_sources, rng, doubt=doubt)
    unit = misfit(modes, comp, k_sources)
    window = (START_WINDOW if prob.rate == 0.0 else GROWING_WINDOW) * max(unit, doubt)
    near = modes.cost < modes.cost.min(initial=np.inf) + window
    found = states(prob, comp, modes.take(np.flatnonzero(near)[:MAX_STARTS]), at)
    if prob.ambient is None and found:
        found += _at_one_level(prob, at, found, window)
    return begin(comp, found, comp.sigma * float(np.sqrt(unit)), modes.rounds)


def _at_one_level(prob: Problem, at: tuple[float, float], found: list[State], window: float) -> list[State]:
    """The same answers, and their folds, where legs share the best one's ambient level: with each leg's own mean taken
    out, valleys are one that are two.
    """
    level = fit(prob, found[0]).state.ambient
    shared = replace(prob, ambient=level)
    comp = compressed(shared, at, None)
    modes = with_folds(comp, refitted(comp, modes_of(comp, found)), window, window)
    best = modes.take(np.arange(min(len(modes), MAX_STARTS)))
    return [replace(state, ambient=level) for state in states(shared, comp, best, at)]


def begin(comp: Compressed, found: Sequence[State], sigma: float, rounds: int) -> Starts:
    """States with what the compressed legs tell of the noise."""
    return Starts(tuple(found), sigma, (comp.energy_out, comp.dof_out), int(comp.rank.sum()), rounds)


def warm_starts(prob: Problem, k_sources: int, found: list[State], rng: np.random.Generator) -> Starts:
    """States already known, and what one round of the search at their C brings beside them."""
    at = medium_of(found[0])
    comp = compressed(prob, at, None)
    modes = search_round(comp, k_sources, int(corners_by_energy(comp)[0]), rng)
    left = prob.y - model_of(prob, found[0])
    level = float(np.sqrt((left @ left + prob.outside) / prob.n_readings))
    return begin(comp, [*found, *states(prob, comp, modes, at)], level, 1)


def medium_of(state: State) -> tuple[float, float]:
    """(ln C, ln 4μ) of a state, C the mean of its sources'."""
    return float(state.log_spread2.mean()), state.log_rate
