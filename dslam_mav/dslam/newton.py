"""Newton's steps where Levenberg and Marquardt's crawl.

Their matrix JᵀJ leaves out what the residual's own second derivatives add to the cost's, Σ r ∂²r. Where a leg hardly
sees anything that part is as large as the rest, and a fit would need hundreds of iterations. The gradient Jᵀr is
exact, and its differences are the whole Hessian.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.joint import evaluate, residual_of
from dslam_mav.dslam.plain import compiled, plain
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import Layout, State, layout, moved

Array = NDArray[np.float64]

ITERATIONS = 30
DIFFERENCE = 1e-5  # of what changes the readings as much as they vary: across it the gradient's differences are taken …
LONGEST = 1e-2  # … radians, lengths or logarithms, where hardly anything changes them
FAINTEST = 1e-9  # of the most telling unknown's column: fainter ones count as so large
FLATTEST = 1e-6  # of the steepest curvature
FIRST_DAMPING = 1e-6
MOST_DAMPING = 1e4


def _hessian(prob: Problem, state: State, at: Layout, gradient: Array, size: Array) -> Array:
    """(P, P) second derivatives of half the cost, every parameter counted in units of 1/size."""
    columns = []
    at_once = compiled(prob, state) if plain(prob) else None
    difference = DIFFERENCE * float(np.linalg.norm(prob.y - prob.y.mean()))
    for p in range(at.size):
        step = np.zeros(at.size)
        step[p] = min(difference / size[p], LONGEST)
        if at_once is not None:
            ahead = _gradient(*at_once.evaluate(at_once.start + step))
        else:
            ahead = _gradient(*evaluate(prob, moved(prob, state, step, at), at))
        columns.append((ahead - gradient) / (step[p] * size[p] * size))
    rows = np.array(columns)
    return np.asarray(0.5 * (rows + rows.T))


def newton(prob: Problem, state: State, gain: float) -> tuple[State, bool]:
    """The minimum that `state` lies near, and whether steps came to gain less than `gain` of the cost."""
    at = layout(prob, len(state.s))
    residual, jacobian = evaluate(prob, state, at)
    off = residual
    cost, damping = float(residual @ residual), FIRST_DAMPING
    for _ in range(ITERATIONS):
        size = np.linalg.norm(jacobian, axis=0)
        size = np.maximum(size, FAINTEST * size.max()) if size.any() else np.ones(at.size)
        gradient = _gradient(residual, jacobian)
        slope = gradient / size
        bend = _hessian(prob, state, at, gradient, size)
        if not np.isfinite(bend).all():
            return state, False
        try:
            values, vectors = np.linalg.eigh(bend)
        except np.linalg.LinAlgError:
            return state, False
        least = FLATTEST * np.abs(values).max()
        while damping < MOST_DAMPING:
            curvature = np.maximum(np.abs(values), least) + damping
            step = -(vectors @ ((vectors.T @ slope) / curvature)) / size
            trial = moved(prob, state, step, at)
            off = residual_of(prob, trial, at)
            if float(off @ off) <= cost:
                break
            damping = max(10.0 * damping, FIRST_DAMPING)
        else:
            return state, bool(np.isfinite(off).all())
        state, before = trial, cost
        damping *= 0.1
        residual, jacobian = evaluate(prob, state, at)
        cost = float(residual @ residual)
        if before - cost <= gain:
            return state, True
    return state, False


def _gradient(residual: Array, jacobian: Array) -> Array:
    return jacobian.T @ residual
