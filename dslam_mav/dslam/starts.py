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
from dslam_mav.dslam.joint import Fit, Problem, State, fit, residual_of, squared_spread
from dslam_mav.dslam.modes import Modes, merge, misfit, no_modes
from dslam_mav.dslam.search import search

Array = NDArray[np.float64]

SMALLEST_SPREAD = 0.12  # of the longest leg: the range of √C tried when nothing is known of it
OCTAVES = 7  # in C, upwards from there
GROWTHS = (0.05, 0.4, 1.5)  # flight time over age tried when the age is unknown
HEATS = (5, 4, 3)  # how many values of C stay in the race after each round
REFINED = 3  # modes of each refitted with C free to find where the search goes on
REFINING_ITERATIONS = 25
SEARCHES = 3  # at most, while C still moves
SAME_LOG_SPREAD2 = 0.1
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
            state = replace(state, ambient=-float(residual_of(bare, state).mean()))
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
    """All that the search finds, in the order of its cost, at the C that fits best."""
    grid = medium_grid(prob)
    sigma = _noise_from_smallest(prob, grid)
    at, fitted = grid[0], []
    if len(grid) > 1:
        fitted = _race(prob, k_sources, grid, sigma, rng)
        at = _medium_of(fitted[0].state) if fitted else grid[len(grid) // 2]
    for _ in range(SEARCHES if len(grid) > 1 else 1):
        comp = compressed(prob, *at, sigma)
        modes = search(comp, k_sources, rng)
        found = states(prob, comp, modes, *at)
        if len(grid) == 1:
            break
        fitted = _refined(prob, [*found[:REFINED], *(f.state for f in fitted[:REFINED])])
        before, at = at, _medium_of(fitted[0].state)
        if abs(at[0] - before[0]) < SAME_LOG_SPREAD2:
            break
    level = comp.sigma * float(np.sqrt(misfit(modes, comp, k_sources)))
    all_states = [*found, *(f.state for f in fitted)][:MAX_STARTS]
    return Starts(tuple(all_states), level, (comp.energy_out, comp.dof_out), int(comp.rank.sum()), modes.rounds)


def _race(
    prob: Problem, k_sources: int, grid: list[tuple[float, float]], sigma: float | None, rng: np.random.Generator
) -> list[Fit]:
    """One round at every C of the grid, more at the most promising; the best few answers fitted with C free."""
    comps = [compressed(prob, *at, sigma) for at in grid]
    found: list[Modes] = [no_modes(prob.length.size, k_sources) for _ in grid]
    racing = list(range(len(grid)))
    for heat, survivors in enumerate(HEATS):
        for i in racing:
            corners = corners_by_energy(comps[i])
            more = search_round(comps[i], k_sources, int(corners[heat % corners.size]), rng)
            found[i] = merge(found[i], more, np.inf)
        racing = sorted((i for i in racing if len(found[i])), key=lambda i: _left_over(comps[i], found[i]))[:survivors]
    candidates = []
    for i in racing:
        best = found[i].take(np.arange(min(REFINED, len(found[i]))))
        candidates += states(prob, comps[i], best, *grid[i])
    return _refined(prob, candidates)


def _left_over(comp: Compressed, modes: Modes) -> float:
    """The residual energy of the best mode, comparable between different C."""
    return float(modes.cost.min()) * comp.sigma**2 + comp.energy_out


def _refined(prob: Problem, candidates: list[State]) -> list[Fit]:
    """The joint fit with C free from every candidate, best first, priors left out."""
    bare = replace(prob, heading_prior=None, closed_sd_m=None, peak_prior=None)
    fits = [fit(bare, state, iterations=REFINING_ITERATIONS) for state in candidates]
    return sorted((f for f in fits if np.isfinite(f.cost)), key=lambda f: f.cost)


def _medium_of(state: State) -> tuple[float, float]:
    return state.log_spread2, state.log_age
