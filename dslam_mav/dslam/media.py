"""Starts where C is unknown: rounds of the search at several C, each answer fitted with C free (theory, section 8).

A grid point an octave is enough to begin with; from then on rounds go to the C that the best answers ended with, all
of them, since the truth's is often not the best one's.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.beam import REACH_SPREADS, corners_by_energy, search_round
from dslam_mav.dslam.compress import Compressed
from dslam_mav.dslam.fit import Fit, fit
from dslam_mav.dslam.kernels.distinct import farthest_apart
from dslam_mav.dslam.modes import misfit
from dslam_mav.dslam.path import corners
from dslam_mav.dslam.problem import Known, Problem
from dslam_mav.dslam.scale import spread_scale
from dslam_mav.dslam.starts import MAX_STARTS, Starts, begin, compressed, medium_grid, medium_of, samples, states
from dslam_mav.dslam.state import State, layout

Array = NDArray[np.float64]
Medium = tuple[float, float]  # ln C and ln 4μ at the first reading

REACHES = (REACH_SPREADS, 3.5)  # of the rounds of a pair
MAX_ROUNDS = 36
QUIET_ROUNDS = (4, 6, 4, 4, 6)  # in a row that bring no news, for K = 1 … 5 and more
HITS = 3  # rounds that must have led to the best answer
REFINED = 4  # modes of each round fitted with C free
REFINED_WINDOW = 12.0  # of χ² at the round's own C, …
MEDIUM_OFF = 0.005  # … which is off the mode's own, so that this share of the readings is not explained
FIRST_ITERATIONS = 4
ITERATIONS = 10
FAR_BEHIND = 60.0  # in χ² after the first iterations: not worth more
DOUBT_SD = 1.0
LOST_SD = 6.0
ASIDE = (1.0, -1.0)  # of every other round, in turn, its ln C beside the answer's own, …
BESIDE = 2.0  # … so many times the noise's share of the readings' range: alternatives fit at a C of their own
SHIFTS = (-0.7, 0.7, -0.35, 0.35)  # of ln C, where rounds look that know no answer near the truth
POOL_WINDOW = 25.0  # answers whose χ² is within this of the best are kept, …
NEWS_WINDOW = 12.0  # … a new one within this is news
SAME_SPREADS = 0.05  # answers nearer than this are one
KNOWN_SPREADS = 0.04  # a mode nearer than this to an answer leads to it
SAME_LOG = 0.2  # media nearer than this are one
AMBIENT_STEP = 0.1  # of the noise: levels nearer than this are one
RIVALS = 3  # media that rounds go to in turn


@dataclass(slots=True, eq=False)
class _Pool:
    """Distinct answers with C free, best first; how many rounds led to the best, and brought no news since.

    `lost`: even the best leaves far more than noise.
    """

    prob: Problem
    fits: list[Fit] = field(default_factory=list)
    hits: int = 0
    quiet: int = 0
    lost: bool = False

    @property
    def unit(self) -> float:
        """χ² of one degree of freedom."""
        return (self.fits[0].cost + self.prob.outside) / self.prob.n_readings

    @property
    def measure(self) -> float:
        """What differences of χ² are measured in."""
        return max(self.unit, self.prob.doubt)

    def judge(self, found: list[Fit]) -> None:
        """Take in a round's answers: those that lead to what is known already are not fitted further."""
        news = hit = False
        for begun in found:
            known = self._known(begun.state)
            if known is None and not (self.fits and begun.cost > self.fits[0].cost + FAR_BEHIND * self.measure):
                known, new = self._add(fit(self.prob, begun.state, iterations=ITERATIONS))
                news |= new
            hit |= known is not None and known is self.fits[0]
        self.hits = 1 if news and not hit else self.hits + int(hit)
        self.quiet = 0 if news else self.quiet + 1

    def settled(self, comp: Compressed) -> bool:
        """Whether further rounds would bring nothing: more are wanted where the best answer leaves more than noise."""
        if not self.fits:
            return False
        outside = comp.energy_out / max(comp.dof_out, 1)
        free = max(self.prob.n_readings - layout(self.prob, len(self.fits[0].state.s)).size - comp.dof_out, 1)
        inside = (self.fits[0].cost + self.prob.outside - comp.energy_out) / free
        scatter = np.sqrt(2.0 / free + 2.0 / max(comp.dof_out, 1))
        self.lost = inside > outside * (1.0 + LOST_SD * scatter)
        wanted = QUIET_ROUNDS[min(len(self.fits[0].state.s), len(QUIET_ROUNDS)) - 1]
        doubtful = inside > outside * (1.0 + DOUBT_SD * scatter)
        wanted += 0 if self.prob.rate == 0.0 else 2
        return self.hits >= HITS and self.quiet >= wanted * (2 if doubtful else 1)

    def _known(self, state: State) -> Fit | None:
        """The answer that a state leads to, where it is known already."""
        return next((f for f in self.fits if self._leads_to(state, f)), None)

    def _leads_to(self, state: State, f: Fit) -> bool:
        same_medium = abs(float(state.log_spread2[0] - f.state.log_spread2[0])) < SAME_LOG
        return same_medium and apart(self.prob, state, f.state) < KNOWN_SPREADS * f.state.spread

    def _add(self, new: Fit) -> tuple[Fit | None, bool]:
        """The answer kept for it, and whether that is a new one, nearly as good as the best."""
        if not np.isfinite(new.cost):
            return None, False
        same = next((f for f in self.fits if self._apart(new, f) < SAME_SPREADS), None)
        kept = new if same is None or new.cost < same.cost else same
        others = [f for f in self.fits if f is not same]
        self.fits = sorted([*others, kept], key=lambda one: one.cost)
        self.fits = [f for f in self.fits if f.cost <= self.fits[0].cost + POOL_WINDOW * self.measure]
        return kept, same is None and new.cost <= self.fits[0].cost + NEWS_WINDOW * self.measure

    def _apart(self, one: Fit, other: Fit) -> float:
        return apart(self.prob, one.state, other.state) / other.state.spread

    def rivals(self) -> list[Fit]:
        """The best answer of each medium, best first."""
        out: list[Fit] = []
        for f in self.fits:
            if all(abs(float(f.state.log_spread2[0] - other.state.log_spread2[0])) > SAME_LOG for other in out):
                out.append(f)
        return out[:RIVALS]


def apart(prob: Problem, a: State, b: State) -> float:
    """The largest distance between the sources of two answers, whatever their order, or the corners of their paths."""
    if prob.basis is None and prob.dimensions == 2:
        return float(farthest_apart(a.s, b.s, _flown(prob, a), _flown(prob, b)))
    nearest = np.linalg.norm(a.s[:, None] - b.s[None, :], axis=2).min(axis=1).max()
    off = corners(prob, a) - corners(prob, b)
    return float(max(nearest, np.linalg.norm(off, axis=1).max()))


def _flown(prob: Problem, state: State) -> tuple[Array, Array, Array]:
    return state.theta, prob.length + state.longer, state.gap


def media_starts(prob: Problem, k_sources: int, rng: np.random.Generator, *, threads: int = 2) -> Starts:
    """All answers nearly as good as the best; `threads` (1 or 2) changes none of them."""
    scale = spread_scale(samples(prob, np.ones(prob.y.size)), prob.ambient is None)
    grid = medium_grid(prob, scale.squared_spread)
    pool = _Pool(replace(prob, known=Known()))
    seen: dict[tuple[Medium, float | None], Compressed] = {}

    def at_medium(at: Medium, ambient: float | None) -> Compressed:
        if (at, ambient) not in seen:
            told = prob if ambient is None else replace(prob, ambient=ambient)
            seen[at, ambient] = compressed(told, at, scale.sigma)
        return seen[at, ambient]

    def one(index: int, at: Medium, comp: Compressed, own: np.random.Generator) -> list[Fit]:
        order = corners_by_energy(comp)
        modes = search_round(comp, k_sources, int(order[index % order.size]), own, REACHES[index % len(REACHES)])
        window = REFINED_WINDOW * misfit(modes, comp, k_sources) + MEDIUM_OFF**2 * float((comp.legs.z**2).sum())
        near = modes.cost < modes.cost.min(initial=np.inf) + window
        begun = states(prob, comp, modes.take(np.flatnonzero(near)[:REFINED]), at)
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
    comp = at_medium(medium_of(pool.fits[0].state) if pool.fits else grid[len(grid) // 2], None)
    level = float(np.sqrt(pool.unit)) if pool.fits else comp.sigma
    return begin(comp, [f.state for f in pool.fits[:MAX_STARTS]], level, rounds)


def _rate_at(prob: Problem, log_spread2: float, log_rate: float) -> float:
    """ln 4μ as known, by itself or by the age of a field with this ln C; rounded where it is to be found."""
    if prob.rate is not None:
        return float(np.log(prob.rate)) if prob.rate > 0.0 else -np.inf
    if prob.age is not None:
        return log_spread2 - float(np.log(prob.age).mean())
    return round(20.0 * log_rate) / 20.0


def _medium_for(index: int, grid: list[Medium], pool: _Pool) -> tuple[Medium, float | None]:
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
    told = pool.prob.ambient is None and index % 2 == 0
    step = AMBIENT_STEP * float(np.sqrt(pool.unit))
    c, rate = medium_of(f.state)
    if pool.lost and index // 2 % 2:
        shift = SHIFTS[index // 4 % len(SHIFTS)]
        c, rate, told = c + shift, rate + shift, False
    elif not pool.lost and (index + visit) % 2:
        beside = ASIDE[visit // 2 % len(ASIDE)] * BESIDE * float(np.sqrt(pool.unit) / np.ptp(pool.prob.y))
        c, rate = c + beside, rate + beside
    at = round(20.0 * c) / 20.0, _rate_at(pool.prob, round(20.0 * c) / 20.0, rate)
    return at, step * round(f.state.ambient / step) if told else None
