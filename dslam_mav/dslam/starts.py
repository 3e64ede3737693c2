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
from dslam_mav.dslam.joint import Problem, State, evaluate, fit, squared_spread
from dslam_mav.dslam.modes import Modes, merge, misfit
from dslam_mav.dslam.search import search

Array = NDArray[np.float64]

SMALLEST_SPREAD = 0.12  # of the longest leg: the range of √C tried when nothing is known of it
OCTAVES = 7  # in C, upwards from there
GROWTHS = (0.05, 0.4, 1.5)  # flight time over age tried when the age is unknown
REFINED = 3  # modes refitted with C free to find where the search goes on
MIN_FREEDOM = 0.1  # share of readings a noise estimate must rest on
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


def medium_grid(prob: Problem) -> list[tuple[float, float]]:
    """(ln C, ln age) at the first reading to begin from: one pair where both are known."""
    age = np.log(prob.age_s) if prob.age_s is not None else 0.0
    if prob.evolution == "fixed":
        assert prob.spread2 is not None
        return [(float(np.log(prob.spread2)), float(age))]
    smallest = float(np.log((SMALLEST_SPREAD * prob.length.max()) ** 2))
    logs = [smallest + i * float(np.log(2.0)) for i in range(OCTAVES)]
    if prob.evolution == "spread":
        return [(c, float(age)) for c in logs]
    if prob.evolution == "age":
        assert prob.diffusivity is not None
        return [(c, c - float(np.log(4.0 * prob.diffusivity))) for c in logs]
    duration = max(float(prob.t[-1]), 1e-9)
    return [(c, float(np.log(duration / growth))) for c in logs for growth in GROWTHS]


def compressed(prob: Problem, log_spread2: float, log_age: float, sigma: float | None) -> Compressed:
    """The legs compressed at one C(t)."""
    blank = State(np.zeros(prob.length.size), np.zeros((1, 2)), np.zeros(1), log_spread2, log_age, prob.ambient or 0.0)
    spread2, _ = squared_spread(prob, blank)
    legs = []
    for j, length in enumerate(prob.length):
        here = prob.leg == j
        legs.append(Samples(float(length), prob.s[here], prob.y[here] - (prob.ambient or 0.0), spread2[here]))
    reference2 = float(spread2.mean())
    return compress(legs, reference2, ambient_unknown=prob.ambient is None, sigma=sigma)


def states(prob: Problem, comp: Compressed, modes: Modes, log_spread2: float, log_age: float) -> list[State]:
    """The modes in metres and reading units, with the ambient level that suits them."""
    out = []
    to_amplitude = np.log(comp.sigma * np.pi * comp.scale**2)
    for theta, s, alpha in zip(modes.theta, modes.s, modes.alpha, strict=True):
        state = State(theta.copy(), s * comp.scale, alpha + to_amplitude, log_spread2, log_age, prob.ambient or 0.0)
        if prob.ambient is None:
            bare = replace(prob, heading_prior=None, closed_sd_m=None, peak_prior=None)
            state = replace(state, ambient=-float(evaluate(bare, state)[0].mean()))
        out.append(state)
    return out


def _noise_from_smallest(prob: Problem, grid: list[tuple[float, float]]) -> float | None:
    """The readings' noise from what the richest basis leaves over that still leaves enough to measure it."""
    if len(grid) == 1:
        return None
    for log_spread2, log_age in grid:
        comp = compressed(prob, log_spread2, log_age, None)
        if comp.dof_out >= max(20.0, MIN_FREEDOM * prob.y.size):
            return comp.sigma
    return None


def starts(prob: Problem, k_sources: int, rng: np.random.Generator) -> Starts:
    """All that the search finds, in the order of its cost."""
    grid = medium_grid(prob)
    sigma = _noise_from_smallest(prob, grid)
    found: list[State] = []
    at = grid[0]
    if len(grid) > 1:
        found, at = _over_grid(prob, k_sources, grid, sigma, rng)
    comp = compressed(prob, *at, sigma)
    modes = search(comp, k_sources, rng)
    all_states = (states(prob, comp, modes, *at) + found)[:MAX_STARTS]
    level = comp.sigma * float(np.sqrt(misfit(modes, comp, k_sources)))
    return Starts(tuple(all_states), level, (comp.energy_out, comp.dof_out), int(comp.rank.sum()), modes.rounds)


def _over_grid(
    prob: Problem, k_sources: int, grid: list[tuple[float, float]], sigma: float | None, rng: np.random.Generator
) -> tuple[list[State], tuple[float, float]]:
    """One round at every C of the grid; the best few refitted with C free, and the C the best of them has."""
    candidates: list[tuple[float, State]] = []
    for at in grid:
        comp = compressed(prob, *at, sigma)
        modes = search_round(comp, k_sources, int(corners_by_energy(comp)[0]), rng)
        if not len(modes):
            continue
        modes = merge(modes.take(np.arange(0)), modes, 25.0 * misfit(modes, comp, k_sources))
        cost = modes.cost * comp.sigma**2 + comp.energy_out
        here = states(prob, comp, modes.take(np.arange(min(2, len(modes)))), *at)
        candidates += list(zip(cost.tolist(), here, strict=False))
    candidates.sort(key=lambda pair: pair[0])
    bare = replace(prob, heading_prior=None, closed_sd_m=None, peak_prior=None)
    fits = [fit(bare, state, iterations=25) for _, state in candidates[:REFINED]]
    fits.sort(key=lambda f: f.cost)
    if not fits:
        return [], grid[len(grid) // 2]
    best = fits[0].state
    return [f.state for f in fits], (best.log_spread2, best.log_age)
