"""What a mission may be expected to see under a person's assumptions, before it is flown."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dslam_mav.assumptions import Assumptions
from dslam_mav.dslam.expected import QUIET, Sensing
from dslam_mav.dslam.layouts import Layouts, Prior, Region, drawn, noise_below
from dslam_mav.dslam.outlook import LAYOUTS, Outlook, Range, outlook
from dslam_mav.records import Prediction
from dslam_mav.records.arrays import Array
from dslam_mav.records.prediction import FAINTEST, LEG_SPREADS, READINGS_PER_SPREAD, SNR_DB, layouts_for

UNKNOWN_NUMBER = (2, 4)  # of sources, where it is left open
TOO_MANY_LEGS = 200  # a flight waits for its forecast


@dataclass(frozen=True, slots=True)
class Sensor:
    """What is known of readings before a flight: how many a metre, their noise beside a usual source's peak reading in
    the same unit, and how fast the vehicle flies; None: the usual.
    """

    readings_per_m: float | None = None
    noise_sd: float | None = None
    peak: float | None = None
    speed_m_s: float | None = None


def forecast(vertices_m: ArrayLike, assumed: Assumptions, sensor: Sensor) -> Prediction | None:
    """Over random layouts of sources about the path (L+1, 2); None where no layout can be drawn or read there, or the
    legs are more than 200.
    """
    path = np.asarray(vertices_m, dtype=np.float64)
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    if not (0 < len(lengths) <= TOO_MANY_LEGS and np.isfinite(lengths).all() and lengths.min() > 0.0):
        return None
    prior = _prior(path, assumed, sensor, float(lengths.max()) / LEG_SPREADS)
    try:
        groups = drawn(prior, layouts_for(LAYOUTS, len(lengths)), np.random.default_rng(0))
        sensing = _sensing(assumed, sensor, prior, groups)
        seen = outlook(path, groups, sensing)
        return _prediction(prior, sensing, float(lengths.sum()), seen)
    except ValueError:  # too little room for so many sources, no reading at all, a path of thousands of spreads
        return None


def _prior(path: Array, assumed: Assumptions, sensor: Sensor, usual_m: float) -> Prior:
    k = UNKNOWN_NUMBER if assumed.n_sources is None else (assumed.n_sources, assumed.n_sources)
    spread = _given_spread_m(assumed) or usual_m
    rate = 0.0 if assumed.static or assumed.diffusivity_m2_s is None else 4.0 * assumed.diffusivity_m2_s
    region = Region(tuple(path.min(axis=0).tolist()), tuple(path.max(axis=0).tolist()))
    return Prior(k, (spread, spread), region, rate, sensor.peak or 1.0)


def _given_spread_m(assumed: Assumptions) -> float | None:
    if assumed.spread_m is not None:
        return assumed.spread_m
    mu, tau = assumed.diffusivity_m2_s, assumed.activation_s
    return math.sqrt(-4.0 * mu * tau) if mu is not None and tau is not None and tau < 0.0 else None


@QUIET
def _sensing(assumed: Assumptions, sensor: Sensor, prior: Prior, groups: list[Layouts]) -> Sensing:
    noise_sd = sensor.noise_sd if sensor.peak is not None else None
    noise_sd = noise_sd or noise_below(groups, prior.region, SNR_DB)
    if not noise_sd >= FAINTEST * prior.peak:
        raise ValueError("noise_sd: next to nothing is read there")
    return Sensing(
        noise_sd=noise_sd,
        readings_per_m=sensor.readings_per_m or READINGS_PER_SPREAD / prior.usual_spread_m,
        speed_m_s=sensor.speed_m_s or 1.0,
        heading_sd_rad=None if assumed.heading == "none" else assumed.heading_sd_rad,
        closed=assumed.closed,
        ambient_unknown=assumed.ambient is None,
        spread_unknown=_given_spread_m(assumed) is None,
    )


def _prediction(prior: Prior, sensing: Sensing, length_m: float, seen: Outlook) -> Prediction:
    def of(values: Range) -> tuple[float, float]:
        return values.median_m, values.p90_m

    return Prediction(
        n_sources=prior.k_sources,
        spread_m=prior.usual_spread_m,
        area_m=tuple(float(side) for side in prior.region.extent),
        peak=prior.peak,
        noise_sd=sensing.noise_sd,
        readings_per_m=sensing.readings_per_m,
        length_m=length_m,
        source_error_m=of(seen.source),
        path_error_m=of(seen.path),
        source_error_aligned_m=of(seen.source_aligned),
        path_error_aligned_m=of(seen.path_aligned),
        unidentifiable_share=seen.unidentifiable_share,
    )
