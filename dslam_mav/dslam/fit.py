"""The joint fit: Levenberg–Marquardt on the joint residual. Under white Gaussian noise its minimum is the
maximum-likelihood estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotrs

from dslam_mav.dslam.joint import evaluate, model_of, residual_of
from dslam_mav.dslam.kernels.plain_fit import Damping, plain_fit
from dslam_mav.dslam.newton import newton
from dslam_mav.dslam.plain import compiled, plain
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import (
    MAX_STEP_LOG,
    MAX_STEP_RAD,
    MAX_STEP_SPREADS,
    Layout,
    State,
    layout,
    moved,
)

Array = NDArray[np.float64]

MAX_ITERATIONS = 50  # then Newton's steps
FIRST_DAMPING = 1e-3
LEAST_DAMPING = 1e-12
MOST_DAMPING = 1e8
PROBE = 0.1  # of a step: where the residual's second derivative is taken
MOST_BEND = 0.75  # acceleration over velocity, as in the paper
CONVERGED_GAIN = 1e-5  # in χ²: far below what a reading's noise can tell
DAMPING = Damping(
    FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING, PROBE, MOST_BEND, CONVERGED_GAIN,
    MAX_STEP_RAD, MAX_STEP_SPREADS, MAX_STEP_LOG,
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A minimum: the state, its residual (model − measured, readings only), and cost."""

    state: State
    residual: Array
    cost: float
    converged: bool


def fit(prob: Problem, start: State, *, iterations: int = MAX_ITERATIONS) -> Fit:
    """Levenberg–Marquardt from `start`, with Marquardt's scaling, to where a step no longer lowers the cost.

    A source that backs away from the path while it grows keeps α − d²/C: the cost's valleys are narrow and bent. Each
    step therefore carries its second-order correction, from one more residual (geodesic acceleration; Transtrum and
    Sethna, "Improvements to the Levenberg-Marquardt algorithm", arXiv:1201.5885).
    """
    with np.errstate(over="ignore", invalid="ignore"):  # worker threads do not inherit the caller's
        return _compiled(prob, start, iterations) if plain(prob) else _general(prob, start, iterations)


def settled(prob: Problem, f: Fit) -> Fit:
    """Where a fit crawls on, Newton's steps from there."""
    if f.converged or not np.isfinite(f.cost):
        return f
    with np.errstate(over="ignore", invalid="ignore"):
        state, converged = newton(prob, f.state, CONVERGED_GAIN * (f.cost + prob.outside) / prob.n_readings)
        residual = residual_of(prob, state)
    return Fit(state, residual[: prob.y.size], float(residual @ residual), converged)


def _general(prob: Problem, start: State, iterations: int) -> Fit:
    """For every unknown and prior there is."""
    at = layout(prob, len(start.s))
    state = start
    residual, jacobian = evaluate(prob, state, at)
    cost = float(residual @ residual)
    damping = FIRST_DAMPING
    converged = False
    for _ in range(iterations):
        step = _accelerated_step(prob, state, at, (residual, jacobian), damping)
        if step is not None:
            trial = moved(prob, state, step, at)
            residual_try, jacobian_try = evaluate(prob, trial, at)
            cost_try = float(residual_try @ residual_try)
            if cost_try <= cost:
                gain = cost - cost_try
                state, residual, jacobian, cost = trial, residual_try, jacobian_try, cost_try
                damping = max(damping * 0.2, LEAST_DAMPING)
                if gain <= CONVERGED_GAIN * (cost + prob.outside) / prob.n_readings:
                    converged = True
                    break
                continue
        damping *= 3.0
        if damping > MOST_DAMPING:
            converged = True
            break
    return Fit(state, residual[: prob.y.size], cost, converged)


def _accelerated_step(
    prob: Problem, state: State, at: Layout, here: tuple[Array, Array], damping: float
) -> Array | None:
    """Velocity and half its acceleration; None where the path bends too much for a step of this size."""
    residual, jacobian = here
    factor, size = factored(jacobian, damping)
    if factor is None:
        return None
    velocity = dpotrs(factor, -(jacobian.T @ residual) / size)[0]
    ahead = residual_of(prob, moved(prob, state, PROBE * velocity / size, at), at)
    bend = 2.0 / PROBE * ((ahead - residual) / PROBE - jacobian @ (velocity / size))
    if not np.isfinite(bend).all():
        return None
    acceleration = dpotrs(factor, -(jacobian.T @ bend) / size)[0]
    if 2.0 * np.linalg.norm(acceleration) > MOST_BEND * np.linalg.norm(velocity):
        return None
    return np.asarray((velocity + 0.5 * acceleration) / size)


def factored(jacobian: Array, damping: float) -> tuple[Array | None, Array]:
    """LAPACK's Cholesky factor of JᵀJ + λ, scaled to a unit diagonal (None: not positive), and the columns' lengths."""
    normal = jacobian.T @ jacobian
    size = np.sqrt(np.diag(normal))
    size[size == 0.0] = 1.0
    normal /= np.outer(size, size)
    normal.flat[:: size.size + 1] += damping
    factor, info = dpotrf(normal)
    return (factor if info == 0 else None), size


def _compiled(prob: Problem, start: State, iterations: int) -> Fit:
    at_start = compiled(prob, start)
    flown, base, x = at_start.flown, at_start.base, at_start.start
    cost, converged = plain_fit(flown, DAMPING, base, x, iterations)
    n_turns, k_sources, n_medium = start.theta.size - 1, len(start.s), flown.medium.shape[1]
    theta, s, log_amplitude, by_medium, level = np.split(x, np.cumsum([n_turns, 2 * k_sources, k_sources, n_medium]))
    logs = base + np.where(flown.medium != 0.0, flown.medium * by_medium, 0.0).sum(axis=1)
    state = replace(
        start, theta=np.append(0.0, theta), s=s.reshape(-1, 2), log_amplitude=log_amplitude,
        log_spread2=logs[:-1], log_rate=float(logs[-1]),
        ambient=float(level[0]) if flown.ambient_free else start.ambient,
    )  # fmt: skip
    return Fit(state, model_of(prob, state) - prob.y, cost, converged)
