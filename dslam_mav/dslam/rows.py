"""Priors and constraints as residual rows of the joint fit, in units of a reading's noise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.path import corners, path_columns
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import Layout, State, any_in, loose_corners, uncertain_legs

Array = NDArray[np.float64]
Rows = tuple[Array, Array]  # (r,) standard deviations off, (r, P) derivatives

GAUGE_SD = 1e-3  # of the unit of length: what holds a parametric path's shift and turn


def prior_rows(prob: Problem, state: State, at: Layout) -> Rows:
    """(rows,) how far the state is from what is known, in standard deviations, and (rows, P) the derivatives."""
    parts = [*_on_sources(prob, state, at), *_on_path(prob, state, at), *_on_gauge(prob, state, at)]
    if not parts:
        return np.empty(0), np.empty((0, at.size))
    return np.concatenate([off for off, _ in parts]), np.vstack([columns for _, columns in parts])


def _on_sources(prob: Problem, state: State, at: Layout) -> Iterator[Rows]:
    known, k_sources = prob.known, len(state.s)
    if known.peak is not None:
        peak, sd = known.peak
        half = 0.5 * prob.dimensions
        excess = state.log_amplitude - np.log(peak) - half * (np.log(np.pi) + state.log_spread2)
        beyond = (excess > 0.0) / sd
        columns = np.zeros((k_sources, at.size))
        columns[:, at.amplitude] = np.diag(beyond)
        columns[:, at.medium] = -half * beyond[:, None] * at.map[:k_sources]
        yield excess * beyond, columns
    if known.age is not None:
        oldest, sd = known.age
        older = state.log_spread2 - state.log_rate - np.log(oldest)
        beyond = (older > 0.0) / sd
        columns = np.zeros((k_sources, at.size))
        columns[:, at.medium] = beyond[:, None] * (at.map[:k_sources] - at.map[k_sources])
        yield older * beyond, columns
    if known.lag is not None and any_in(at.lag):
        yield _single(state.log_lag - known.lag[0], known.lag[1], at.lag, at)
    if known.ambient is not None and any_in(at.ambient):
        yield _single(state.ambient - known.ambient[0], known.ambient[1], at.ambient, at)
    if known.extent_sd is not None and any_in(at.extent):
        yield _single(state.extent, known.extent_sd, at.extent, at)


def _on_path(prob: Problem, state: State, at: Layout) -> Iterator[Rows]:
    known, n_legs = prob.known, prob.n_legs
    if any_in(at.longer) and known.length_sd is not None:
        legs = uncertain_legs(prob)
        columns = np.zeros((legs.size, at.size))
        columns[:, at.longer] = np.diag(1.0 / known.length_sd[legs])
        yield state.longer[legs] / known.length_sd[legs], columns
    if any_in(at.gap) and known.corner_sd is not None:
        loose = loose_corners(prob)
        sds = np.repeat(known.corner_sd[loose], prob.dimensions)
        columns = np.zeros((sds.size, at.size))
        columns[:, at.gap] = np.diag(1.0 / sds)
        gap = state.gap[loose].copy()
        if known.beside is not None:  # the leg before leads there, whichever way it turned
            turn = state.theta[loose + 1] - state.theta[loose]
            beside = np.sign(np.sin(turn)) * known.beside[loose]
            cos, sin = np.cos(state.theta[loose + 1]), np.sin(state.theta[loose + 1])
            gap[:, :2] -= beside[:, None] * np.stack([-sin, cos], axis=1)
            by_heading = beside[:, None] * np.stack([cos, sin], axis=1)
            for i, j in enumerate(loose):
                columns[prob.dimensions * i : prob.dimensions * i + 2, at.heading.start + j] = by_heading[i]
            columns[:, at.heading] /= sds[:, None]
        yield gap.ravel() / sds, columns
    if known.heading is not None:
        heading, sd = known.heading
        turned = state.theta + state.turn - heading
        columns = np.zeros((n_legs, at.size))
        columns[1:, at.heading] = np.eye(n_legs - 1)
        columns[:, at.turn] = 1.0
        yield ((turned + np.pi) % (2.0 * np.pi) - np.pi) / sd, columns / sd
    if known.closed_sd is not None:
        path, by_path = corners(prob, state), path_columns(prob, state, at)
        yield (path[-1] - path[0]) / known.closed_sd, (by_path[-1] - by_path[0]) / known.closed_sd
    if known.points is not None and state.shift is not None:
        index, points, sd = known.points
        d = prob.dimensions
        rotation, spin = np.eye(d), np.zeros((d, d))
        cos, sin = np.cos(state.turn), np.sin(state.turn)
        rotation[:2, :2], spin[:2, :2] = [[cos, -sin], [sin, cos]], [[-sin, -cos], [cos, -sin]]
        path, by_path = corners(prob, state)[index], path_columns(prob, state, at)[index]
        columns = np.einsum("ab,vbp->vap", rotation, by_path)
        columns[:, :, at.turn] = (path @ spin.T)[:, :, None]
        columns[:, :, at.shift] = np.eye(d)
        yield (path @ rotation.T + state.shift - points).ravel() / sd, columns.reshape(-1, at.size) / sd


def _on_gauge(prob: Problem, state: State, at: Layout) -> Iterator[Rows]:
    """A parametric path's first chord lies along +x; where the basis spans a constant it begins at the origin."""
    if prob.basis is None:
        return
    d, terms = prob.dimensions, prob.basis.shape[1]
    chord = prob.basis[1] - prob.basis[0]
    for axis in range(1, d):
        columns = np.zeros((1, terms, d))
        columns[0, :, axis] = chord / np.linalg.norm(chord)
        yield _of_coefficients(columns, state, at)
    if d == 3:  # and its first bend in the plane z = 0
        columns = np.zeros((1, terms, d))
        columns[0, :, 2] = prob.basis[len(prob.basis) // 2] - prob.basis[0]
        yield _of_coefficients(columns, state, at)
    if spans_constant(prob.basis):
        yield _of_coefficients(np.einsum("i,ab->aib", prob.basis[0], np.eye(d)), state, at)


def spans_constant(basis: Array) -> bool:
    """Whether some combination of the basis functions (N, P) is constant, so that the path may be shifted."""
    ones = np.ones(len(basis))
    weights = np.linalg.lstsq(basis, ones, rcond=None)[0]
    return bool(np.abs(basis @ weights - ones).max() < 1e-9)


def _of_coefficients(weights: Array, state: State, at: Layout) -> Rows:
    flat = weights.reshape(len(weights), -1) / GAUGE_SD
    columns = np.zeros((len(weights), at.size))
    columns[:, at.coefficient] = flat
    return flat @ state.coefficients.ravel(), columns


def _single(value: float, sd: float, where: slice, at: Layout) -> Rows:
    columns = np.zeros((1, at.size))
    columns[0, where] = 1.0 / sd
    return np.array([value / sd]), columns
