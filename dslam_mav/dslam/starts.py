"""Starts for the joint fit when the medium is known, and when its spread is not (theory, section 8).

The search runs on legs compressed at one C(t). Where C is unknown, one round is made at each of a few values an
octave apart, the joint fit with C free is made from the best, and the search goes on at the C it found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.beam import corners_by_energy, search_round
from dslam_mav.dslam.compress import Compressed, Samples, compress
from dslam_mav.dslam.fit import Fit, fit
from dslam_mav.dslam.joint import model_of
from dslam_mav.dslam.modes import Modes, misfit
from dslam_mav.dslam.problem import Known, Problem
from dslam_mav.dslam.scale import Scale, spread_scale
from dslam_mav.dslam.search import search
from dslam_mav.dslam.state import State

Array = NDArray[np.float64]

SPREAD_GRID = (0.9, 2.1, 5.0)  # times the scale of the readings: C tried when nothing is known of it
GROWTHS = (0.05, 0.4, 1.5)  # flight time over age tried when the age is unknown
RIVALS = (4, 3, 2)  # how many different C the best answers may lie at after each heat of the race
REFINED = 2  # modes of each round fitted with C free
REFINING_ITERATIONS = 12
SEARCHES = 3  # at most, while C still moves
SAME_LOG_SPREAD2 = 0.1
MAX_STARTS = 24


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


def starts(prob: Problem, k_sources: int, rng: np.random.Generator) -> Starts:
    """All that the search finds, in the order of its cost, at the C that fits best."""
    scale = Scale(1.0, None)
    if prob.spread2 is None:
        scale = spread_scale(samples(prob, np.ones(prob.y.size)), prob.ambient is None)
    grid, sigma = medium_grid(prob, scale.squared_spread), scale.sigma
    at, fitted = grid[0], []
    if len(grid) > 1:
        fitted = _race(prob, k_sources, grid, sigma, rng)
        at = _medium_of(fitted[0].state) if fitted else grid[len(grid) // 2]
    for _ in range(SEARCHES if len(grid) > 1 else 1):
        comp = compressed(prob, at, sigma)
        modes = search(comp, k_sources, rng)
        found = states(prob, comp, modes, at)
        if len(grid) == 1:
            break
        fitted = _refined(prob, [*found[:REFINED], *(f.state for f in fitted[:REFINED])])
        if not fitted:
            break
        before, at = at, _medium_of(fitted[0].state)
        if abs(at[0] - before[0]) < SAME_LOG_SPREAD2:
            break
    level = comp.sigma * float(np.sqrt(misfit(modes, comp, k_sources)))
    all_states = [*found, *(f.state for f in fitted)][:MAX_STARTS]
    return Starts(tuple(all_states), level, (comp.energy_out, comp.dof_out), int(comp.rank.sum()), modes.rounds)


def warm_starts(prob: Problem, k_sources: int, found: list[State], rng: np.random.Generator) -> Starts:
    """States already known, and what one round of the search at their C brings beside them."""
    at = _medium_of(found[0])
    comp = compressed(prob, at, None)
    modes = search_round(comp, k_sources, int(corners_by_energy(comp)[0]), rng)
    left = prob.y - model_of(prob, found[0])
    level = float(np.sqrt((left @ left + prob.outside) / prob.n_readings))
    both = (*found, *states(prob, comp, modes, at))
    return Starts(both, level, (comp.energy_out, comp.dof_out), int(comp.rank.sum()), 1)


def _race(
    prob: Problem, k_sources: int, grid: list[tuple[float, float]], sigma: float | None, rng: np.random.Generator
) -> list[Fit]:
    """Answers with C free, best first: a round at every C of the grid, then more at the C the best answers went to."""
    pool: list[Fit] = []
    places = grid
    for heat, rivals in enumerate(RIVALS):
        for at in places:
            comp = compressed(prob, at, sigma)
            corners = corners_by_energy(comp)
            more = search_round(comp, k_sources, int(corners[heat % corners.size]), rng)
            best = more.take(np.arange(min(REFINED, len(more))))
            pool += _refined(prob, states(prob, comp, best, at))
        pool.sort(key=lambda f: f.cost)
        places = _different_media(pool)[:rivals]
    return pool


def _different_media(fits: list[Fit]) -> list[tuple[float, float]]:
    """The media the answers ended with, best first, those alike told once."""
    media: list[tuple[float, float]] = []
    for f in fits:
        if all(abs(_medium_of(f.state)[0] - other[0]) > SAME_LOG_SPREAD2 for other in media):
            media.append(_medium_of(f.state))
    return media


def _refined(prob: Problem, candidates: list[State]) -> list[Fit]:
    """The joint fit with C free from every candidate, best first, priors left out."""
    bare = replace(prob, known=Known())
    fits = [fit(bare, state, iterations=REFINING_ITERATIONS) for state in candidates]
    return sorted((f for f in fits if np.isfinite(f.cost)), key=lambda f: f.cost)


def _medium_of(state: State) -> tuple[float, float]:
    return float(state.log_spread2.mean()), state.log_rate
