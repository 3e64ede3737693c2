"""Before take-off: how well a mission will see one layout of sources (theory, section 9); over many, `expected`.

The information matrix needs no readings, only the path, the sources and the noise. It is local: it cannot see that a
second answer may fit as well, and is therefore a lower bound of what a flight will give.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dslam_mav.dslam.arguments import check_mission
from dslam_mav.dslam.bound import aligned_columns, blocks, information, source_columns
from dslam_mav.dslam.expected import UNIDENTIFIED_SPREADS
from dslam_mav.dslam.joint import evaluate
from dslam_mav.dslam.path import path_columns
from dslam_mav.dslam.priors import CLOSED_SHARE
from dslam_mav.dslam.problem import Known, Problem, problem
from dslam_mav.dslam.state import State, layout
from dslam_mav.records import Flight, Leg, Medium, Sources, read_only
from dslam_mav.records.arrays import finite

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """The Cramér–Rao bound of a flight: `position_covariance_m2` (K, 2, 2) relative to the first leg, `aligned_…` to
    the whole path, `heading_sd_rad` (L,), and whether every source's place is bounded to two spreads.
    """

    position_covariance_m2: Array
    aligned_covariance_m2: Array
    heading_sd_rad: Array
    vertex_sd_m: Array
    identifiable: bool


def bound(
    vertices_m: ArrayLike,
    sources: Sources,
    medium: Medium,
    *,
    readings_per_leg: int,
    speed_m_s: float,
    noise_sd: float,
    heading_sd_rad: float | None = None,
    length_sd_m: float = 0.0,
    closed: bool = False,
) -> Bound:
    """The best any estimator can do on the path `vertices_m` (L+1, 2) over `sources`, in the path's own frame.

    What is None in `medium` counts as unknown; its true value is taken from the sources' peak readings. ValueError
    names an argument that cannot be.
    """
    numbers = {"readings_per_leg": readings_per_leg, "speed_m_s": speed_m_s, "noise_sd": noise_sd}
    check_mission(sources, medium, numbers if heading_sd_rad is None else {**numbers, "heading_sd_rad": heading_sd_rad})
    if not isinstance(readings_per_leg, (int, np.integer)):
        raise ValueError(f"readings_per_leg: expected a whole number, got {readings_per_leg}")
    d, path = medium.dimensions, read_only(vertices_m, "vertices_m", (None, None))
    finite(path, "vertices_m")
    if path.shape[1] != d or len(path) < 2:
        raise ValueError(f"vertices_m: expected shape (2 or more, {d}), got {path.shape}")
    prob = replace(
        _unread(np.diff(path, axis=0), medium, readings_per_leg, speed_m_s),
        known=_known(path, noise_sd, heading_sd_rad, length_sd_m, closed),
    )
    return _bound(prob, _truth(prob, path, sources, medium), noise_sd)


def _known(path: Array, noise_sd: float, heading_sd_rad: float | None, length_sd_m: float, closed: bool) -> Known:
    step = np.diff(path, axis=0)
    theta = np.arctan2(step[:, 1], step[:, 0])
    length = float(np.linalg.norm(step, axis=1).sum())
    return Known(
        heading=None if heading_sd_rad is None else (theta, heading_sd_rad / noise_sd),
        closed_sd=CLOSED_SHARE * length / noise_sd if closed else None,
        length_sd=np.full(len(step), length_sd_m / noise_sd) if length_sd_m > 0.0 else None,
    )


def _truth(prob: Problem, path: Array, sources: Sources, medium: Medium) -> State:
    """The state of the scene, what is unknown of it at its true value."""
    step = np.diff(path, axis=0)
    d = path.shape[1]
    spread2 = sources.squared_spread_m2
    if prob.spread2 is not None:
        spread2 = np.broadcast_to(prob.spread2, spread2.shape)
    state = State.flat(
        prob,
        np.arctan2(step[:, 1], step[:, 0]),
        sources.position_m - path[0],
        np.log(sources.amplitude),
        np.log(spread2),
    )
    if prob.rate is None:
        state = replace(state, log_rate=float(np.log(spread2[0] / _age(prob, sources))))
    if d == 3:
        state = replace(state, climb=np.arcsin(step[:, 2] / prob.length))
    lag = medium.sensor_lag_s
    return replace(state, log_lag=float(np.log(lag)) if lag else -np.inf)


def _unread(step: Array, medium: Medium, readings: int, speed_m_s: float) -> Problem:
    """The problem of a flight whose readings are still to come."""
    legs, start_s = [], 0.0
    for length, own in zip(np.linalg.norm(step, axis=1), step, strict=True):
        s = float(length) * np.arange(readings) / readings
        rise = float(own[2]) if own.size == 3 else None
        legs.append(Leg(float(length), s, start_s + s / speed_m_s, np.zeros(readings), rise_m=rise))
        start_s += float(length) / speed_m_s
    return problem(Flight(tuple(legs)), medium)


def _age(prob: Problem, sources: Sources) -> float:
    if prob.age is not None:
        return float(prob.age[0])
    activation = float(sources.activation_s[0])
    return -activation if np.isfinite(activation) and activation < 0.0 else 1.0


def _bound(prob: Problem, state: State, noise_sd: float) -> Bound:
    k_sources, n_legs = len(state.s), prob.n_legs
    at = layout(prob, k_sources)
    covariance = information(evaluate(prob, state, at)[1], noise_sd**2).covariance
    own = blocks(source_columns(at, k_sources), covariance)
    vertex = np.trace(blocks(path_columns(prob, state, at), covariance), axis1=1, axis2=2)
    heading = np.sqrt(np.maximum(np.diag(covariance)[at.heading], 0.0))
    worst = float(np.sqrt(np.linalg.eigvalsh(own).max()))
    return Bound(
        position_covariance_m2=own,
        aligned_covariance_m2=blocks(aligned_columns(prob, state, at), covariance),
        heading_sd_rad=np.concatenate([[0.0], heading])[:n_legs],
        vertex_sd_m=np.sqrt(np.maximum(vertex, 0.0)),
        identifiable=worst < UNIDENTIFIED_SPREADS * state.spread,
    )
