"""The joint fit: Levenberg–Marquardt on the joint residual. Under white Gaussian noise its minimum is the
maximum-likelihood estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from dslam_mav.dslam.joint import evaluate, residual_of
from dslam_mav.dslam.problem import Problem, State, medium_names

Array = NDArray[np.float64]

MAX_STEP_HEADING_RAD = 0.3
MAX_STEP_SPREADS = 0.5
MAX_STEP_LOG = 0.5
MAX_ITERATIONS = 100
PROBE = 0.1  # of a step: where the residual's second derivative is taken
MOST_BEND = 0.75  # acceleration over velocity, as in the paper
CONVERGED_GAIN = 1e-5  # in χ²: far below what a reading's noise can tell


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A minimum: the state, its residual (model − measured, readings only), cost, Jacobian (rows of priors last)."""

    state: State
    residual: Array
    cost: float
    jacobian: Array
    converged: bool


def moved(prob: Problem, state: State, step: Array) -> State:
    """The state after a step of the parameter vector, each part's step kept within what the model is linear in."""
    n_head, k_sources = prob.length.size - 1, state.log_amplitude.size
    spread = np.exp(0.5 * state.log_spread2)
    theta = state.theta.copy()
    theta[1:] += np.clip(step[:n_head], -MAX_STEP_HEADING_RAD, MAX_STEP_HEADING_RAD)
    place = np.clip(step[n_head : n_head + 2 * k_sources], -MAX_STEP_SPREADS * spread, MAX_STEP_SPREADS * spread)
    index = n_head + 3 * k_sources
    logs = np.clip(step[n_head + 2 * k_sources : index], -MAX_STEP_LOG, MAX_STEP_LOG)
    log_spread2, log_age, ambient, turn = state.log_spread2, state.log_age, state.ambient, state.turn
    for name in medium_names(prob):
        if name == "ambient":
            ambient += float(step[index])
        else:
            change = float(np.clip(step[index], -MAX_STEP_LOG, MAX_STEP_LOG))
            log_spread2 += change if name == "ln C" else 0.0
            log_age += change if name == "ln age" else 0.0
        index += 1
    if prob.heading_prior is not None:
        turn += float(np.clip(step[index], -MAX_STEP_HEADING_RAD, MAX_STEP_HEADING_RAD))
    if prob.evolution == "age" and prob.diffusivity is not None:
        log_spread2 = float(np.log(4.0 * prob.diffusivity) + log_age)
    return State(theta, state.s + place.reshape(-1, 2), state.log_amplitude + logs, log_spread2, log_age, ambient, turn)


def fit(prob: Problem, start: State, *, iterations: int = MAX_ITERATIONS) -> Fit:
    """Levenberg–Marquardt from `start`, with Marquardt's scaling, to where a step no longer lowers the cost.

    A source that backs away from the path while it grows keeps α − d²/C: the cost's valleys are narrow and bent. Each
    step therefore carries its second-order correction, from one more residual (geodesic acceleration; Transtrum and
    Sethna, "Improvements to the Levenberg-Marquardt algorithm", arXiv:1201.5885).
    """
    state = start
    residual, jacobian = evaluate(prob, state)
    cost = float(residual @ residual)
    damping = 1e-3
    converged = False
    for _ in range(iterations):
        step = _accelerated_step(prob, state, residual, jacobian, damping)
        trial = None if step is None else moved(prob, state, step)
        if trial is not None:
            with np.errstate(over="ignore", invalid="ignore"):
                residual_try, jacobian_try = evaluate(prob, trial)
                cost_try = float(residual_try @ residual_try)
            if np.isfinite(cost_try) and cost_try <= cost:
                gain = cost - cost_try
                state, residual, jacobian, cost = trial, residual_try, jacobian_try, cost_try
                damping = max(damping * 0.2, 1e-12)
                if gain <= CONVERGED_GAIN * cost / prob.y.size:
                    converged = True
                    break
                continue
        damping *= 3.0
        if damping > 1e8:
            converged = True
            break
    return Fit(state, residual[: prob.y.size], cost, jacobian, converged)


def _accelerated_step(prob: Problem, state: State, residual: Array, jacobian: Array, damping: float) -> Array | None:
    """Velocity and half its acceleration; None where the path bends too much for a step of this size."""
    size = np.sqrt((jacobian**2).sum(axis=0))
    size[size == 0.0] = 1.0
    scaled = jacobian / size
    factor = cho_factor(scaled.T @ scaled + damping * np.eye(size.size), check_finite=False)
    velocity = cho_solve(factor, -(scaled.T @ residual), check_finite=False)
    with np.errstate(over="ignore", invalid="ignore"):
        ahead = residual_of(prob, moved(prob, state, PROBE * velocity / size))
        bend = 2.0 / PROBE * ((ahead - residual) / PROBE - scaled @ velocity)
    if not np.isfinite(bend).all():
        return None
    acceleration = cho_solve(factor, -(scaled.T @ bend), check_finite=False)
    if 2.0 * np.linalg.norm(acceleration) > MOST_BEND * np.linalg.norm(velocity):
        return None
    return np.asarray((velocity + 0.5 * acceleration) / size)
