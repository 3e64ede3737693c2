"""No answer depends on metres, seconds, the sensor's unit or when the clock was started."""

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import random_case

from dslam_mav import Flight, Leg, Medium, ParametricPath, estimate
from dslam_mav.dslam.field import field

AGE = 44.8
MU = 0.25 / AGE
STILL = random_case((22,), 2, 30.0, readings_per_leg=48).flight
EVOLVING = random_case((71,), 2, 40.0, age_over_flight=2.0, readings_per_leg=48).flight
CASES = {
    "spread known": (STILL, Medium(spread_m=1.0, static=True)),
    "spread and ambient unknown": (STILL, Medium(static=True, ambient=None)),
    "activation shared": (EVOLVING, Medium(diffusivity_m2_s=MU, activation_s="shared")),
    "activation known": (EVOLVING, Medium(diffusivity_m2_s=MU, activation_s=-AGE)),
    "diffusivity unknown": (EVOLVING, Medium(activation_s=-AGE)),
}
BIG, SMALL = 1e12, 1e-12
UNITS = {
    "lengths": [(BIG, 1.0, 1.0), (SMALL, 1.0, 1.0)],
    "times": [(1.0, BIG, 1.0), (1.0, SMALL, 1.0)],
    "readings": [(1.0, 1.0, BIG), (1.0, 1.0, SMALL)],
    "all": [(BIG, BIG, BIG), (SMALL, SMALL, SMALL), (BIG, SMALL, BIG), (SMALL, BIG, SMALL)],
}


def _flight(flight, length, time, reading, later=0.0):
    return Flight(
        tuple(
            Leg(leg.length_m * length, leg.distance_m * length, leg.time_s * time + later, leg.reading * reading)
            for leg in flight.legs
        )
    )


def _medium(medium, length, time, later=0.0):
    tau = medium.activation_s
    return replace(
        medium,
        spread_m=None if medium.spread_m is None else medium.spread_m * length,
        diffusivity_m2_s=None if medium.diffusivity_m2_s is None else medium.diffusivity_m2_s * length**2 / time,
        activation_s=tau if tau is None or isinstance(tau, str) else tau * time + later,
    )


def _same(result, plain, unit, rtol, later=0.0):
    length, time, reading = unit
    size = float(np.abs(plain.path.vertices_m).max())
    assert result.verdict is plain.verdict
    assert result.reason.split()[:4] == plain.reason.split()[:4]
    assert len(result.alternatives) == len(plain.alternatives)
    d = plain.sources.position_m.shape[1]
    pairs = [
        (result.sources.position_m / length, plain.sources.position_m, size),
        (result.path.vertices_m / length, plain.path.vertices_m, size),
        (result.path.heading_rad, plain.path.heading_rad, 1.0),
        (result.sources.amplitude / reading / length**d, plain.sources.amplitude, 0.0),
        (result.sources.peak_reading / reading, plain.sources.peak_reading, 0.0),
        (result.sd_m / length, plain.sd_m, 0.0),
        (result.noise_sd / reading, plain.noise_sd, 0.0),
        (result.spread_m / length, plain.spread_m, 0.0),
        ((result.sources.activation_s - later) / time, plain.sources.activation_s, AGE),
    ]
    for one, other, scale in pairs:
        np.testing.assert_allclose(one, other, rtol=rtol, atol=rtol * scale)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("kind", UNITS)
def test_units_do_not_matter(name, kind):
    flight, medium = CASES[name]
    plain = estimate(flight, medium, 2)
    for unit in UNITS[kind]:
        result = estimate(_flight(flight, *unit), _medium(medium, unit[0], unit[1]), 2)
        _same(result, plain, unit, 1e-9)


@pytest.mark.parametrize("name", CASES)
def test_the_clock_may_count_from_1970(name):
    flight, medium = CASES[name]
    plain = estimate(flight, medium, 2)
    later = 1.7e9
    result = estimate(_flight(flight, 1.0, 1.0, 1.0, later), _medium(medium, 1.0, 1.0, later), 2)
    _same(result, plain, (1.0, 1.0, 1.0), 1e-6, later)


@pytest.mark.parametrize("unit", [1e12, 1e-12])
def test_units_of_a_curve_do_not_matter(unit):
    t = np.linspace(0.0, 1.0, 100, endpoint=False)
    turn = 2.0 * np.pi * t
    basis = np.stack([np.cos(turn), np.sin(turn), np.cos(3.0 * turn), np.sin(2.0 * turn)], axis=1)
    places = basis @ np.array([[1.5, 0.2], [-0.3, 1.4], [0.6, -0.5], [0.4, 0.7]])
    reading = field(places, 1.0, np.array([[0.9, 0.6]]), np.array([100.0]))
    reading = reading + 0.02 * np.random.default_rng(3).standard_normal(t.size)
    results = [
        estimate(Flight(parametric=ParametricPath(basis, t * u, reading * u)), Medium(spread_m=u, static=True), 1)
        for u in (1.0, unit)
    ]
    plain, result = results
    assert result.verdict is plain.verdict
    np.testing.assert_allclose(result.sources.position_m / unit, plain.sources.position_m, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(result.sources.amplitude / unit**3, plain.sources.amplitude, rtol=1e-6)
