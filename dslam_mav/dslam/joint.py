"""One residual and one analytic Jacobian over all readings of a flight (theory, section 8).

Every case is this one: straight legs or a parametric path, in the plane or in space, sources of one age or each of
its own, a field that stands still or evolves, an unknown ambient level, a slow sensor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.kernels.model import add_columns, add_field, add_turns, lagged
from dslam_mav.dslam.path import climb_of, directions, places, turns
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.rows import prior_rows
from dslam_mav.dslam.state import Layout, State, any_in, layout, loose_corners, uncertain_legs

Array = NDArray[np.float64]


def model_of(prob: Problem, state: State) -> Array:
    """(n,) what every reading, or number that stands for readings, would be."""
    out = np.zeros(prob.s.size)
    spread2, rate = np.exp(state.log_spread2), float(np.exp(state.log_rate))
    add_field(places(prob, state), prob.t, state.s, state.log_amplitude, spread2, rate, state.extent, out)
    lag = float(np.exp(state.log_lag))
    if lag > 0.0:
        lagged(out[:, None], prob.t, lag)
    return mixed(prob, out + state.ambient + state.drift * prob.t)


def residual_of(prob: Problem, state: State, at: Layout | None = None) -> Array:
    """Residual (n + rows,): model − measured, then the priors' rows."""
    at = at or layout(prob, len(state.s))
    return np.concatenate([model_of(prob, state) - prob.y, prior_rows(prob, state, at)[0]])


def evaluate(prob: Problem, state: State, at: Layout | None = None) -> tuple[Array, Array]:
    """Residual (n + rows,) and Jacobian (n + rows, P)."""
    at = at or layout(prob, len(state.s))
    x = places(prob, state)
    n, d = x.shape
    out = np.zeros((n, at.size + 1))
    columns, by_place, model = out[:, :-1], np.zeros((n, d)), np.zeros(n)
    spread2, rate = np.exp(state.log_spread2), float(np.exp(state.log_rate))
    first = (at.place.start, at.amplitude.start, at.medium.start, at.extent.start if any_in(at.extent) else -1)
    add_columns(
        x, prob.t, state.s, state.log_amplitude, spread2, rate, state.extent, at.map, first, model, columns, by_place
    )
    out[:, -1] = model
    _path_columns(prob, state, at, by_place, columns)
    lag = float(np.exp(state.log_lag))
    if lag > 0.0:
        by_lag = lagged(out, prob.t, lag)
        columns[:, at.lag] = by_lag[:, -1:]
    columns[:, at.ambient] = 1.0
    columns[:, at.drift] = prob.t[:, None]
    out[:, -1] += state.ambient + state.drift * prob.t
    out = mixed(prob, out)
    off, rows = prior_rows(prob, state, at)
    return np.concatenate([out[:, -1] - prob.y, off]), np.vstack([out[:, :-1], rows])


def _path_columns(prob: Problem, state: State, at: Layout, by_place: Array, columns: Array) -> None:
    """What the unknowns of the path do, from what a shift of every reading's place does."""
    if prob.basis is not None:
        moves = prob.basis[:, :, None] * by_place[:, None, :]
        columns[:, at.coefficient] = moves.reshape(len(by_place), -1)
        return
    turn, which = turns(prob, state)
    add_turns(by_place, prob.leg, prob.s, prob.length + state.longer, turn, which, columns)
    if any_in(at.longer):
        along = directions(state.theta, climb_of(prob, state))
        longer = uncertain_legs(prob)
        columns[:, at.longer] = np.where(prob.leg[:, None] > longer[None, :], by_place @ along[longer].T, 0.0)
    if any_in(at.gap):
        later = prob.leg[:, None] > loose_corners(prob)[None, :]
        columns[:, at.gap] = np.where(later[:, :, None], by_place[:, None, :], 0.0).reshape(len(by_place), -1)


def mixed(prob: Problem, values: Array) -> Array:
    """Values at the places of the model, as the numbers that stand for the readings see them."""
    if prob.mix is None:
        return values
    parts, begin = [], 0
    for mix in prob.mix:
        parts.append(mix @ values[begin : begin + mix.shape[1]])
        begin += mix.shape[1]
    return np.concatenate(parts)
