"""estimate(): from readings along straight legs to sources and path.

    compress → search → joint fit → certify → canonical gauge

Each step is a file of this folder. Failure is a value: a `Verdict` with a reason, never an exception; only misuse of
the arguments raises `ValueError`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from dslam_mav.dslam import joint
from dslam_mav.dslam.answer import assemble, nothing
from dslam_mav.dslam.certify import SAME_PLACE_SPREADS, WINDOW, Noise, noise, too_few
from dslam_mav.dslam.joint import Fit, Problem
from dslam_mav.dslam.starts import Starts, starts
from dslam_mav.records import Estimate, Flight, Medium, Verdict

Array = NDArray[np.float64]

MAX_SOURCES = 8
PLAUSIBLE_PEAK = 3.0  # times the readings' range: a stronger source must have been kept a spread away from ...
PEAK_LOG_SD = 0.8  # ... and the logarithm of what it has beyond costs by this standard deviation


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
    counter-clockwise from east, and their standard deviation; only their differences matter to the answer's shape.
    `seed` makes the search repeatable bit for bit. Raises ValueError for impossible arguments.
    """
    _check(flight, medium, n_sources, max_sources, method, heading_prior)
    # Sums in another order end in other bits: one BLAS thread, whatever the machine has. It is also faster here.
    with _threads().limit(limits=1, user_api="blas"):
        if n_sources is not None:
            return _with_k(flight, medium, n_sources, closed_sd_m, heading_prior, seed)
        return _choose_k(flight, medium, max_sources, closed_sd_m, heading_prior, seed)


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()  # type: ignore[no-untyped-call]


def _check(
    flight: Flight,
    medium: Medium,
    n_sources: int | None,
    max_sources: int,
    method: str,
    heading_prior: tuple[Array, float] | None,
) -> None:
    if method != "joint":
        raise ValueError(f'method: expected "joint", got {method!r}')
    for name, value in (("n_sources", n_sources), ("max_sources", max_sources)):
        if value is not None and not (isinstance(value, (int, np.integer)) and 1 <= value <= MAX_SOURCES):
            raise ValueError(f"{name}: expected a whole number from 1 to {MAX_SOURCES}, got {value!r}")
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
    if heading_prior is not None:
        heading, sd = np.asarray(heading_prior[0], dtype=np.float64), heading_prior[1]
        if heading.shape != (len(flight.legs),) or not np.isfinite(heading).all():
            raise ValueError(f"heading_prior: expected {len(flight.legs)} finite headings, got shape {heading.shape}")
        if not (np.isfinite(sd) and sd > 0.0):
            raise ValueError(f"heading_prior: expected a positive standard deviation, got {sd}")


def _with_k(
    flight: Flight,
    medium: Medium,
    k_sources: int,
    closed_sd_m: float | None,
    heading_prior: tuple[Array, float] | None,
    seed: int,
) -> Estimate:
    """The estimate for a given number of sources."""
    if not flight.n_readings:
        return nothing(flight, medium, k_sources, Verdict.TOO_FEW_DATA, "No reading lies on any leg.")
    prob = joint.problem(flight, medium)
    names = joint.parameter_names(prob, k_sources)
    reason = too_few(flight, len(names), k_sources)
    if reason is not None:
        return nothing(flight, medium, k_sources, Verdict.TOO_FEW_DATA, reason)
    span = float(np.ptp(prob.y))
    if span <= 1e-12 * float(np.abs(prob.y).max()):
        reason = (
            f"All {prob.y.size} readings are the same ({prob.y[0]:g}): no source is in reach, or the sensor is stuck."
        )
        return nothing(flight, medium, k_sources, Verdict.NOT_IDENTIFIABLE, reason)
    unit = _in_unit_range(prob, span)
    begun = starts(unit, k_sources, np.random.default_rng(seed))
    fits = _fits(unit, begun, k_sources, flight, closed_sd_m, heading_prior)
    if not fits:
        return nothing(flight, medium, k_sources, Verdict.NOT_CONVERGED, "The search found no start.")
    level = _level(unit, begun, fits[0], len(names))
    modes = _distinct(unit, fits, level)
    return assemble(flight, medium, unit, span, modes, level, begun.freedom_inside, heading_prior)


def _in_unit_range(prob: Problem, span: float) -> Problem:
    """The same problem with readings divided by their range, so that no tolerance depends on their unit."""
    ambient = None if prob.ambient is None else prob.ambient / span
    return replace(prob, y=prob.y / span, ambient=ambient)


def _fits(
    prob: Problem,
    begun: Starts,
    k_sources: int,
    flight: Flight,
    closed_sd_m: float | None,
    heading_prior: tuple[Array, float] | None,
) -> list[Fit]:
    """The joint fit from every start, best first; those that do not settle only where none does."""
    bounded = replace(prob, peak_prior=(PLAUSIBLE_PEAK, PEAK_LOG_SD / begun.sigma))
    fits = [joint.fit(bounded, state) for state in begun.states]
    fits = [f for f in fits if np.isfinite(f.cost)]
    fits.sort(key=lambda f: (not f.converged, f.cost))
    if fits and (heading_prior is not None or flight.closed or closed_sd_m is not None):
        fits = _with_priors(bounded, begun, fits, k_sources, flight, closed_sd_m, heading_prior)
    return [f for f in fits if f.converged] or fits[:1]


def _with_priors(
    prob: Problem,
    begun: Starts,
    fits: list[Fit],
    k_sources: int,
    flight: Flight,
    closed_sd_m: float | None,
    heading_prior: tuple[Array, float] | None,
) -> list[Fit]:
    """Every answer fitted again with the priors' rows, which weigh against the noise of the readings."""
    n_par = len(joint.parameter_names(prob, k_sources))
    sigma = _level(prob, begun, fits[0], n_par).variance ** 0.5
    closed = None
    if flight.closed or closed_sd_m is not None:
        closed = (closed_sd_m if closed_sd_m is not None else 1e-3 * float(prob.length.sum())) / sigma
    prior = None
    if heading_prior is not None:
        heading = np.asarray(heading_prior[0], dtype=np.float64)
        prior = (prior_side(heading) * (heading - heading[0]), heading_prior[1] / sigma)
    constrained = replace(prob, closed_sd_m=closed, heading_prior=prior)
    fits = [joint.fit(constrained, f.state) for f in fits]
    fits = [f for f in fits if np.isfinite(f.cost)]
    return sorted(fits, key=lambda f: (not f.converged, f.cost))


def prior_side(heading: Array) -> float:
    """+1 where the first real turn of the headings is counter-clockwise, −1 where it is clockwise."""
    sines = np.sin(np.diff(heading))
    turns = sines[np.abs(sines) > 1e-3]
    return -1.0 if turns.size and turns[0] < 0.0 else 1.0


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
    corners = joint.vertices(a.state.theta, prob.length) - joint.vertices(b.state.theta, prob.length)
    return float(max(nearest, np.linalg.norm(corners, axis=1).max()))


def _choose_k(
    flight: Flight,
    medium: Medium,
    max_sources: int,
    closed_sd_m: float | None,
    heading_prior: tuple[Array, float] | None,
    seed: int,
) -> Estimate:
    """K = 1, 2, … afresh, until the Bayesian information criterion first rises (theory, section 8)."""
    best: Estimate | None = None
    criterion = np.inf
    for k_sources in range(1, max_sources + 1):
        result = _with_k(flight, medium, k_sources, closed_sd_m, heading_prior, seed)
        here = result.diagnostics.get("bic", np.inf)
        if best is not None and not here < criterion:
            break
        best, criterion = result, here
    assert best is not None
    return best
