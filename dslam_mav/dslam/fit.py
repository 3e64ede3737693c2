"""The joint fit: Levenberg–Marquardt on the joint residual. Under white Gaussian noise its minimum is the
maximum-likelihood estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotrs

from dslam_mav.dslam.joint import evaluate, residual_of
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import Layout, State, layout, moved

Array = NDArray[np.float64]

MAX_ITERATIONS = 100
FIRST_DAMPING = 1e-3
LEAST_DAMPING = 1e-12
MOST_DAMPING = 1e8
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


def fit(prob: Problem, start: State, *, iterations: int = MAX_ITERATIONS) -> Fit:
    """Levenberg–Marquardt from `start`, with Marquardt's scaling, to where a step no longer lowers the cost.

    A source that backs away from the path while it grows keeps α − d²/C: the cost's valleys are narrow and bent. Each
    step therefore carries its second-order correction, from one more residual (geodesic acceleration; Transtrum and
    Sethna, "Improvements to the Levenberg-Marquardt algorithm", arXiv:1201.5885).
    """
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
    return Fit(state, residual[: prob.y.size], cost, jacobian, converged)


def _accelerated_step(
    prob: Problem, state: State, at: Layout, here: tuple[Array, Array], damping: float
) -> Array | None:
    """Velocity and half its acceleration; None where the path bends too much for a step of this size."""
    residual, jacobian = here
    normal = jacobian.T @ jacobian
    size = np.sqrt(np.diag(normal))
    size[size == 0.0] = 1.0
    normal /= np.outer(size, size)
    normal.flat[:: size.size + 1] += damping
    factor, info = dpotrf(normal)
    if info != 0:
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
