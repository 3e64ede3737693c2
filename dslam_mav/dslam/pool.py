"""The distinct answers that rounds at several C have led to, and whether further rounds would bring more."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.compress import Compressed
from dslam_mav.dslam.fit import Fit, fit
from dslam_mav.dslam.kernels.distinct import farthest_apart
from dslam_mav.dslam.path import corners
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import State, layout

Array = NDArray[np.float64]

QUIET_ROUNDS = 4  # in a row that bring no news
HITS = 3  # rounds that must have led to the best answer
ITERATIONS = 10
FAR_BEHIND = 60.0  # in χ² after the first iterations: not worth more
DOUBT_SD = 1.0
LOST_SD = 6.0
POOL_WINDOW = 25.0  # answers whose χ² is within this of the best are kept, …
NEWS_WINDOW = 12.0  # … a new one within this is news
SAME_SPREADS = 0.05  # answers nearer than this are one
KNOWN_SPREADS = 0.04  # a mode nearer than this to an answer leads to it
SAME_LOG = 0.2  # media nearer than this are one
RIVALS = 3  # media that rounds go to in turn


@dataclass(slots=True, eq=False)
class Pool:
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
        wanted = QUIET_ROUNDS + (0 if self.prob.rate == 0.0 else 2)
        doubtful = inside > outside * (1.0 + DOUBT_SD * scatter)
        return self.hits >= HITS and self.quiet >= wanted * (2 if doubtful else 1)

    def _known(self, state: State) -> Fit | None:
        """The answer that a state leads to, where it is known already."""
        return next((f for f in self.fits if self._leads_to(state, f)), None)

    def _leads_to(self, state: State, f: Fit) -> bool:
        return same_medium(state, f.state) and apart(self.prob, state, f.state) < KNOWN_SPREADS * f.state.spread

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
            if not any(same_medium(f.state, other.state) for other in out):
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


def same_medium(one: State, other: State) -> bool:
    """Whether two answers have nearly the same C."""
    return abs(float(one.log_spread2[0] - other.log_spread2[0])) < SAME_LOG
