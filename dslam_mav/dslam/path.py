"""Where the readings were taken: straight legs from directions (2), or r = Σ_i c_i φ_i (IV-C)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.kernels.model import on_legs
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import Layout, State, climbs_unknown, loose_corners, uncertain_legs

Array = NDArray[np.float64]


def directions(theta: Array, climb: Array | None = None) -> Array:
    """(L, 2) unit vectors of headings, or (L, 3) of headings and climbs, both in radians."""
    flat = np.empty((theta.size, 2))
    flat[:, 0], flat[:, 1] = np.cos(theta), np.sin(theta)
    if climb is None:
        return flat
    return np.hstack([np.cos(climb)[:, None] * flat, np.sin(climb)[:, None]])


def vertices(theta: Array, length: Array, climb: Array | None = None, gap: Array | None = None) -> Array:
    """Path (L+1, d) from headings, lengths and climbs, from the origin (2), each leg a `gap` (L, d) beyond the last."""
    steps = length[:, None] * directions(theta, climb)
    if gap is not None:
        steps = steps + gap
    return np.vstack([np.zeros(steps.shape[1]), np.cumsum(steps, axis=0)])


def climb_of(prob: Problem, state: State) -> Array | None:
    """(L,) climbs in radians; None in two dimensions."""
    return state.climb if prob.dimensions == 3 else None


def climb_of_rise(prob: Problem) -> Array:
    """(L,) climbs in radians from the heights gained, 0 where they are not known."""
    if prob.rise is None:
        return np.zeros(prob.n_legs)
    return np.asarray(np.arcsin(np.clip(prob.rise / prob.length, -1.0, 1.0)))


def corners(prob: Problem, state: State) -> Array:
    """(L+1, d) vertices of the state's path; of a parametric path the places of its readings (n, d)."""
    if prob.basis is not None:
        return prob.basis @ state.coefficients
    return vertices(state.theta, prob.length + state.longer, climb_of(prob, state), state.gap)


def places(prob: Problem, state: State) -> Array:
    """(n, d) where every reading was taken."""
    if prob.basis is not None:
        return prob.basis @ state.coefficients
    return np.asarray(on_legs(corners(prob, state), directions(state.theta, climb_of(prob, state)), prob.leg, prob.s))


def turns(prob: Problem, state: State) -> tuple[Array, NDArray[np.int64]]:
    """What each unknown heading, then climb, does to its leg's direction (p, d), and which leg that is (p,)."""
    theta, legs = state.theta, np.arange(prob.n_legs)
    sideways = np.stack([-np.sin(theta), np.cos(theta)], axis=1)
    if prob.dimensions == 2:
        return sideways[1:], legs[1:]
    cos, sin = np.cos(state.climb)[:, None], np.sin(state.climb)[:, None]
    by_heading = np.hstack([cos * sideways, np.zeros_like(cos)])
    if not climbs_unknown(prob):
        return by_heading[1:], legs[1:]
    flat = np.stack([np.cos(theta), np.sin(theta)], axis=1)
    by_climb = np.hstack([-sin * flat, cos])
    return np.vstack([by_heading[1:], by_climb[2:]]), np.concatenate([legs[1:], legs[2:]])


def path_columns(prob: Problem, state: State, at: Layout) -> Array:
    """(V, d, P): what every unknown does to the path's vertices, or a parametric path's places."""
    d = prob.dimensions
    if prob.basis is not None:
        columns = np.zeros((len(prob.basis), d, at.size))
        by_term = prob.basis[:, None, :, None] * np.eye(d)[None, :, None, :]
        columns[:, :, at.coefficient] = by_term.reshape(len(prob.basis), d, -1)
        return columns
    columns = np.zeros((prob.n_legs + 1, d, at.size))
    turn, which = turns(prob, state)
    vertex = np.arange(prob.n_legs + 1)[:, None, None]
    levers = ((prob.length + state.longer)[which, None] * turn).T
    columns[:, :, : which.size] = np.where(vertex > which, levers, 0.0)
    longer = uncertain_legs(prob)
    along = directions(state.theta, climb_of(prob, state))[longer].T
    columns[:, :, at.longer] = np.where(vertex > longer, along, 0.0)
    shifted = (vertex > loose_corners(prob))[..., None] * np.eye(d)[None, :, None, :]
    columns[:, :, at.gap] = shifted.reshape(prob.n_legs + 1, d, -1)
    return columns
