"""A question put to the joint fit for a number of sources: what it finds, and the estimate that makes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dslam_mav.dslam.answer import assemble, nothing
from dslam_mav.dslam.answers import Answers
from dslam_mav.dslam.arguments import hopeless
from dslam_mav.dslam.certify import too_few
from dslam_mav.dslam.doubt import doubted
from dslam_mav.dslam.priors import Priors
from dslam_mav.dslam.problem import problem, steadied
from dslam_mav.dslam.solve import solve
from dslam_mav.dslam.starts import Starts
from dslam_mav.dslam.state import layout
from dslam_mav.dslam.task import Patience, Task
from dslam_mav.dslam.units import normalised, units_of
from dslam_mav.records import Estimate, Flight, Medium, Verdict


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """What was asked, but for the number of sources."""

    flight: Flight
    medium: Medium
    priors: Priors
    start: Estimate | None
    seed: int


def answered(
    question: Question, k_sources: int, patience: Patience = Patience.ALL, begun: Starts | None = None
) -> Answers | Estimate:
    """The fits for a given number of sources, or the estimate that has none, with so much `patience` where they do not
    fit; `begun`: what the search found, where it has been made. Both say in `diagnostics` what is left of the readings.
    """
    flight, medium = question.flight, question.medium
    tau = medium.activation_s
    if isinstance(tau, tuple) and len(tau) not in (1, k_sources):
        raise ValueError(f"medium.activation_s: expected one time or {k_sources}, got {len(tau)}")
    if not flight.n_readings:
        return nothing(flight, medium, k_sources, Verdict.TOO_FEW_DATA, "No reading lies on any leg.")
    raw = problem(flight, medium)
    reason = too_few(flight, layout(raw, k_sources).size, k_sources)
    if reason is not None:
        return nothing(flight, medium, k_sources, Verdict.TOO_FEW_DATA, reason)
    reason = hopeless(raw)
    if reason is not None:
        return nothing(flight, medium, k_sources, Verdict.NOT_IDENTIFIABLE, reason)
    unit = units_of(raw)
    prob, shaped = normalised(raw, unit), medium.extent is None
    task = Task(prob, k_sources, question.priors, unit, shaped, question.start, patience, begun=begun)
    solved = solve(task, np.random.default_rng(question.seed))
    if solved is None:
        return nothing(flight, medium, k_sources, Verdict.NOT_CONVERGED, "The search found no start.")
    return Answers(
        problem=solved.problem,
        fits=solved.fits,
        level=solved.level,
        freedom_inside=solved.freedom_inside,
        unit=unit,
        priors=question.priors,
        loose=solved.loose,
        begun=solved.begun,
    )


def whole(question: Question, found: Answers | Estimate) -> Estimate:
    """The estimate with its covariance, alternatives and verdict."""
    if isinstance(found, Estimate):
        return found
    result = assemble(question.flight, question.medium, found)
    steady = steadied(question.flight, result.medium.ambient_drift_per_s or 0.0)
    return doubted(result, steady, question.priors)
