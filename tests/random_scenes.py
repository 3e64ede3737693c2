"""Random scenes with known truth, and how an estimate is judged on them: shared by tests and benches.

Lengths are in units of √C unless a scale is given. The truth's own fit, started at the truth, says what cost there is
to reach. The truth's mode is where small steps from the truth lead: full ones may leap into another basin.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from itertools import pairwise, permutations

import numpy as np
from numpy.typing import NDArray

from dslam_mav import Flight, Leg, Medium, bound, estimate
from dslam_mav.dslam import fit as fitting
from dslam_mav.dslam import problem as posing
from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.field import field, squared_spread_m2
from dslam_mav.dslam.joint import evaluate
from dslam_mav.dslam.priors import PEAK_LOG_SD, PLAUSIBLE_PEAK
from dslam_mav.dslam.state import State, layout, moved
from dslam_mav.records import Estimate, Sources, Verdict
from missions.patterns import star

Array = NDArray[np.float64]

BOX = 1.6
APART = 0.8
INSIDE_95 = 5.991  # χ² of two degrees of freedom
FLOW_STEP = 0.2  # of a Gauss–Newton step
FLOW_MOST = 0.1  # radians, spreads, logarithms
FLOW_STEPS = 60
SAME_BASIN = 0.05  # in spreads: an answer this near the truth's own fit is in its basin


@dataclass(frozen=True, eq=False)
class Case:
    """A flight over a random scene; truth in the canonical gauge."""

    flight: Flight
    medium: Medium
    position_m: Array
    amplitude: Array
    heading_rad: Array
    noise_sd: float
    ambient: float
    age_s: Array


def random_case(
    seed: tuple[int, ...],
    k_sources: int,
    snr_db: float,
    *,
    vertices: Array | None = None,
    medium: Medium | None = None,
    readings_per_leg: int = 64,
    ambient: float = 0.0,
    age_over_flight: float | None = None,
    log_ages: float = 0.0,
) -> Case:
    """K sources uniform in ±1.6 √C about the path's centre, ≥ 0.8 √C apart, amplitudes 50–200 log-uniform.

    `age_over_flight`: the field evolves, and its age at the start is this many times the flight's duration.
    `log_ages`: each source has an age of its own, up to so much older or younger (in logarithms).
    """
    rng = np.random.default_rng(seed)
    path = star(7, 3, 3.2) if vertices is None else vertices
    path = path - path[:-1].mean(axis=0)
    position = random_places(rng, k_sources)
    amplitude = 50.0 * 4.0 ** rng.random(k_sources)
    flight_s = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())  # at 1 √C/s
    age = 1e9 if age_over_flight is None else age_over_flight * flight_s
    diffusivity = 0.25 / age
    ages = age * np.exp(rng.uniform(-log_ages, log_ages, k_sources)) if log_ages else np.full(k_sources, age)
    legs, clean, start_s = [], [], 0.0
    for a, b in pairwise(path):
        length = float(np.linalg.norm(b - a))
        s = length * np.arange(readings_per_leg) / readings_per_leg
        c = squared_spread_m2((start_s + s)[:, None], diffusivity, -ages)
        clean.append(field(a + s[:, None] * (b - a) / length, c, position, amplitude))
        legs.append((length, s, start_s + s))
        start_s += length
    noise_sd = float(np.sqrt(np.mean(np.concatenate(clean) ** 2) / 10.0 ** (snr_db / 10.0)))
    flown = tuple(
        Leg(length, s, t, y + ambient + noise_sd * rng.standard_normal(y.size))
        for (length, s, t), y in zip(legs, clean, strict=True)
    )
    canonical = to_canonical(path)
    turned = canonical.apply(path)
    step = np.diff(turned, axis=0)
    return Case(
        flight=Flight(flown),
        medium=medium or Medium(spread_m=1.0, static=True),
        position_m=canonical.apply(position),
        amplitude=amplitude,
        heading_rad=np.arctan2(step[:, 1], step[:, 0]),
        noise_sd=noise_sd,
        ambient=ambient,
        age_s=ages,
    )


def random_places(rng: np.random.Generator, count: int) -> Array:
    """(K, 2) in ±BOX, at least APART from each other, in spreads."""
    while True:
        places = rng.uniform(-BOX, BOX, (count, 2))
        apart = np.linalg.norm(places[:, None] - places[None], axis=2) + 10.0 * np.eye(count)
        if apart.min() > APART:
            return places


@dataclass(frozen=True, eq=False)
class Judged:
    """What an estimate of a case is worth; errors are RMS over the sources, in metres."""

    estimate: Estimate
    seconds: float
    found: bool  # its cost is at most (1 + 1e-4) times that of the fit started at the truth
    truth_listed: bool  # the truth's basin is the result or among its alternatives
    error_m: float
    bound_m: float  # Cramér–Rao, at the truth
    mode_error_m: float  # of the truth's mode; where it is not listed, of the mode nearest to the truth
    basin_error_m: float  # of the fit that small steps from the truth lead to: what the likelihood itself allows
    mode_bound_m: float  # what that mode's covariance predicts
    mode_nees: float  # of that mode, per degree of freedom
    mode_inside: float  # share of its sources whose 95 % ellipse holds the truth
    wrong: bool  # IDENTIFIED, and a source off by more than five standard deviations


def judge(case: Case, k_sources: int) -> Judged:
    """Estimate a case and compare with the truth."""
    begun = time.perf_counter()
    result = estimate(case.flight, case.medium, k_sources)
    seconds = time.perf_counter() - begun
    told = result.diagnostics
    noise_sd = told.get("priors_noise_sd", case.noise_sd)
    best, basin = truth_fit(case, noise_sd), truth_basin(case, noise_sd)
    of_priors = told["priors_cost"] / told["cost"] if told.get("cost") else 0.0
    cost = float(result.residual @ result.residual) * (1.0 + of_priors)
    modes = [result, *result.alternatives]
    listed = [i for i, mode in enumerate(modes) if _in_basin(mode, basin)]
    errors = [matched_error_m(mode, case.position_m) for mode in modes]
    nearest = int(np.nanargmin(errors)) if np.isfinite(errors).any() else 0
    own = min(listed, key=lambda i: matched_error_m(modes[i], basin.state.s), default=nearest)
    mode = modes[own]
    squares = (
        _squares(mode, case.position_m) if np.isfinite(mode.sources.position_m).all() else np.full(k_sources, np.nan)
    )
    return Judged(
        estimate=result,
        seconds=seconds,
        found=cost <= best.cost * (1.0 + 1e-4),
        truth_listed=bool(listed),
        error_m=errors[0],
        bound_m=bound_at_truth(case),
        mode_error_m=errors[own],
        basin_error_m=_rms_off(basin.state.s, case.position_m),
        mode_bound_m=float(np.sqrt(np.trace(mode.position_covariance_m2, axis1=1, axis2=2).mean())),
        mode_nees=float(squares.mean()) / 2.0,
        mode_inside=float((squares < INSIDE_95).mean()),
        wrong=result.verdict is Verdict.IDENTIFIED and bool(_squares(result, case.position_m).max() > 25.0),
    )


def _squares(mode: Estimate, truth: Array) -> Array:
    """(K,) squared Mahalanobis distances of the sources from the truth."""
    order = _matching(mode.sources.position_m, truth)
    off = mode.sources.position_m[order] - truth
    return np.array([o @ np.linalg.pinv(c) @ o for o, c in zip(off, mode.position_covariance_m2[order], strict=True)])


def _in_basin(mode: Estimate, best: fitting.Fit) -> bool:
    """Whether a mode is the truth's own fit: nearer than a twentieth of a spread, or half what it is unsure of."""
    if not np.isfinite(mode.sources.position_m).all():
        return False
    order = _matching(mode.sources.position_m, best.state.s)
    off = np.abs(mode.sources.position_m[order] - best.state.s)
    unsure = np.sqrt(np.diagonal(mode.position_covariance_m2[order], axis1=1, axis2=2))
    return bool((off < np.maximum(SAME_BASIN, 0.5 * unsure)).all())


def bound_at_truth(case: Case) -> float:
    """RMS over the sources of what the Cramér–Rao bound allows, at the truth."""
    step = case.flight.lengths_m[:, None] * np.stack([np.cos(case.heading_rad), np.sin(case.heading_rad)], axis=1)
    spread2 = case.medium.spread_m**2 if case.medium.spread_m else case.age_s / case.age_s.mean()
    sources = Sources(case.position_m, case.amplitude, case.amplitude / (np.pi * spread2), -case.age_s)
    least = bound(
        np.vstack([np.zeros(2), np.cumsum(step, axis=0)]), sources, case.medium,
        readings_per_leg=case.flight.legs[0].reading.size, speed_m_s=1.0, noise_sd=case.noise_sd,
    )  # fmt: skip
    return float(np.sqrt(np.trace(least.position_covariance_m2, axis1=1, axis2=2).mean()))


def truth_fit(case: Case, noise_sd: float | None = None) -> fitting.Fit:
    """The joint fit started at the truth."""
    prob = _with_own_prior(case, noise_sd)
    return fitting.settled(prob, fitting.fit(prob, _truth(case, prob)))


def _with_own_prior(case: Case, noise_sd: float | None = None) -> posing.Problem:
    """The case's problem as the estimate has it: with its prior on monstrous sources, weighed by the noise it took."""
    prob = posing.problem(case.flight, case.medium)
    peak = PLAUSIBLE_PEAK * float(np.ptp(prob.y))
    return replace(prob, known=posing.Known(peak=(peak, PEAK_LOG_SD / (noise_sd or case.noise_sd))))


def truth_basin(case: Case, noise_sd: float | None = None) -> fitting.Fit:
    """The fit that small steps from the truth lead to."""
    prob = _with_own_prior(case, noise_sd)
    state = _truth(case, prob)
    at = layout(prob, len(state.s))
    for _ in range(FLOW_STEPS):
        residual, jacobian = evaluate(prob, state, at)
        size = np.linalg.norm(jacobian, axis=0)
        step = -np.linalg.lstsq(jacobian / size, residual, rcond=1e-6)[0] / size
        longest = float(np.abs(np.delete(step, np.r_[at.ambient])).max())
        state = moved(prob, state, min(FLOW_STEP, FLOW_MOST / longest) * step, at)
    return fitting.settled(prob, fitting.fit(prob, state))


def _truth(case: Case, prob: posing.Problem) -> State:
    log_spread2 = np.log(case.age_s / case.age_s.mean()) if prob.spreads == "each" else 0.0
    theta = case.heading_rad - case.heading_rad[0]
    start = State.flat(prob, theta, case.position_m, np.log(case.amplitude), log_spread2)
    if prob.spread2 is not None:
        start = replace(start, log_spread2=np.broadcast_to(np.log(prob.spread2), len(case.amplitude)).copy())
    if prob.rate is None:
        start = replace(start, log_rate=float(np.log(1.0 / case.age_s.mean())))
    return replace(start, ambient=case.ambient)


def _matching(position: Array, truth: Array) -> list[int]:
    if not np.isfinite(position).all():
        return list(range(len(truth)))
    return list(min(permutations(range(len(truth))), key=lambda p: float(((position[list(p)] - truth) ** 2).sum())))


def matched_error_m(mode: Estimate, truth: Array) -> float:
    """RMS over the sources, each matched to one of the truth's (K, 2) in the same gauge; NaN without positions."""
    return _rms_off(mode.sources.position_m, truth)


def _rms_off(position: Array, truth: Array) -> float:
    return float(np.sqrt(((position[_matching(position, truth)] - truth) ** 2).sum(axis=1).mean()))
