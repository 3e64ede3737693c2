"""A simulated flight with its truth, what the estimator is told of it, and the row that comes of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from dslam_mav.dslam.estimator import estimate
from dslam_mav.dslam.predict import bound
from dslam_mav.records import Estimate, Flight, Medium, Sources, Truth
from dslam_mav.records.arrays import Array
from dslam_mav.sweep.points.columns import Row
from dslam_mav.sweep.points.judge import judged


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """A flight along `vertices_m` (L+1, 2) over `sources`, whose activation times count on the flight's clock."""

    flight: Flight
    vertices_m: Array
    sources: Sources
    noise_sd: float
    speed_m_s: float

    @property
    def truth(self) -> Truth:
        """What the answer is judged against."""
        return Truth(self.sources.position_m, self.sources.amplitude, self.vertices_m)

    @property
    def spread_m(self) -> float:
        """√C of the first reading: the root of the sources' mean C."""
        return float(np.sqrt(np.mean(self.sources.squared_spread_m2)))


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """What the estimator is told, as `estimate` takes it."""

    medium: Medium
    n_sources: int | None
    max_sources: int = 5
    method: Literal["joint", "paper"] = "joint"
    closed: bool = False
    heading_sd_rad: float | None = None


def answered(flown: Flown, told: Told, rng: np.random.Generator) -> Estimate:
    """The estimate; `rng` draws the compass's errors, where there is a compass."""
    prior = None
    if told.heading_sd_rad is not None:
        step = np.diff(flown.vertices_m, axis=0)
        true = np.arctan2(step[:, 1], step[:, 0])
        prior = (true + told.heading_sd_rad * rng.standard_normal(true.size), told.heading_sd_rad)
    return estimate(
        replace(flown.flight, closed=told.closed),
        told.medium,
        told.n_sources,
        max_sources=told.max_sources,
        method=told.method,
        heading_prior=prior,
    )


def row_of(flown: Flown, told: Told, answer: Estimate) -> Row:
    """The result columns of a simulated flight."""
    truth = flown.truth
    if answer.gauge == "anchored":  # to its first vertex
        origin = flown.vertices_m[0]
        truth = Truth(truth.source_position_m - origin, truth.amplitude, truth.vertices_m - origin)
    row = judged(answer, flown.flight, truth, flown.spread_m)
    least = bound_m(flown, told)
    error = row.get("source_error_rms_m")
    row["bound_m"] = least
    row["error_over_bound"] = error / least if isinstance(error, float) and least > 0.0 else None
    row["spread_m"], row["noise_sd"] = flown.spread_m, flown.noise_sd
    return row


def bound_m(flown: Flown, told: Told) -> float:
    """What the Cramér–Rao bound allows, RMS over the sources; NaN without noise."""
    if not flown.noise_sd > 0.0:
        return float("nan")
    least = bound(
        flown.vertices_m,
        flown.sources,
        told.medium,
        readings_per_leg=max(1, round(flown.flight.n_readings / len(flown.flight.legs))),
        speed_m_s=flown.speed_m_s,
        noise_sd=flown.noise_sd,
        heading_sd_rad=told.heading_sd_rad,
        closed=told.closed,
    )
    return float(np.sqrt(np.trace(least.position_covariance_m2, axis1=1, axis2=2).mean()))
