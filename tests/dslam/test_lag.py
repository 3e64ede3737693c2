"""A slow sensor reads what it passed a while ago: its lag is known, or found with the rest."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from random_scenes import random_case

from dslam_mav import Flight, Medium, estimate
from dslam_mav.dslam.field import field
from dslam_mav.dslam.kernels.model import lagged

MEDIUM = Medium(spread_m=1.0, static=True)
LAG_S = 0.11  # at 1 √C a second; half a hundredth of the flight


def _case(seed: int):
    """A flight over two sources read by a slow sensor, and where the sources are."""
    case = random_case((515, seed), 2, 30.0)
    at, clean = np.zeros(2), []
    for leg, heading in zip(case.flight.legs, case.heading_rad, strict=True):
        way = np.array([np.cos(heading), np.sin(heading)])
        clean.append(field(at + leg.distance_m[:, None] * way, 1.0, case.position_m, case.amplitude))
        at = at + leg.length_m * way
    t = np.concatenate([leg.time_s for leg in case.flight.legs])
    seen = np.concatenate(clean)[:, None]
    lagged(seen, t, LAG_S)
    noisy = seen[:, 0] + case.noise_sd * np.random.default_rng(seed).standard_normal(t.size)
    parts = np.split(noisy, np.cumsum([leg.reading.size for leg in case.flight.legs])[:-1])
    flight = Flight(tuple(replace(leg, reading=part) for leg, part in zip(case.flight.legs, parts, strict=True)))
    return case, flight


def _error(result, truth) -> float:
    return min(
        float(np.linalg.norm(mode.sources.position_m[list(order)] - truth, axis=1).max())
        for mode in (result, *result.alternatives)
        for order in permutations(range(len(truth)))
    )


@pytest.mark.parametrize("told", [LAG_S, None])
def test_sources_are_found_through_a_slow_sensor(told):
    errors, steady, lags = [], [], []
    for seed in range(8):
        case, flight = _case(seed)
        result = estimate(flight, replace(MEDIUM, sensor_lag_s=told), 2)
        errors.append(_error(result, case.position_m))
        steady.append(_error(estimate(case.flight, MEDIUM, 2), case.position_m))
        lags.append(result.medium.sensor_lag_s)
    assert np.median(errors) < 2.0 * np.median(steady)
    assert np.median(lags) == pytest.approx(LAG_S, rel=0.1)
