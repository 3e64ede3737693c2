"""What is predicted before take-off: as `plan` predicts it, and nothing where nothing can be said."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dslam_mav.assumptions import Assumptions
from dslam_mav.forecast import UNKNOWN_NUMBER, Sensor, forecast
from missions.patterns import pattern

STAR = pattern("star7", 32.0)


def test_a_star_sees_and_a_square_does_not():
    star = forecast(STAR, Assumptions(n_sources=3, ambient=20.0), Sensor(2.0))
    square = forecast(pattern("square", 32.0), Assumptions(n_sources=3), Sensor(2.0))
    assert star is not None
    assert square is not None
    assert star.unidentifiable_share < 0.02
    assert 0.2 < star.source_error_m[0] < star.source_error_m[1] < 5.0
    assert star.spread_m == pytest.approx(10.0)
    assert star.length_m == pytest.approx(224.0)
    assert square.unidentifiable_share > 0.5
    assert math.isinf(square.source_error_m[0])


def test_less_noise_and_more_readings_see_more():
    assumed = Assumptions(n_sources=2, spread_m=10.0, ambient=0.0)
    coarse = forecast(STAR, assumed, Sensor(2.0, noise_sd=0.1, peak=1.0))
    dense = forecast(STAR, assumed, Sensor(8.0, noise_sd=0.1, peak=1.0))
    quiet = forecast(STAR, assumed, Sensor(2.0, noise_sd=0.5, peak=10.0))
    assert coarse is not None
    assert dense is not None
    assert quiet is not None
    assert dense.source_error_m[0] == pytest.approx(coarse.source_error_m[0] / 2.0, rel=0.05)
    assert quiet.source_error_m[0] == pytest.approx(coarse.source_error_m[0] / 2.0, rel=0.01)


def test_what_is_known_helps_and_what_is_open_is_said():
    blind = forecast(STAR, Assumptions(n_sources=2), Sensor())
    compass = forecast(STAR, Assumptions(n_sources=2, heading="vehicle", heading_sd_rad=0.01), Sensor())
    open_number = forecast(STAR, Assumptions(), Sensor())
    assert blind is not None
    assert compass is not None
    assert open_number is not None
    assert compass.path_error_m[0] < 0.5 * blind.path_error_m[0]
    assert open_number.n_sources == UNKNOWN_NUMBER


def test_the_spread_is_what_is_assumed_of_it():
    aged = forecast(STAR, Assumptions(n_sources=2, diffusivity_m2_s=0.5, activation_s=-32.0), Sensor())
    assert aged is not None
    assert aged.spread_m == pytest.approx(8.0)


@pytest.mark.parametrize(
    ("path", "assumed"),
    [
        ([[0.0, 0.0]], Assumptions(n_sources=2)),
        ([[0.0, 0.0], [np.nan, 1.0]], Assumptions(n_sources=2)),
        ([[0.0, 0.0], [0.0, 0.0]], Assumptions(n_sources=2)),
        ([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]], Assumptions(n_sources=5, spread_m=100.0)),
        (np.column_stack([np.arange(300.0), np.arange(300.0) % 2]), Assumptions(n_sources=2)),
        ([[0.0, 0.0], [5000.0, 0.0], [5000.0, 9.0]], Assumptions(n_sources=2, spread_m=0.1)),
    ],
)
def test_a_flight_nothing_can_be_said_of_is_not_held_up(path, assumed):
    assert forecast(path, assumed, Sensor()) is None
