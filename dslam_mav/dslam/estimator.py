"""estimate(): from readings along straight legs to sources and path.

    compress → search → joint fit → certify → canonical gauge

Each step is a file of this folder. Failure is a value: a `Verdict` with a reason, never an exception; only misuse of
the arguments raises `ValueError`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from dslam_mav.dslam.answer import Answers, assemble, nothing
from dslam_mav.dslam.certify import SAME_PLACE_SPREADS, WINDOW, Noise, noise, too_few
from dslam_mav.dslam.fit import Fit, fit
from dslam_mav.dslam.priors import CLOSED_SHARE, Priors, both_sides, bounded, constrained, lone_starts
from dslam_mav.dslam.problem import Problem, parameter_names, problem, vertices
from dslam_mav.dslam.starts import Starts, starts
from dslam_mav.records import Estimate, Flight, Medium, Verdict

Array = NDArray[np.float64]

MAX_SOURCES = 8
DOUBTFUL_P = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class _Question:
    """What was asked, but for the number of sources."""

    flight: Flight
    medium: Medium
    priors: Priors
    seed: int


def estimate(
    flight: Flight,
    medium: Medium,
    n_sources: int | None = None,
    *,
    max_sources: int = 5,
    method: str = "joint",
    closed_sd_m: float | None = None,
    heading_prior: tuple[Array, float] | None = None,
    seed: int = 0,
) -> Estimate:
    """Sources and path of a flight, in the canonical gauge (theory, section 8).

    `n_sources` None: found by BIC, at most `max_sources`. `closed_sd_m`: the path ends where it began, give or take
    this (for `flight.closed` the default is a thousandth of the path). `heading_prior`: headings (L,) in radians,
    counter-clockwise from east, and their standard deviation; the answer is then anchored to them, its first vertex
    at (0, 0). `seed` makes the search repeatable bit for bit. Raises ValueError for impossible arguments.
    """
    _check(flight, medium, method)
    for name, value in (("n_sources", n_sources), ("max_sources", max_sources)):
        if value is not None and not (isinstance(value, (int, np.integer)) and 1 <= value <= MAX_SOURCES):
            raise ValueError(f"{name}: expected a whole number from 1 to {MAX_SOURCES}, got {value!r}")
    question = _Question(flight, medium, _priors(flight, closed_sd_m, heading_prior), seed)
    # Sums in another order end in other bits: one BLAS thread, whatever the machine has. It is also faster here.
    with _threads().limit(limits=1, user_api="blas"), np.errstate(over="ignore", invalid="ignore"):
        return _with_k(question, int(n_sources)) if n_sources is not None else _choose_k(question, max_sources)


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()  # type: ignore[no-untyped-call]


def _check(flight: Flight, medium: Medium, method: str) -> None:
    if method != "joint":
        raise ValueError(f'method: expected "joint", got {method!r}')
    if not flight.legs:
        raise ValueError("flight: expected at least one leg")
    if medium.dimensions != 2:
        raise ValueError(f"medium.dimensions: expected 2, got {medium.dimensions}")
    if medium.sensor_lag_s != 0.0:
        raise ValueError(f"medium.sensor_lag_s: expected 0, got {medium.sensor_lag_s}")
    first = next((float(leg.time_s[0]) for leg in flight.legs if leg.time_s.size), 0.0)
    tau = medium.activation_s
    if isinstance(tau, (int, float)) and tau >= first:
        raise ValueError(f"medium.activation_s: expected a time before the first reading at {first} s, got {tau}")
    only_spread = medium.static and (medium.spread_m is not None or medium.diffusivity_m2_s is None)
    if tau is None and not only_spread:
        raise ValueError('medium.activation_s: None would be one per source: expected a time, or "shared" for all')


def _priors(flight: Flight, closed_sd_m: float | None, heading_prior: tuple[Array, float] | None) -> Priors:
    if closed_sd_m is not None and not (np.isfinite(closed_sd_m) and closed_sd_m > 0.0):
        raise ValueError(f"closed_sd_m: expected a positive standard deviation, got {closed_sd_m}")
    if closed_sd_m is None and flight.closed:
        closed_sd_m = CLOSED_SHARE * float(flight.lengths_m.sum())
    if heading_prior is None:
        return Priors(closed_sd_m=closed_sd_m)
    heading, sd = np.array(heading_prior[0], dtype=np.float64), float(heading_prior[1])
    if heading.shape != (len(flight.legs),) or not np.isfinite(heading).all():
        raise ValueError(f"heading_prior: expected {len(flight.legs)} finite headings, got shape {heading.shape}")
    if not (np.isfinite(sd) and sd > 0.0):
        raise ValueError(f"heading_prior: expected a positive standard deviation, got {sd}")
    return Priors(heading, sd, closed_sd_m)


def _with_k(question: _Question, k_sources: int) -> Estimate:
    """The estimate for a given number of sources."""
    flight, medium = question.flight, question.medium
    if not flight.n_readings:
        return nothing(flight, medium, k_sources, Verdict.TOO_FEW_DATA, "No reading lies on any leg.")
    raw = problem(flight, medium)
    n_parameters = len(parameter_names(raw, k_sources))
    reason = too_few(flight, n_parameters, k_sources)
    if reason is not None:
        return nothing(flight, medium, k_sources, Verdict.TOO_FEW_DATA, reason)
    span = float(np.ptp(raw.y))
    if span <= 1e-12 * float(np.abs(raw.y).max()):
        reason = f"All {raw.y.size} readings are {raw.y[0]:g}: no source is in reach, or the sensor is stuck."
        return nothing(flight, medium, k_sources, Verdict.NOT_IDENTIFIABLE, reason)
    prob = _in_unit_range(raw, span)
    rng = np.random.default_rng(question.seed)
    begun = starts(prob, k_sources, rng)
    prob, fits = _fits(prob, begun, question.priors, rng)
    if not fits:
        return nothing(flight, medium, k_sources, Verdict.NOT_CONVERGED, "The search found no start.")
    level = _level(prob, begun, fits[0], n_parameters)
    answers = Answers(prob, tuple(_distinct(prob, fits, level)), level, begun.freedom_inside, span, question.priors)
    return assemble(flight, medium, answers)


def _in_unit_range(prob: Problem, span: float) -> Problem:
    """The same problem with readings divided by their range, so that no tolerance depends on their unit."""
    ambient = None if prob.ambient is None else prob.ambient / span
    return replace(prob, y=prob.y / span, ambient=ambient)


def _fits(prob: Problem, begun: Starts, priors: Priors, rng: np.random.Generator) -> tuple[Problem, list[Fit]]:
    """The problem with all that is known, and its fits from every start, best first.

    Those that do not settle count only where none does.
    """
    loose = bounded(prob, begun.sigma)
    fits = _sorted([fit(loose, state) for state in begun.states])
    if not fits or not priors.any:
        return loose, [f for f in fits if f.converged] or fits[:1]
    k_sources = len(fits[0].state.s)
    sigma = float(np.sqrt(_level(prob, begun, fits[0], len(parameter_names(prob, k_sources))).variance))
    tight = constrained(prob, priors, sigma)
    again = [f.state for f in fits]
    if k_sources == 1:
        again += lone_starts(prob, priors, fits[0].state, rng)
    fits = _sorted([fit(tight, state) for state in both_sides(tight, again)])
    return tight, [f for f in fits if f.converged] or fits[:1]


def _sorted(fits: list[Fit]) -> list[Fit]:
    return sorted((f for f in fits if np.isfinite(f.cost)), key=lambda f: (not f.converged, f.cost))


def _level(prob: Problem, begun: Starts, best: Fit, n_parameters: int) -> Noise:
    return noise(float(best.residual @ best.residual), prob.y.size, n_parameters, begun.outside, 1.0)


def _distinct(prob: Problem, fits: list[Fit], level: Noise) -> list[Fit]:
    """The best fit and every different one within the window."""
    kept: list[Fit] = []
    for f in fits:
        if (f.cost - fits[0].cost) / level.variance >= WINDOW:
            break
        spread = float(np.exp(0.5 * f.state.log_spread2))
        if all(_apart(prob, f, other) > SAME_PLACE_SPREADS * spread for other in kept):
            kept.append(f)
    return kept


def _apart(prob: Problem, a: Fit, b: Fit) -> float:
    """The largest distance between the sources of two answers, whatever their order, or the corners of their paths."""
    nearest = np.linalg.norm(a.state.s[:, None] - b.state.s[None, :], axis=2).min(axis=1).max()
    corners = vertices(a.state.theta, prob.length) - vertices(b.state.theta, prob.length)
    return float(max(nearest, np.linalg.norm(corners, axis=1).max()))


def _choose_k(question: _Question, max_sources: int) -> Estimate:
    """K = 1, 2, … afresh, until the Bayesian information criterion first rises (theory, section 8)."""
    best = _with_k(question, 1)
    for k_sources in range(2, max_sources + 1):
        result = _with_k(question, k_sources)
        if "cost" not in result.diagnostics:
            break  # too few data for so many
        if "cost" in best.diagnostics and not _more_is_better(best, result):
            break
        best = result
    return best


def _more_is_better(few: Estimate, more: Estimate) -> bool:
    """Whether n ln(cost) + P ln n is lower with more sources; both are counted over the same n.

    Residuals that may not be white (the larger model's, at 5 %) count as the numbers the legs can carry, not as
    readings: otherwise sources are added to mend the model's own misfit.
    """
    a, b = few.diagnostics, more.diagnostics
    n = float(b["n_readings"])
    if b["whiteness_p"] < DOUBTFUL_P:
        n = min(n, float(b["freedom_inside"]))
    extra = len(more.parameter_names) - len(few.parameter_names)
    return bool(n * np.log(max(b["cost"], 1e-300) / max(a["cost"], 1e-300)) + extra * np.log(n) < 0.0)
