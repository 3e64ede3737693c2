"""A mission flown before it is flown: simulated readings, the estimator, and how far off its answer is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.estimator import estimate
from dslam_mav.dslam.expected import Sensing
from dslam_mav.dslam.layouts import Layouts
from dslam_mav.records import Estimate, Flight, Leg, Medium

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Rehearsed:
    """RMS errors of sources and path relative to the first leg, in metres; infinite without an answer. `second`:
    whether another answer fits as well; `nearest_m`: the sources' error of the best of all answers given.
    """

    source_m: float
    path_m: float
    second: bool
    nearest_m: float

    @property
    def answered(self) -> bool:
        """Whether positions were given."""
        return bool(np.isfinite(self.source_m))


def rehearse(path: Array, layouts: Layouts, i: int, sensing: Sensing, rng: np.random.Generator) -> Rehearsed:
    """Fly the path (L+1, d) over layout `i` with fresh noise; the estimator is told K and what `sensing` says."""
    flown, flight = _flight(path, layouts, i, sensing, rng)
    step = np.diff(flown, axis=0)
    heading = None
    if sensing.heading_sd_rad is not None:
        true = np.arctan2(step[:, 1], step[:, 0])
        heading = (true + sensing.heading_sd_rad * rng.standard_normal(true.size), sensing.heading_sd_rad)
    result = estimate(flight, _medium(layouts, i, sensing), layouts.k_sources, heading_prior=heading)
    truth = to_canonical(flown)
    places, corners = truth.apply(layouts.places[i]), truth.apply(flown)
    sources = [_source_error(mode, places) for mode in (result, *result.alternatives)]
    return Rehearsed(sources[0], _path_error(result, corners), bool(result.alternatives), min(sources))


def _medium(layouts: Layouts, i: int, sensing: Sensing) -> Medium:
    spread_m, rate = float(layouts.spread_m[i]), float(layouts.rate_m2_s[i])
    ambient, d = (None if sensing.ambient_unknown else 0.0), layouts.places.shape[2]
    if rate > 0.0:
        age: float | Literal["shared"] = "shared" if sensing.spread_unknown else -(spread_m**2) / rate
        return Medium(diffusivity_m2_s=0.25 * rate, activation_s=age, ambient=ambient, dimensions=d)
    known = None if sensing.spread_unknown else spread_m
    return Medium(spread_m=known, static=True, ambient=ambient, dimensions=d)


def _flight(path: Array, layouts: Layouts, i: int, sensing: Sensing, rng: np.random.Generator) -> tuple[Array, Flight]:
    """The path truly flown, legs a little longer or shorter than said, and what is read on it."""
    step = np.diff(path, axis=0)
    said = np.linalg.norm(step, axis=1)
    along = step / said[:, None]
    true = said + sensing.length_sd_m * rng.standard_normal(said.size)
    flown = np.vstack([path[:1], path[0] + np.cumsum(true[:, None] * along, axis=0)])
    legs, start_s = [], 0.0
    for j, length in enumerate(said):
        count = max(1, round(length * sensing.readings_per_m))
        s = length * np.arange(count) / count
        time_s = start_s + s / sensing.speed_m_s
        reading = _field(flown[j] + s[:, None] * along[j], time_s, layouts, i)
        noisy = reading + sensing.noise_sd * rng.standard_normal(count)
        rise = float(step[j, 2]) if step.shape[1] == 3 else None
        legs.append(Leg(float(length), s, time_s, noisy, length_sd_m=sensing.length_sd_m, rise_m=rise))
        start_s += length / sensing.speed_m_s
    return flown, Flight(tuple(legs), closed=sensing.closed)


def _field(places: Array, time_s: Array, layouts: Layouts, i: int) -> Array:
    first = layouts.spread_m[i] ** 2
    c = (first + layouts.rate_m2_s[i] * time_s)[:, None]
    far2 = ((places[:, None] - layouts.places[i]) ** 2).sum(axis=2)
    return np.asarray((layouts.peak[i] * (first / c) ** (0.5 * places.shape[1]) * np.exp(-far2 / c)).sum(axis=1))


def _source_error(mode: Estimate, truth: Array) -> float:
    """RMS over the sources, each beside the one it stands for, in the canonical gauge of its own path."""
    if not np.isfinite(mode.sources.position_m).all():
        return float("inf")
    found = to_canonical(mode.path.vertices_m).apply(mode.sources.position_m)
    squares = ((found[:, None] - truth[None]) ** 2).sum(axis=2)
    return float(np.sqrt(squares[linear_sum_assignment(squares)].mean()))


def _path_error(mode: Estimate, truth: Array) -> float:
    if not np.isfinite(mode.path.vertices_m).all():
        return float("inf")
    found = to_canonical(mode.path.vertices_m).apply(mode.path.vertices_m)
    return float(np.sqrt(((found - truth) ** 2).sum(axis=1).mean()))
