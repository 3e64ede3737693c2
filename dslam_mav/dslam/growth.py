"""After a flight: how its information grew leg by leg (theory, section 9).

Readings are independent, so the information of the first n legs is the sum of theirs. It is taken at the layout the
whole flight found: what those legs could have told at best of the very sources that turned out to be there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.bound import source_columns
from dslam_mav.dslam.expected import QUIET, vertex_columns
from dslam_mav.dslam.gauge import frame_covariance
from dslam_mav.dslam.joint import evaluate
from dslam_mav.dslam.kernels.expected import Unknown
from dslam_mav.dslam.path import path_columns
from dslam_mav.dslam.priors import LEAST_SD, constrained, priors_of
from dslam_mav.dslam.problem import Problem, problem
from dslam_mav.dslam.scoring import has_positions
from dslam_mav.dslam.state import State, layout, loose_corners
from dslam_mav.dslam.units import Units, normalised, units_of
from dslam_mav.records import Estimate, Flight, Medium

Array = NDArray[np.float64]

UNSEEN = 1e-12  # of a scaled information matrix' largest eigenvalue: no information
UNSEEN_SD = 1e9


@dataclass(frozen=True, slots=True, eq=False)
class Growth:
    """Standard deviations an axis, √(trace/d), after legs 1 … L by the bound: of each source (L, K), and RMS over the
    vertices reached (L,). Infinite where a place is not bounded.
    """

    source_sd_m: Array
    path_sd_m: Array


def growth(flight: Flight, estimate: Estimate, medium: Medium, heading_sd_rad: float | None = None) -> Growth | None:
    """Of a flight in straight legs and its answer; None without positions, or where numbers fail. `medium`: as assumed,
    None is unknown.
    """
    if not (flight.legs and has_positions(estimate) and len(flight.legs) == len(estimate.path.heading_rad)):
        return None
    if not (estimate.noise_sd > 0.0 and all(leg.reading.size for leg in flight.legs)):
        return None
    if not (np.minimum(estimate.sources.amplitude, estimate.sources.peak_reading) > 0.0).all():
        return None
    prob, unit = _problem(flight, estimate, medium, heading_sd_rad)
    try:
        grown = _growth(flight, prob, _state(prob, unit, estimate), unit, estimate.noise_sd / unit.reading)
    except np.linalg.LinAlgError:
        return None
    return None if grown is None else _in_its_frame(grown, flight, estimate)


def _in_its_frame(grown: Growth, flight: Flight, estimate: Estimate) -> Growth:
    """With what the sources owe to a first leg that is not as the gauge has it, as the answer has it: from leg 1 on."""
    if estimate.gauge != "canonical":
        return grown
    places_m, loose = estimate.sources.position_m, float(estimate.diagnostics.get("corners_loose", 0.0))
    owed = np.trace(frame_covariance(flight, places_m, loose), axis1=1, axis2=2) / places_m.shape[1]
    return replace(grown, source_sd_m=np.hypot(grown.source_sd_m, np.sqrt(owed)))


@QUIET
def _growth(flight: Flight, prob: Problem, state: State, unit: Units, noise_sd: float) -> Growth | None:
    at = layout(prob, len(state.s))
    jacobian = evaluate(prob, state, at)[1] / noise_sd
    if not np.isfinite(jacobian).all():
        return None
    ends = np.cumsum([leg.reading.size for leg in flight.legs])
    known = jacobian[ends[-1] :]
    total = np.zeros((at.size, at.size))
    by_source, by_vertex = source_columns(at, len(state.s)), path_columns(prob, state, at)
    source_sd, path_sd = [], []
    for n, (first, last) in enumerate(zip(np.append(0, ends), ends, strict=False), start=1):
        total = total + jacobian[first:last].T @ jacobian[first:last]
        later = slice(at.heading.start + n - 1, at.heading.stop)
        sooner = known[~known[:, later].any(axis=1)]  # a path closes with its last leg
        covariance = _inverse(total + sooner.T @ sooner, later)
        source_sd.append(_sd(by_source, covariance))
        path_sd.append(np.sqrt(np.mean(_sd(by_vertex[: n + 1], covariance) ** 2)))
    told = (_told(np.array(sd), state.spread) * unit.length for sd in (source_sd, path_sd))
    return Growth(*told)


def path_sd_m(estimate: Estimate) -> float:
    """The standard deviation an axis of the estimate's own path, RMS over its vertices; NaN where it is not known."""
    vertices, names = estimate.path.vertices_m, estimate.parameter_names
    n_legs = len(vertices) - 1
    headings = [f"heading of leg {j}" for j in range(2, n_legs + 1)]
    if not has_positions(estimate) or not headings or not set(headings) <= set(names):
        return float("nan")
    lengths = [f"length of leg {j}" for j in range(1, n_legs + 1)]
    corners = [f"corner {j} {axis}" for j in range(2, n_legs + 1) for axis in "xy"]
    by_step = vertex_columns(vertices, Unknown(True, False, False))
    # a leg begun beside the corner shifts all that is flown from there on
    shift = (np.arange(n_legs + 1)[:, None] > np.arange(n_legs - 1))[:, None, :, None] * np.eye(2)[:, None, :]
    columns = np.concatenate([by_step, shift.reshape(n_legs + 1, 2, -1)], axis=2)
    told = [(names.index(name), i) for i, name in enumerate([*headings, *lengths, *corners]) if name in names]
    own, of_path = (list(part) for part in zip(*told, strict=True))
    covariance = estimate.parameter_covariance[np.ix_(own, own)]
    return float(np.sqrt(np.mean(_sd(columns[:, :, of_path], covariance) ** 2)))


def _problem(flight: Flight, estimate: Estimate, medium: Medium, heading_sd_rad: float | None) -> tuple[Problem, Units]:
    """The problem as the joint fit had it, in its units, with all that it knew besides the readings."""
    free = problem(flight, medium)
    freed = "extent" in estimate.parameter_names
    unit = units_of(free)
    prob = replace(normalised(free, unit), extent=None if freed else estimate.medium.extent or 0.0)
    heading = None
    if heading_sd_rad is not None:
        heading = (estimate.path.heading_rad - estimate.path.heading_rad[0], max(heading_sd_rad, LEAST_SD))
    priors = priors_of(flight, prob.dimensions, None, None, heading)
    loose = float(estimate.diagnostics.get("corners_loose", 0.0))
    weighed = float(estimate.diagnostics.get("priors_noise_sd", estimate.noise_sd))  # as the fit took the noise to be
    return constrained(prob, weighed / unit.reading, priors, unit, loose=loose), unit


def _state(prob: Problem, unit: Units, estimate: Estimate) -> State:
    """The answer as the joint model has it, in the canonical gauge of its own path; legs point to the next vertex."""
    sources, d = estimate.sources, estimate.path.vertices_m.shape[1]
    home = to_canonical(estimate.path.vertices_m)
    step = np.diff(home.apply(estimate.path.vertices_m), axis=0) / unit.length
    along = step / np.linalg.norm(step, axis=1)[:, None]
    over = step - prob.length[:, None] * along
    exact = np.setdiff1d(np.arange(prob.n_legs), loose_corners(prob))
    longer = np.zeros(prob.n_legs)
    longer[exact] = (over * along).sum(axis=1)[exact]
    gap = over.copy()
    gap[exact] = 0.0
    spread2 = sources.squared_spread_m2 / unit.length**2
    state = State.flat(
        prob,
        np.arctan2(along[:, 1], along[:, 0]),
        home.apply(sources.position_m) / unit.length,
        np.log(sources.amplitude / unit.reading / unit.length**d),
        np.log(spread2),
    )
    if prob.rate is None:
        mu = estimate.medium.diffusivity_m2_s
        rate = 4.0 * mu * unit.time / unit.length**2 if mu else float(spread2[0])
        state = replace(state, log_rate=float(np.log(rate)))
    if d == 3:
        state = replace(state, climb=np.arcsin(np.clip(along[:, 2], -1.0, 1.0)))
    lag = estimate.medium.sensor_lag_s
    return replace(
        state,
        longer=longer,
        gap=gap,
        ambient=(estimate.medium.ambient or 0.0) / unit.reading,
        extent=estimate.medium.extent or 0.0,
        log_lag=float(np.log(lag / unit.time)) if lag else -np.inf,
    )


def _inverse(total: Array, later: slice) -> Array:
    """(P, P) covariance; headings of legs not flown yet are left out, and what no reading depends on."""
    size = np.sqrt(np.diag(total))
    told = np.setdiff1d(np.flatnonzero(size > 0.0), np.arange(later.start, later.stop))
    unit = size[told]
    values, vectors = np.linalg.eigh(total[np.ix_(told, told)] / np.outer(unit, unit))
    blind = values <= UNSEEN * max(float(values[-1]), 1e-300)
    inverse = np.where(blind, UNSEEN_SD**2, 1.0 / np.where(blind, 1.0, values))
    covariance = np.zeros_like(total)
    covariance[np.ix_(told, told)] = (vectors * inverse) @ vectors.T / np.outer(unit, unit)
    return covariance


def _sd(columns: Array, covariance: Array) -> Array:
    """(M,) √(trace/d) of M points, from what every unknown does to them (M, d, P)."""
    variance = ((columns @ covariance) * columns).sum(axis=(1, 2)) / columns.shape[1]
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _told(sd: Array, spread_m: float) -> Array:
    """Infinite where a place is known to no better than a thousand spreads: nothing but rounding bounds it."""
    return np.where(sd < 1e3 * spread_m, sd, np.inf)
