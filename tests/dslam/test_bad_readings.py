"""Whatever was flown and read: a verdict that fits, or a ValueError that names the argument; no warning, no crash."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_scenes import random_case
from sound import WITH_POSITIONS, sound

from dslam_mav import Flight, Leg, Medium, ParametricPath, Verdict, estimate
from dslam_mav.dslam.field import field
from dslam_mav.dslam.path import vertices
from missions.patterns import star

pytestmark = pytest.mark.filterwarnings("error")

FLIGHT = random_case((22,), 2, 30.0, readings_per_leg=24).flight
SHORT = random_case((22,), 2, 30.0, readings_per_leg=12, vertices=star(5, 2, 3.2)).flight  # for what no fit explains
KNOWN = Medium(spread_m=1.0, static=True)
FREE = Medium(static=True, ambient=None)

T = np.linspace(0.0, 1.0, 80, endpoint=False)
TURN = 2.0 * np.pi * T
BASIS = np.stack([np.cos(TURN), np.sin(TURN), np.cos(3.0 * TURN), np.sin(2.0 * TURN)], axis=1)
CURVE = ParametricPath(
    BASIS, T, field(BASIS @ [[1.5, 0.2], [-0.3, 1.4], [0.6, -0.5], [0.4, 0.7]], 1.0, [[0.9, 0.6]], [9.0])
)


def _changed(change, flight=FLIGHT):
    return Flight(tuple(replace(leg, **change(j, leg)) for j, leg in enumerate(flight.legs)))


def _read(change, flight=FLIGHT):
    return _changed(lambda j, leg: {"reading": change(j, leg.reading)}, flight)


def _refused(argument, call):
    """ValueError, if any, that names the argument; otherwise a sound estimate."""
    try:
        result = call()
    except ValueError as error:
        assert argument in str(error)  # noqa: PT017 - either outcome is right
        return None
    return sound(result)


class TestReadings:
    @pytest.mark.parametrize("medium", [KNOWN, FREE])
    @pytest.mark.parametrize("level", [0.0, 5.0, -5.0, 1e300])
    def test_readings_all_alike(self, medium, level):
        result = sound(estimate(_read(lambda _, y: 0.0 * y + level), medium, 2))
        assert result.verdict is Verdict.NOT_IDENTIFIABLE
        assert "168 readings" in result.reason

    @settings(max_examples=10, deadline=None)
    @given(
        st.sampled_from(["spike", "negative", "noise", "steps", "ramp", "one leg", "alternating", "outlier", "offset"]),
        st.sampled_from([KNOWN, FREE]),
        st.sampled_from([1, 2]),
    )
    def test_readings_of_no_source(self, kind, medium, k_sources):
        rng = np.random.default_rng(1)
        change = {
            "spike": lambda j, y: 1.0 * ((np.arange(y.size) == 7) & (j == 3)),
            "negative": lambda _, y: -y,
            "noise": lambda _, y: rng.standard_normal(y.size),
            "steps": lambda j, y: 0.0 * y + j,
            "ramp": lambda j, y: np.arange(y.size) + 24.0 * j,
            "one leg": lambda j, y: y * (j == 2),
            "alternating": lambda _, y: (-1.0) ** np.arange(y.size),
            "outlier": lambda j, y: y + 1e6 * ((np.arange(y.size) == 7) & (j == 3)),
            "offset": lambda _, y: y + 1e12,
        }[kind]
        sound(estimate(_read(change, SHORT), medium, k_sources))

    @pytest.mark.parametrize("factor", [1e300, 1e160, 1e-300, 1e-320])
    def test_huge_and_denormal_readings(self, factor):
        plain, result = estimate(FLIGHT, KNOWN, 2), sound(estimate(_read(lambda _, y: y * factor), KNOWN, 2))
        assert result.verdict is plain.verdict
        np.testing.assert_allclose(result.sources.position_m, plain.sources.position_m, atol=0.05)
        np.testing.assert_allclose(result.residual / factor, plain.residual, atol=0.2)

    def test_readings_whose_range_overflows(self):
        flight = _read(lambda _, y: np.where(np.arange(y.size) % 2, 1.7e308, -1.7e308))
        with pytest.raises(ValueError, match="flight"):
            estimate(flight, FREE, 2)

    @pytest.mark.parametrize("share", [-1.0, -0.2])
    @pytest.mark.parametrize("k_sources", [1, 2])
    def test_a_cold_source_beside_a_hot_one_gets_a_verdict(self, share, k_sources):
        rng = np.random.default_rng(5)
        path = star(7, 3, 3.2)
        path = path - path[:-1].mean(axis=0)
        s, legs = 3.2 * np.arange(20) / 20, []
        for j, (a, b) in enumerate(pairwise(path)):
            places = a + np.outer(s, b - a) / 3.2
            y = field(places, 1.0, np.array([[0.8, 0.3], [-0.9, -0.2]]), np.array([100.0, 100.0 * share]))
            legs.append(Leg(3.2, s, 3.2 * j + s, y + 0.1 * rng.standard_normal(20)))
        result = sound(estimate(Flight(tuple(legs)), KNOWN, k_sources))
        assert result.verdict in (Verdict.MODEL_MISFIT, Verdict.NOT_IDENTIFIABLE, Verdict.NOT_CONVERGED)

    @pytest.mark.parametrize("ambient", [1e300, -1e300, 1e15])
    def test_an_ambient_level_far_from_every_reading(self, ambient):
        assert sound(estimate(FLIGHT, replace(KNOWN, ambient=ambient), 2)).verdict is Verdict.NOT_IDENTIFIABLE


class TestPlaces:
    @pytest.mark.parametrize(
        ("legs", "says"),
        [
            ((), "flight"),
            (FLIGHT.legs[:1], "1 leg "),
            (FLIGHT.legs[:2], "2 legs"),
            (tuple(Leg(3.2, [], [], []) for _ in range(4)), "No reading"),
            ((*FLIGHT.legs[:3], Leg(3.2, [], [], []), *FLIGHT.legs[3:]), "Leg 4 has 0"),
            (_changed(lambda _, leg: {"distance_m": 0.0 * leg.distance_m + 1.0}).legs, "one place"),
            (_changed(lambda _, leg: {"distance_m": 1e-5 * leg.distance_m}).legs, "one place"),
        ],
    )
    def test_too_few_legs_or_readings(self, legs, says):
        result = _refused(says, lambda: estimate(Flight(legs), KNOWN, 2))
        if result is not None:
            assert result.verdict is Verdict.TOO_FEW_DATA
            assert says in result.reason

    @settings(max_examples=10, deadline=None)
    @given(
        st.sampled_from(
            [
                lambda _, s: np.minimum(s, 1.5),
                lambda _, s: np.where(np.arange(s.size) % 2, 0.0, 3.2),
                lambda _, s: s + 10.0,
                lambda _, s: s + 1e6,
                lambda _, s: s * 1e300,
                lambda _, s: -s,
                lambda j, s: s + 1e200 * ((np.arange(s.size) == 5) & (j == 3)),
            ]
        ),
        st.sampled_from([KNOWN, FREE]),
        st.sampled_from([1, 2]),
    )
    def test_hovering_and_readings_far_outside_a_leg(self, change, medium, k_sources):
        flight = _changed(lambda j, leg: {"distance_m": change(j, leg.distance_m)}, SHORT)
        sound(estimate(flight, medium, k_sources))

    def test_a_reading_far_off_its_leg_is_told(self):
        """Not clipped to the leg's neighbourhood and counted as noise."""
        off = _changed(lambda j, leg: {"distance_m": leg.distance_m + (3.4 if j == 2 else 0.0)})
        result = sound(estimate(off, KNOWN, 2))
        assert result.verdict is Verdict.NOT_IDENTIFIABLE
        assert "leg 3 lies at 6.47 m, more than the leg's length of 3.2 m beyond its ends" in result.reason

    @pytest.mark.parametrize("spread", [1e-300, 1e-90, 1e-6, 1e-3, 1e6, 1e90, 1e300])
    def test_a_known_spread_out_of_all_scale(self, spread):
        result = _refused("spread_m", lambda: estimate(FLIGHT, replace(KNOWN, spread_m=spread), 2))
        assert result is None or result.verdict is Verdict.NOT_IDENTIFIABLE

    @pytest.mark.parametrize("length", [1e-300, 1e300])
    def test_lengths_whose_squares_cannot_be_held(self, length):
        with pytest.raises(ValueError, match="length_m"):
            estimate(_changed(lambda *_: {"length_m": length}), KNOWN, 2)

    @settings(max_examples=8, deadline=None)
    @given(st.sampled_from([1e-300, 1e-3, 1e3, 1e300]))
    def test_any_lag(self, lag):
        sound(estimate(FLIGHT, replace(KNOWN, sensor_lag_s=lag), 2))


class TestCurves:
    @pytest.mark.parametrize(
        ("basis", "verdict"),
        [
            (0.0 * BASIS, Verdict.NOT_IDENTIFIABLE),
            (np.ones((80, 1)), Verdict.NOT_IDENTIFIABLE),
            (BASIS[:, [0, 0]], Verdict.NOT_IDENTIFIABLE),
            (BASIS[:, :1], Verdict.NOT_IDENTIFIABLE),
            (np.cos(np.outer(TURN, np.arange(1, 50))), Verdict.TOO_FEW_DATA),
        ],
        ids=["zero", "constant", "twice the same", "one", "too many"],
    )
    def test_functions_that_make_no_path(self, basis, verdict):
        result = sound(estimate(Flight(parametric=ParametricPath(basis, T, CURVE.reading)), KNOWN, 1))
        assert result.verdict is verdict
        assert result.path.coefficients_m.shape == (basis.shape[1], 2)

    @pytest.mark.parametrize("factor", [1e-200, 1e200])
    def test_functions_out_of_all_scale(self, factor):
        with pytest.raises(ValueError, match="basis"):
            estimate(Flight(parametric=ParametricPath(factor * BASIS, T, CURVE.reading)), KNOWN, 1)

    @pytest.mark.parametrize("count", [0, 1, 2, 3, 12])
    def test_too_few_readings(self, count):
        curve = ParametricPath(BASIS[:count], T[:count], CURVE.reading[:count])
        assert sound(estimate(Flight(parametric=curve), KNOWN, 2)).verdict is Verdict.TOO_FEW_DATA

    def test_options_a_curve_has_not(self):
        for name, value in (("heading_prior", ([0.0] * 4, 0.1)), ("heading_prior", ([], 0.1))):
            with pytest.raises(ValueError, match=name):
                estimate(Flight(parametric=CURVE), KNOWN, 1, **{name: value})
        with pytest.raises(ValueError, match="closed_sd_m"):
            estimate(Flight(parametric=CURVE, closed=True), KNOWN, 1)


class TestSpace:
    @pytest.mark.parametrize("rise", [None, 0.0, 0.5, 3.2, "mixed"])
    def test_with_and_without_climbs(self, rise):
        theta = np.arange(4) * 2.1
        path = vertices(theta, np.full(4, 3.2))
        s, legs = 3.2 * np.arange(16) / 16, []
        for j, (a, b) in enumerate(pairwise(path)):
            y = field(a + np.outer(s, b - a) / 3.2, 1.0, np.array([[1.0, 0.9]]), np.array([50.0]))
            own = (None if j else 0.5) if rise == "mixed" else rise
            legs.append(Leg(3.2, s, 3.2 * j + s, y, rise_m=own))
        result = sound(estimate(Flight(tuple(legs)), replace(KNOWN, dimensions=3), 1))
        assert result.sources.position_m.shape == (1, 3)

    def test_level_legs_are_told_what_they_lack(self):
        path = star(7, 3, 3.2)
        place = path[:-1].mean(axis=0) + np.array([[0.8, 0.3], [-0.9, -0.2]])
        s, legs = 3.2 * np.arange(32) / 32, []
        for j, (a, b) in enumerate(pairwise(path)):
            y = field(a + np.outer(s, b - a) / 3.2, 1.0, place, np.array([50.0, 40.0]))
            y = y + 0.05 * np.random.default_rng(j).standard_normal(32)
            legs.append(Leg(3.2, s, 3.2 * j + s, y, rise_m=0.0))
        for medium in (KNOWN, FREE):
            result = sound(estimate(Flight(tuple(legs)), replace(medium, dimensions=3), 2))
            assert result.verdict is Verdict.NOT_IDENTIFIABLE
            assert "Legs that climb or sink would help" in result.reason


@pytest.mark.parametrize("medium", [FREE, Medium(), Medium(sensor_lag_s=None, spread_m=1.0, static=True)])
def test_a_sound_flight_is_answered_without_a_warning(medium):
    assert sound(estimate(FLIGHT, medium, 2)).verdict in WITH_POSITIONS
