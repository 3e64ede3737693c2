"""From the fits to the public `Estimate`: gauge, order, units, covariance, verdict."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam import bound, certify
from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.certify import Noise
from dslam_mav.dslam.fit import Fit
from dslam_mav.dslam.joint import evaluate
from dslam_mav.dslam.priors import Priors
from dslam_mav.dslam.problem import Problem, State, parameter_names, vertices
from dslam_mav.records import Estimate, Flight, Medium, Path, Sources, Verdict

Array = NDArray[np.float64]

HEADING_MISFIT_SD = 5.0
AGE_UNKNOWN_LOG_SD = 1.0  # ln age less sure than this: μ and τ are not known apart, only their product


def nothing(flight: Flight, medium: Medium, k_sources: int, verdict: Verdict, reason: str) -> Estimate:
    """An estimate without an answer: shapes kept, positions NaN."""
    n_legs, d = len(flight.legs), medium.dimensions
    unknown = np.full(k_sources, np.nan)
    block = np.full((k_sources, d, d), np.nan)
    return Estimate(
        sources=Sources(np.full((k_sources, d), np.nan), unknown, unknown, unknown),
        path=Path(np.full((n_legs + 1, d), np.nan), np.full(n_legs, np.nan)),
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


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """The distinct fits of a problem, best first, and what is needed to tell what they are worth.

    `span` is the unit the problem has its readings in; `freedom_inside` the numbers the legs can carry at most.
    """

    problem: Problem
    fits: tuple[Fit, ...]
    level: Noise
    freedom_inside: int
    span: float
    priors: Priors


def assemble(flight: Flight, medium: Medium, answers: Answers) -> Estimate:
    """The best fit as an Estimate with the others as its alternatives."""
    best, *others = [_one(flight, medium, answers, f) for f in answers.fits]
    alternatives = tuple(others)
    verdict, reason = certify.verdict(
        answers.level, best.position_covariance_m2, best.spread_m, len(others), answers.fits[0].converged
    )
    against = _against_headings(answers)
    if against is not None and verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS):
        verdict, reason = Verdict.MODEL_MISFIT, against
    if verdict in (Verdict.NOT_CONVERGED, Verdict.NOT_IDENTIFIABLE):
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
            unseen_directions=best.unseen_directions,
            diagnostics=best.diagnostics,
        )
    alternatives = tuple(replace(e, verdict=verdict, reason="") for e in alternatives)
    return replace(best, verdict=verdict, reason=reason, alternatives=alternatives)


def _against_headings(answers: Answers) -> str | None:
    """A leg that was not flown in its known heading, in words."""
    prob, state = answers.problem, answers.fits[0].state
    if prob.heading_prior is None:
        return None
    off = np.abs(np.angle(np.exp(1j * (state.theta + state.turn - prob.heading_prior[0]))))
    worst = int(np.argmax(off))
    sds = off[worst] / answers.priors.heading_sd_rad
    if sds < HEADING_MISFIT_SD:
        return None
    return f"The readings put leg {worst + 1} {sds:.0f} standard deviations from its known heading."


def _in_order(prob: Problem, f: Fit) -> tuple[State, Array]:
    """The fit's state and Jacobian with its sources ordered by amplitude, first turn towards +y."""
    state = f.state
    order = np.argsort(-state.log_amplitude, kind="stable")
    state = replace(state, s=state.s[order], log_amplitude=state.log_amplitude[order])
    mirrored = to_canonical(vertices(state.theta, prob.length)).mirrored
    if mirrored and prob.heading_prior is None:  # known headings tell left from right
        state = replace(state, theta=-state.theta, s=state.s * np.array([1.0, -1.0]))
    theta = (state.theta + np.pi) % (2.0 * np.pi) - np.pi
    state = replace(state, theta=theta)
    return state, evaluate(prob, state)[1]


def _one(flight: Flight, medium: Medium, answers: Answers, f: Fit) -> Estimate:
    prob, level, span = answers.problem, answers.level, answers.span
    state, jacobian = _in_order(prob, f)
    n_legs, k_sources, n = prob.length.size, len(state.s), prob.y.size
    info = bound.information(jacobian, level.variance)
    names = parameter_names(prob, k_sources)
    covariance = info.covariance.copy()
    if "ambient" in names:
        i = names.index("ambient")
        covariance[i, :] *= span
        covariance[:, i] *= span
    cost = float(f.residual @ f.residual)
    amplitude = np.exp(state.log_amplitude) * span
    spread2 = float(np.exp(state.log_spread2))
    age_sd = float(np.sqrt(covariance[names.index("ln age"), names.index("ln age")])) if "ln age" in names else 0.0
    fitted, activation = _fitted(flight, medium, prob, state, span)
    if age_sd > AGE_UNKNOWN_LOG_SD or _beyond_telling(prob, state):
        fitted, activation = replace(fitted, diffusivity_m2_s=None, activation_s=None), float("nan")
    diagnostics: dict[str, Any] = {
        "cost": cost,
        "n_readings": n,
        "freedom_inside": answers.freedom_inside,
        "residual_inside_sd": float(np.sqrt(level.inside)) * span,
        "residual_outside_sd": float(np.sqrt(level.outside)) * span,
        "whiteness_p": level.p_value,
        "systematic_share": level.systematic_share,
    }
    estimate = Estimate(
        sources=Sources(state.s, amplitude, amplitude / (np.pi * spread2), np.full(k_sources, activation)),
        path=Path(vertices(state.theta, prob.length), state.theta),
        medium=fitted,
        verdict=Verdict.IDENTIFIED,
        reason="",
        spread_m=float(np.sqrt(spread2)),
        position_covariance_m2=bound.source_blocks(covariance, n_legs, k_sources),
        path_aligned_covariance_m2=bound.path_aligned(covariance, state.theta, prob.length, state.s),
        parameter_covariance=covariance,
        parameter_names=names,
        noise_sd=level.sd * span,
        log_likelihood=_log_likelihood(f.cost, n, level, span),
        residual=-f.residual * span,
        unseen_directions=certify.unseen_in_words(info, names),
        diagnostics=diagnostics,
    )
    return estimate if answers.priors.heading_rad is None else _anchored(estimate, answers.priors, state.turn)


def _beyond_telling(prob: Problem, state: State) -> bool:
    """Whether the field is so old that only its age's prior still bounds it."""
    return prob.age_prior is not None and state.log_age > np.log(prob.age_prior[0])


def _log_likelihood(cost: float, n: int, level: Noise, span: float) -> float:
    """ln p(readings | answer), priors' rows included, at the noise variance the errors are weighed with."""
    variance = level.variance
    return float(-0.5 * cost / variance - 0.5 * n * np.log(2.0 * np.pi * variance) - n * np.log(span))


def _fitted(flight: Flight, medium: Medium, prob: Problem, state: State, span: float) -> tuple[Medium, float]:
    """The medium with what was estimated filled in, and the common activation time (NaN where it cannot be known)."""
    first = float(flight.legs[0].time_s[0])
    spread2 = float(np.exp(state.log_spread2))
    mu, tau = medium.diffusivity_m2_s, medium.activation_s
    known_tau = tau if isinstance(tau, (int, float)) else None
    if prob.evolution == "fixed":
        known = known_tau if known_tau is not None else (first - spread2 / (4.0 * mu) if mu else None)
        fitted = replace(medium, ambient=state.ambient * span, activation_s=known)
        return fitted, float("nan") if known is None else float(known)
    age: float | None
    if not prob.static and prob.evolution in ("age", "both"):
        age = float(np.exp(state.log_age))
    elif known_tau is not None:
        age = first - known_tau
    else:
        age = spread2 / (4.0 * mu) if mu else None
    activation = float("nan") if age is None else first - age
    fitted = Medium(
        diffusivity_m2_s=spread2 / (4.0 * age) if age else None,
        activation_s=activation if age else None,
        spread_m=float(np.sqrt(spread2)) if medium.static else None,
        ambient=state.ambient * span,
        static=medium.static,
        dimensions=medium.dimensions,
    )
    return fitted, activation


def _anchored(result: Estimate, priors: Priors, turn: float) -> Estimate:
    """The answer turned (and mirrored, where the first turn is clockwise) into the frame of the known headings.

    What is not known of the turn itself adds to the positions' covariance.
    """
    assert priors.heading_rad is not None
    side = priors.side
    first = float(priors.heading_rad[0]) + side * turn
    cos, sin = np.cos(first), np.sin(first)
    rotation = np.array([[cos, -side * sin], [sin, side * cos]])
    n_legs = result.path.heading_rad.size
    covariance = bound.turned_blocks(result.parameter_covariance, n_legs, result.sources.position_m)
    return replace(
        result,
        sources=replace(result.sources, position_m=result.sources.position_m @ rotation.T),
        path=Path(result.path.vertices_m @ rotation.T, first + side * result.path.heading_rad),
        position_covariance_m2=rotation @ covariance @ rotation.T,
        path_aligned_covariance_m2=rotation @ result.path_aligned_covariance_m2 @ rotation.T,
        gauge="anchored",
    )
