"""Times and lengths given in whatever scale: Unix time stamps, and a curve whose size known points alone tell."""

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import random_case

from dslam_mav import Flight, Medium, ParametricPath, Verdict, estimate
from dslam_mav.dslam.field import field
from dslam_mav.dslam.problem import problem
from dslam_mav.dslam.reduce import reduced

UNIX_S = 1.7e9
T = np.linspace(0.0, 1.0, 200, endpoint=False)
TURN = 2.0 * np.pi * T
BASIS = np.stack([np.cos(TURN), np.sin(TURN), np.cos(3.0 * TURN), np.sin(2.0 * TURN)], axis=1)
PATH = BASIS @ [[1.5, 0.2], [-0.3, 1.4], [0.6, -0.5], [0.4, 0.7]]
SOURCES = np.array([[0.9, 0.6], [-0.8, -0.3]])


def test_many_readings_at_unix_times_are_reduced():
    """Rounded to 2e-7 s each, they stray from a steady run by more than a part in a billion of the flight."""
    medium = Medium(diffusivity_m2_s=0.005, activation_s=-50.0)
    flight = random_case((5,), 2, 40.0, readings_per_leg=4096, age_over_flight=2.0).flight
    late = Flight(tuple(replace(leg, time_s=UNIX_S + leg.time_s) for leg in flight.legs))
    there = reduced(problem(late, replace(medium, activation_s=UNIX_S - 50.0)), 1.0)
    here = reduced(problem(flight, medium), 1.0)
    assert here.y.size == there.y.size < 1000
    np.testing.assert_allclose(there.y, here.y, rtol=1e-6)
    np.testing.assert_allclose(there.t, here.t, atol=1e-6)


@pytest.mark.parametrize("size", [0.03, 10.0, 100.0])
@pytest.mark.parametrize("k_sources", [1, 2])
def test_known_points_tell_the_size_of_a_curve(size, k_sources):
    """The spread unknown, nothing else does: (c, S, C, a) → (λc, λS, λ²C, λᵈa) changes no reading."""
    clean = field(PATH, 1.0, SOURCES[:k_sources], np.array([9.0, 6.0])[:k_sources])
    reading = clean + 0.01 * np.random.default_rng(1).standard_normal(T.size)
    flight = Flight(parametric=ParametricPath(BASIS, T, reading))
    points = {i: size * PATH[i] for i in (0, 60, 120)}
    result = estimate(flight, Medium(static=True, ambient=None), k_sources, known_points=points)
    assert result.verdict is Verdict.IDENTIFIED
    assert result.spread_m == pytest.approx(size, rel=0.03)
    np.testing.assert_allclose(result.sources.position_m, size * SOURCES[:k_sources], atol=0.03 * size)
