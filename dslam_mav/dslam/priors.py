"""What a person knows besides the readings: headings, a closed path, plausible strengths. Rows of the joint fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.align import MIN_TURN_SINE
from dslam_mav.dslam.problem import Problem, State, vertices

Array = NDArray[np.float64]

PLAUSIBLE_PEAK = 3.0  # times the readings' range: a stronger source must have been kept a spread away from …
PEAK_LOG_SD = 0.8  # … and the logarithm of what it has beyond costs by this standard deviation
OLDEST_FLIGHTS = 30.0  # flights: an older field stands still as far as one can tell; beyond it age costs by …
AGE_LOG_SD = 1.0  # … this standard deviation of its logarithm
CLOSED_SHARE = 1e-3  # of the path: how well a path said to be closed closes
RESTARTS = 40


@dataclass(frozen=True, slots=True, eq=False)
class Priors:
    """`heading_rad` (L,) with their standard deviation, counter-clockwise from east; `closed_sd_m` of the closure."""

    heading_rad: Array | None = None
    heading_sd_rad: float = 0.0
    closed_sd_m: float | None = None

    @property
    def any(self) -> bool:
        """Whether anything is known that the readings do not say."""
        return self.heading_rad is not None or self.closed_sd_m is not None

    @property
    def side(self) -> float:
        """+1 where the first real turn of the headings is counter-clockwise, −1 where it is clockwise."""
        if self.heading_rad is None:
            return 1.0
        sines = np.sin(np.diff(self.heading_rad))
        turns = sines[np.abs(sines) > MIN_TURN_SINE]
        return -1.0 if turns.size and turns[0] < 0.0 else 1.0

    @property
    def canonical_heading_rad(self) -> Array:
        """(L,) the headings as the canonical gauge has them: the first 0, the first turn counter-clockwise."""
        assert self.heading_rad is not None
        return np.asarray(self.side * (self.heading_rad - self.heading_rad[0]))


def bounded(prob: Problem, noise_sd: float) -> Problem:
    """With the priors every flight has: on strengths, and on the age of a field that hardly evolves."""
    age = (OLDEST_FLIGHTS * float(prob.t[-1]), AGE_LOG_SD / noise_sd) if prob.evolution == "both" else None
    return replace(prob, peak_prior=(PLAUSIBLE_PEAK, PEAK_LOG_SD / noise_sd), age_prior=age)


def constrained(prob: Problem, priors: Priors, noise_sd: float) -> Problem:
    """With all that is known, weighed against the noise of a reading."""
    closed = None if priors.closed_sd_m is None else priors.closed_sd_m / noise_sd
    heading = None
    if priors.heading_rad is not None:
        heading = (priors.canonical_heading_rad, priors.heading_sd_rad / noise_sd)
    return replace(bounded(prob, noise_sd), closed_sd_m=closed, heading_prior=heading)


def both_sides(prob: Problem, states: Sequence[State]) -> list[State]:
    """Every answer and its mirror image, turned to where its headings agree best with those known.

    Readings alone do not tell left from right, so that the search's canonical gauge may be the wrong one of the two.
    """
    if prob.heading_prior is None:
        return list(states)
    out = []
    for state in states:
        for side in (1.0, -1.0):
            theta = side * state.theta
            off = prob.heading_prior[0] - theta
            turn = float(np.arctan2(np.sin(off).sum(), np.cos(off).sum()))
            out.append(replace(state, theta=theta, s=state.s * np.array([1.0, side]), turn=turn))
    return out


def lone_starts(prob: Problem, priors: Priors, like: State, rng: np.random.Generator) -> list[State]:
    """Starts for one source, whose readings alone leave its place and the path a continuum.

    Headings as known, or random turns; the source anywhere about that path.
    """
    spread = float(np.exp(0.5 * like.log_spread2))
    out = []
    for _ in range(RESTARTS):
        if priors.heading_rad is not None:
            theta = priors.canonical_heading_rad
        else:
            turn = 2.0 * np.pi / prob.length.size * rng.integers(1, max(2, (prob.length.size + 1) // 2))
            theta = np.concatenate([[0.0], np.cumsum(turn + 0.2 * rng.standard_normal(prob.length.size - 1))])
        path = vertices(theta, prob.length)
        place = rng.uniform(path.min(axis=0) - spread, path.max(axis=0) + spread)
        peak = np.log(np.pi) + like.log_spread2 + np.log(np.ptp(prob.y))
        out.append(replace(like, theta=theta, s=place[None, :], log_amplitude=np.array([peak])))
    return out
