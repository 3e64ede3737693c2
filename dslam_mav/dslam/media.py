"""Starts where C is unknown: rounds of the search at several C, each answer fitted with C free (theory, section 8).

A grid point an octave is enough to begin with; from then on rounds go to the C that the best answers ended with, all
of them, since the truth's is often not the best one's.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.beam import REACH_SPREADS, corners_by_energy, search_round
from dslam_mav.dslam.compress import Compressed
from dslam_mav.dslam.fit import Fit, fit
from dslam_mav.dslam.folds import DEPTH, folds_of, refitted
from dslam_mav.dslam.modes import Modes, misfit
from dslam_mav.dslam.pool import Pool, same_medium
from dslam_mav.dslam.problem import Known, Problem
from dslam_mav.dslam.scale import spread_scale
from dslam_mav.dslam.starts import (
    MAX_STARTS,
    Starts,
    begin,
    compressed,
    medium_grid,
    medium_of,
    modes_of,
    samples,
    states,
)

Medium = tuple[float, float]  # ln C and ln 4μ at the first reading

REACHES = (REACH_SPREADS, 3.5)  # of the rounds of a pair
MAX_ROUNDS = 36
REFINED = 4  # modes of each round fitted with C free
REFINED_WINDOW = 12.0  # of χ² at the round's own C, …
MEDIUM_OFF = 0.005  # … which is off the mode's own, so that this share of the readings is not explained
FIRST_ITERATIONS = 4
ASIDE = (1.0, -1.0)  # of every other round, in turn, its ln C beside the answer's own, …
BESIDE = 2.0  # … so many times the noise's share of the readings' range: alternatives fit at a C of their own
FOLD_WINDOW = 9.0  # answers whose χ² is within this of the best are folded, …
FOLDED = 12  # … so many at a time, …
FOLDS_REFINED = 16  # … and so many folds fitted
SHIFTS = (-0.7, 0.7, -0.35, 0.35)  # of ln C, where rounds look that know no answer near the truth
AMBIENT_STEP = 0.1  # of the noise: levels nearer than this are one


def media_starts(prob: Problem, k_sources: int, rng: np.random.Generator, *, threads: int = 2) -> Starts:
    """All answers nearly as good as the best; `threads` (1 or 2) changes none of them."""
    scale = spread_scale(samples(prob, np.ones(prob.y.size)), prob.ambient is None)
    grid = medium_grid(prob, scale.squared_spread)
    pool = Pool(replace(prob, known=Known()))
    seen: dict[tuple[Medium, float | None], Compressed] = {}

    def at_medium(at: Medium, ambient: float | None) -> Compressed:
        if (at, ambient) not in seen:
            told = prob if ambient is None else replace(prob, ambient=ambient)
            seen[at, ambient] = compressed(told, at, scale.sigma)
        return seen[at, ambient]

    def one(index: int, at: Medium, comp: Compressed, own: np.random.Generator) -> list[Fit]:
        order = corners_by_energy(comp)
        modes = search_round(comp, k_sources, int(order[index % order.size]), own, REACHES[index % len(REACHES)])
        begun = states(prob, comp, modes.take(_within(modes, modes, comp, REFINED_WINDOW)[:REFINED]), at)
        return [fit(pool.prob, state, iterations=FIRST_ITERATIONS) for state in begun]

    def pair(run: Callable[..., list[list[Fit]]], done: int) -> Compressed:
        indices = range(done, done + len(REACHES))
        where = [_medium_for(index, grid, pool) for index in indices]
        comps = [at_medium(*at) for at in where]
        for found in run(one, indices, [at for at, _ in where], comps, rng.spawn(len(REACHES))):
            pool.judge(found)
        return comps[-1]

    rounds, last = 0, at_medium(grid[0], None)
    with ThreadPoolExecutor(threads) as executor:
        while rounds < MAX_ROUNDS and not (rounds > len(grid) and pool.settled(last)):
            last = pair(lambda *of: list(executor.map(*of)), rounds)
            rounds += len(REACHES)
        _fold(pool, at_medium, executor)
    comp = at_medium(medium_of(pool.fits[0].state) if pool.fits else grid[len(grid) // 2], None)
    level = float(np.sqrt(pool.unit)) if pool.fits else comp.sigma
    return begin(comp, [f.state for f in pool.fits[:MAX_STARTS]], level, rounds)


def _fold(pool: Pool, at_medium: Callable[..., Compressed], executor: ThreadPoolExecutor) -> None:
    """Answers' folds, each fitted at the medium of the best answer with nearly its C, until they bring no news."""

    def begun(fits: list[Fit]) -> list[Fit]:
        at = _rounded(pool.prob, *medium_of(fits[0].state))
        comp = at_medium(at, _level(pool, fits[0]))
        known = modes_of(comp, [f.state for f in pool.fits])
        found = folds_of(comp, modes_of(comp, [f.state for f in fits]), known)
        beside = refitted(comp, known.take(np.array([pool.fits.index(fits[0])])))
        near = _within(beside, found, comp, FOLD_WINDOW)[:FOLDS_REFINED]
        starts = states(pool.prob, comp, found.take(near), at)
        return [fit(pool.prob, state, iterations=FIRST_ITERATIONS) for state in starts]

    done: list[Fit] = []
    for _ in range(DEPTH):
        near = [f for f in pool.fits if f.cost <= pool.fits[0].cost + FOLD_WINDOW * pool.measure]
        groups: list[list[Fit]] = []
        for f in [f for f in near if not any(f is other for other in done)][:FOLDED]:
            done.append(f)
            for group in groups:
                if same_medium(group[0].state, f.state):
                    group.append(f)
                    break
            else:
                groups.append([f])
        for found in list(executor.map(begun, groups)):
            pool.judge(found)


def _within(best: Modes, modes: Modes, comp: Compressed, window: float) -> NDArray[np.int64]:
    """Which modes have a χ² within a window of the best one's, and of what the round's own C adds to it."""
    unit = misfit(best, comp, modes.alpha.shape[1])
    most = window * unit + MEDIUM_OFF**2 * float((comp.legs.z**2).sum())
    return np.flatnonzero(modes.cost < best.cost.min(initial=np.inf) + most)


def _rounded(prob: Problem, log_spread2: float, log_rate: float) -> Medium:
    at = round(20.0 * log_spread2) / 20.0
    return at, _rate_at(prob, at, log_rate)


def _level(pool: Pool, f: Fit) -> float | None:
    """An answer's ambient level, rounded; None where it is known."""
    if pool.prob.ambient is not None:
        return None
    step = AMBIENT_STEP * float(np.sqrt(pool.unit))
    return step * round(f.state.ambient / step)


def _rate_at(prob: Problem, log_spread2: float, log_rate: float) -> float:
    """ln 4μ as known, by itself or by the age of a field with this ln C; rounded where it is to be found."""
    if prob.rate is not None:
        return float(np.log(prob.rate)) if prob.rate > 0.0 else -np.inf
    if prob.age is not None:
        return log_spread2 - float(np.log(prob.age).mean())
    return round(20.0 * log_rate) / 20.0


def _medium_for(index: int, grid: list[Medium], pool: Pool) -> tuple[Medium, float | None]:
    """Where a round is made: at every point of the grid once, then where the best answers went.

    There the ambient level is known too: a leg that hardly sees anything says so by its level alone, which is lost
    where every leg's own mean is taken out. Every second round does without, in case that the level is wrong. Every
    second one is made at a C beside the answer's, which suits alternatives that the answer's own C hides.
    """
    rivals = pool.rivals()
    if index < len(grid) or not rivals:
        return grid[index % len(grid)], None
    visit, which = divmod((index - len(grid)) // 2, len(rivals))
    f = rivals[which]
    told = index % 2 == 0
    c, rate = medium_of(f.state)
    if pool.lost and index // 2 % 2:
        shift = SHIFTS[index // 4 % len(SHIFTS)]
        c, rate, told = c + shift, rate + shift, False
    elif not pool.lost and (index + visit) % 2:
        beside = ASIDE[visit // 2 % len(ASIDE)] * BESIDE * float(np.sqrt(pool.unit) / np.ptp(pool.prob.y))
        c, rate = c + beside, rate + beside
    return _rounded(pool.prob, c, rate), _level(pool, f) if told else None
