"""What fits of a flight have come to, and which of two such solutions its readings speak for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dslam_mav.dslam.certify import Noise
from dslam_mav.dslam.fit import Fit
from dslam_mav.dslam.joint import evaluate
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.starts import Starts
from dslam_mav.dslam.state import State, loose_corners

FREEDOM_GAIN = 12.0  # Δχ² from which a free shape, or loose corners, are believed


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """The problem with all that is known of it, its distinct fits, best first, and the residuals' level.

    `ends`: where all fits ended that were not far behind; `loose`: as the task had it; `begun`: what the search found.
    """

    problem: Problem
    fits: tuple[Fit, ...]
    level: Noise
    freedom_inside: int
    ends: tuple[State, ...]
    loose: float
    begun: Starts | None = None


def likelier(one: Solution, other: Solution, *, by: float = 0.0) -> bool:
    """Whether readings speak for one solution rather than another, `by` so much: by −2 ln of Laplace's evidence, at
    their own noise.
    """
    variance = min(one.level.outside, other.level.outside)
    return _surprise(one, variance) + by < _surprise(other, variance)


def _surprise(solution: Solution, variance: float) -> float:
    """−2 ln evidence of the best fit, without what all fits of a flight share."""
    prob, best = solution.problem, solution.fits[0]
    jacobian = evaluate(prob, best.state)[1]
    _, volume = np.linalg.slogdet(jacobian.T @ jacobian / variance)
    sds = np.empty(0) if prob.known.corner_sd is None else prob.known.corner_sd[loose_corners(prob)]
    return best.cost / variance + float(volume) + prob.dimensions * float(np.log(sds**2 * variance).sum())


def better(found: Solution, freer: Solution | None) -> Solution:
    """The freer solution, where it is one, and it fits better by more than freedom alone makes it."""
    if freer is None or (found.fits[0].converged and not freer.fits[0].converged):
        return found
    gain = found.fits[0].cost - freer.fits[0].cost
    return freer if gain > FREEDOM_GAIN * found.level.inside else found


def likeliest(solutions: Sequence[Solution | None]) -> Solution | None:
    """The one that readings speak for, of those there are."""
    best = None
    for one in solutions:
        if one is not None and (best is None or likelier(one, best)):
            best = one
    return best
