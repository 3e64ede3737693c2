"""From the fit's own frame to the public one: the canonical gauge, or the frame of known headings or points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.bound import source_columns
from dslam_mav.dslam.path import corners
from dslam_mav.dslam.priors import BESIDE_MATTERS
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import Layout, State
from dslam_mav.records import Flight

Array = NDArray[np.float64]

DIFFERENCE_RAD = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """An answer as the public sees it: path (V, d), sources (K, d), the rotation (d, d) that brought them there, and
    what every unknown does to the sources' places (K, d, P).
    """

    vertices: Array
    sources: Array
    rotation: Array
    source_columns: Array


def in_order(prob: Problem, state: State) -> State:
    """The state with its sources by amplitude and, in the canonical gauge, its first turns towards +y and +z."""
    order = np.argsort(-state.log_amplitude, kind="stable")
    state = replace(
        state,
        s=state.s[order],
        log_amplitude=state.log_amplitude[order],
        log_spread2=state.log_spread2[order],
        theta=(state.theta + np.pi) % (2.0 * np.pi) - np.pi,
    )
    if prob.known.heading is not None or prob.known.points is not None:
        return state  # the frame tells left from right
    path = corners(prob, state)
    if not np.isfinite(path).all():
        return state
    alignment = to_canonical(path)
    if prob.basis is not None:
        turned = alignment.rotation.T
        return replace(state, s=state.s @ turned, coefficients=state.coefficients @ turned)
    if prob.dimensions == 3 and prob.rise is None:
        signs = np.sign(np.diag(alignment.rotation))
        return replace(
            state, theta=state.theta * signs[1], climb=state.climb * signs[2], s=state.s * signs, gap=state.gap * signs
        )
    sides = np.ones(prob.dimensions)
    sides[1] = 1.0 if alignment.rotation[1, 1] >= 0.0 or prob.dimensions == 3 else -1.0
    return replace(state, theta=state.theta * sides[1], s=state.s * sides, gap=state.gap * sides)


def frame_covariance(flight: Flight, places_m: Array, loose: float) -> Array:
    """(K, d, d) what places (K, d) in the canonical gauge owe to a first leg that readings do not know as the gauge has
    it: flown on a line beside its two ends, which is all they know of it; and where legs begin beside the corners by
    `loose` times what is usual (`solve.Task`), begun off its start, and measured too long or too short, by as much.
    """
    covariance = np.zeros((*places_m.shape, places_m.shape[1]))
    if not flight.legs:
        return covariance
    leg, ways = flight.legs[0], []
    x, y = places_m[:, 0] / leg.length_m, places_m[:, 1] / leg.length_m
    if leg.beside_m > BESIDE_MATTERS * leg.length_m:
        ways += [leg.beside_m * np.stack([y, 1.0 - x], axis=1), leg.beside_m * np.stack([-y, x], axis=1)]
    if drift_m := abs(loose) * leg.corner_sd_m:
        ways += [drift_m * np.stack([np.ones_like(x), np.zeros_like(y)], axis=1), drift_m * np.stack([x, y], axis=1)]
    for off in ways:
        covariance[:, :2, :2] += off[:, :, None] * off[:, None, :]
    return covariance


def placed(prob: Problem, state: State, at: Layout) -> Placed:
    """The state's path and sources in the public frame."""
    path, own = corners(prob, state), source_columns(at, len(state.s))
    d = prob.dimensions
    if prob.known.heading is not None or prob.known.points is not None:
        cos, sin = np.cos(state.turn), np.sin(state.turn)
        rotation, spin = np.eye(d), np.zeros((d, d))
        rotation[:2, :2], spin[:2, :2] = [[cos, -sin], [sin, cos]], [[-sin, -cos], [cos, -sin]]
        shift = np.zeros(d) if prob.known.points is None or state.shift is None else state.shift
        columns = np.einsum("ab,kbp->kap", rotation, own)
        columns[:, :, at.turn] += (state.s @ spin.T)[:, :, None]
        columns[:, :, at.shift] += np.eye(d)[:, : at.shift.stop - at.shift.start]
        return Placed(path @ rotation.T + shift, state.s @ rotation.T + shift, rotation, columns)
    if d == 2 or prob.rise is None:
        return Placed(path, state.s, np.eye(d), own)
    rotation = to_canonical(path).rotation  # climbs known: the fit stands upright, the canonical gauge lies on leg 1
    columns = np.einsum("ab,kbp->kap", rotation, own)
    for p in range(at.heading.start, at.heading.stop):
        turned = state.theta.copy()
        turned[p - at.heading.start + 1] += DIFFERENCE_RAD
        after = to_canonical(corners(prob, replace(state, theta=turned))).rotation
        columns[:, :, p] += state.s @ ((after - rotation) / DIFFERENCE_RAD).T
    return Placed(path @ rotation.T, state.s @ rotation.T, rotation, columns)
