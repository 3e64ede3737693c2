"""From the fits to the public `Estimate`: gauge, order, units, covariance, verdict."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam import bound, certify
from dslam_mav.dslam.answers import Answers
from dslam_mav.dslam.certify import Noise
from dslam_mav.dslam.fit import Fit
from dslam_mav.dslam.gauge import Placed, frame_covariance, in_order, placed
from dslam_mav.dslam.joint import evaluate, model_of
from dslam_mav.dslam.problem import Problem, problem, steadied
from dslam_mav.dslam.profile import second_moment
from dslam_mav.dslam.race import THREADS
from dslam_mav.dslam.shape import misshapen, moved_by_shape
from dslam_mav.dslam.sides import without_scale
from dslam_mav.dslam.state import Layout, State, layout, parameter_names
from dslam_mav.dslam.units import Units, in_si, normalised, parameter_units
from dslam_mav.records import Estimate, Flight, Medium, Path, Sources, Verdict

Array = NDArray[np.float64]

HEADING_MISFIT_SD = 5.0
RATE_UNKNOWN_LOG_SD = 1.0  # ln μ less sure than this: μ and τ are not known apart, only their product
ONLY_SHAPE = (
    "Only the shape is known, up to scale: with the spread unknown, path, places and spread may grow alike without "
    "changing a reading. The spread, two known points or the diffusivity would tell the size."
)
LEVEL = (
    "All legs are level: a source higher or lower and stronger reads the same. Legs that climb or sink would help, or "
    "dimensions=2 where sources lie in the plane flown."
)
SCALE = "scale: coefficients, places and √C grow alike, amplitudes by the d-th power"
WITHOUT_POSITIONS = (Verdict.NOT_CONVERGED, Verdict.NOT_IDENTIFIABLE)


def nothing(flight: Flight, medium: Medium, k_sources: int, verdict: Verdict, reason: str) -> Estimate:
    """An estimate without an answer: shapes kept, positions NaN."""
    d = medium.dimensions
    curve = flight.parametric
    n_legs = len(flight.legs) if curve is None else max(flight.n_readings - 1, 0)
    unknown = np.full(k_sources, np.nan)
    block = np.full((k_sources, d, d), np.nan)
    coefficients = None if curve is None else np.full((curve.basis.shape[1], d), np.nan)
    return Estimate(
        sources=Sources(np.full((k_sources, d), np.nan), unknown, unknown, unknown),
        path=Path(np.full((n_legs + 1, d), np.nan), np.full(n_legs, np.nan), coefficients),
        medium=medium,
        verdict=verdict,
        reason=reason,
        spread_m=float(medium.spread_m) if medium.spread_m is not None else float("nan"),
        position_covariance_m2=block,
        path_aligned_covariance_m2=block,
        parameter_covariance=np.empty((0, 0)),
        parameter_names=(),
        noise_sd=float("nan"),
        log_likelihood=float("nan"),
        residual=np.full(flight.n_readings, np.nan),
    )


def assemble(flight: Flight, medium: Medium, answers: Answers) -> Estimate:
    """The best fit as an Estimate with the others as its alternatives."""

    def one(f: Fit) -> Estimate:
        with np.errstate(over="ignore", invalid="ignore"):  # worker threads do not inherit the caller's
            return _one(flight, medium, answers, f)

    with ThreadPoolExecutor(THREADS) as threads:
        best, *others = threads.map(one, answers.fits)
    chosen = answers.fits[0]
    verdict, reason = certify.verdict(
        answers.level, best.position_covariance_m2, best.spread_m, len(others), chosen.converged
    )
    against = _against_headings(answers, chosen.state)
    if against is not None and verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS):
        verdict, reason = Verdict.MODEL_MISFIT, against
    unseen, told = best.unseen_directions, best.diagnostics
    if without_scale(answers.problem) and answers.problem.known.points is None and verdict is not Verdict.NOT_CONVERGED:
        verdict, reason = Verdict.NOT_IDENTIFIABLE, ONLY_SHAPE
        unseen, told = (SCALE, *unseen[1:]), {**told, "shape": _shape(best)}
    elif _level(answers.problem) and verdict is not Verdict.NOT_CONVERGED:
        verdict, reason = Verdict.NOT_IDENTIFIABLE, LEVEL
    if (
        flat := certify.unseen(steadied(flight, best.medium.ambient_drift_per_s or 0.0), medium.ambient, best)
    ) is not None:
        verdict, reason = Verdict.NOT_IDENTIFIABLE, flat
    if verdict in WITHOUT_POSITIONS:
        empty = nothing(flight, medium, len(best.sources), verdict, reason)
        return replace(
            empty,
            medium=best.medium,
            spread_m=best.spread_m,
            noise_sd=best.noise_sd,
            log_likelihood=best.log_likelihood,
            residual=best.residual,
            parameter_covariance=best.parameter_covariance,
            parameter_names=best.parameter_names,
            unseen_directions=unseen,
            diagnostics=told,
        )
    alternatives = tuple(replace(e, verdict=verdict, reason="") for e in others)
    return replace(best, verdict=verdict, reason=reason, alternatives=alternatives)


def _told_by_readings(prob: Problem) -> Problem:
    """Without the prior on strength: where answers are a continuum, it alone would bound some of them."""
    return replace(prob, known=replace(prob.known, peak=None))


def _level(prob: Problem) -> bool:
    """Whether nothing says how high sources are: a e^{−z²/C} is all that a still field shows of a and z (3)."""
    return prob.dimensions == 3 and prob.static and prob.rise is not None and not prob.rise.any()


def _shape(best: Estimate) -> dict[str, Array]:
    """Sources (K, d) and coefficients (P, d) in units of √C: what is known where the scale is not."""
    assert best.path.coefficients_m is not None
    return {
        "source": best.sources.position_m / best.spread_m,
        "coefficient": best.path.coefficients_m / best.spread_m,
    }


def _against_headings(answers: Answers, state: State) -> str | None:
    """A leg that was not flown in its known heading, in words."""
    if (known := answers.problem.known.heading) is None:
        return None
    off = np.abs(np.angle(np.exp(1j * (state.theta + state.turn - known[0]))))
    worst = int(np.argmax(off))
    if (sds := off[worst] / answers.priors.heading_sd_rad) < HEADING_MISFIT_SD:
        return None
    return f"The readings put leg {worst + 1} {sds:.0f} standard deviations from its known heading."


def _one(flight: Flight, medium: Medium, answers: Answers, f: Fit) -> Estimate:
    prob, level, unit = answers.problem, answers.level, answers.unit
    state = in_order(prob, f.state)
    k_sources, d = state.s.shape
    at, names = layout(prob, k_sources), parameter_names(prob, k_sources)
    jacobian = evaluate(_told_by_readings(prob), state, at)[1]
    info = bound.information(jacobian, level.scatter)
    covariance = second_moment(prob, state, at, info.covariance, level.scatter)
    if level.excess:
        inverse = info.covariance / level.scatter
        covariance = covariance + moved_by_shape(jacobian, inverse, misshapen(prob, state), level.excess)
    where = placed(prob, state, at)
    aligned = np.einsum("ab,kbp->kap", where.rotation, bound.aligned_columns(prob, state, at))
    scale = parameter_units(at, unit)
    real = in_si(state, unit)
    amplitude, spread2 = np.exp(real.log_amplitude), np.exp(real.log_spread2)
    fitted, activation = _fitted(flight, medium, prob, real, _rate_told(at, info.covariance, prob, state))
    places_m = where.sources * unit.length
    own = bound.blocks(where.source_columns, covariance) * unit.length**2
    if not answers.priors.anchored:
        own = own + frame_covariance(flight, places_m, answers.loose)
    return Estimate(
        sources=Sources(places_m, amplitude, amplitude / (np.pi * spread2) ** (0.5 * d), activation),
        path=_path(prob, real, where, unit),
        medium=fitted,
        verdict=Verdict.IDENTIFIED,
        reason="",
        spread_m=float(np.sqrt(np.exp(real.log_spread2.mean()))),
        position_covariance_m2=own,
        path_aligned_covariance_m2=bound.blocks(aligned, covariance) * unit.length**2,
        parameter_covariance=covariance * np.outer(scale, scale),
        parameter_names=names,
        noise_sd=level.sd * unit.reading,
        log_likelihood=_log_likelihood(f.cost + prob.outside, prob.n_readings, level, unit.reading),
        residual=_residual(flight, medium, state, unit),
        gauge="anchored" if answers.priors.anchored else "canonical",
        unseen_directions=certify.unseen_in_words(info, names),
        diagnostics=answers.told(f),
    )


def _path(prob: Problem, real: State, where: Placed, unit: Units) -> Path:
    vertices = where.vertices * unit.length
    step = np.diff(vertices, axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    return Path(vertices, heading, None if prob.basis is None else real.coefficients @ where.rotation.T)


def _residual(flight: Flight, medium: Medium, state: State, unit: Units) -> Array:
    """(n,) measured − model at every reading, in its own units: the one pass over all readings after the fit."""
    prob = normalised(problem(flight, medium), unit)
    return (prob.y - model_of(prob, state)) * unit.reading


def _rate_told(at: Layout, covariance: Array, prob: Problem, state: State) -> bool:
    """Whether μ and τ are known apart."""
    if prob.rate is not None or prob.age is not None:
        return True
    last = at.medium.stop - 1
    oldest = np.log(prob.known.age[0]) if prob.known.age is not None else np.inf
    bounded_by_prior = bool((state.log_spread2 - state.log_rate > oldest).any())
    return float(np.sqrt(covariance[last, last])) <= RATE_UNKNOWN_LOG_SD and not bounded_by_prior


def _log_likelihood(cost: float, n: int, level: Noise, span: float) -> float:
    """ln p(readings | answer), priors' rows included, at the noise variance the errors are weighed with."""
    variance = level.variance
    return float(-0.5 * cost / variance - 0.5 * n * np.log(2.0 * np.pi * variance) - n * np.log(span))


def _fitted(flight: Flight, medium: Medium, prob: Problem, real: State, rate_told: bool) -> tuple[Medium, Array]:
    """The medium with what was estimated filled in, and every source's activation time (NaN: cannot be known)."""
    curve = flight.parametric
    first = float(flight.legs[0].time_s[0] if curve is None else curve.time_s[0])
    spread2, mu = np.exp(real.log_spread2), medium.diffusivity_m2_s
    if prob.age is not None:
        known = first - np.asarray(medium.activation_s, dtype=np.float64)
        mu = mu or float(spread2.mean() / (4.0 * known.mean()))
    elif not medium.static and mu is None and rate_told:
        mu = float(np.exp(real.log_rate)) / 4.0
    age = spread2 / (4.0 * mu) if mu else np.full(spread2.shape, np.nan)
    activation = first - age
    told = bool(np.isfinite(activation).all())
    same = bool(np.ptp(spread2) == 0.0)
    fitted = replace(
        medium,
        diffusivity_m2_s=mu,
        activation_s=None if not told else float(activation[0]) if same else tuple(activation.tolist()),
        spread_m=float(np.sqrt(spread2[0])) if medium.static and same else None,
        ambient=real.ambient,
        sensor_lag_s=float(np.exp(real.log_lag)),
        extent=real.extent,
        ambient_drift_per_s=real.drift if prob.drift is None else medium.ambient_drift_per_s,
    )
    return fitted, activation
