"""Whatever arguments estimate() is given: a ValueError naming them, or a verdict that fits; no warning, no crash."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_scenes import random_case
from sound import sound

from dslam_mav import Flight, Leg, Medium, ParametricPath, Verdict, estimate

pytestmark = pytest.mark.filterwarnings("error")

CASE = random_case((22,), 2, 30.0, readings_per_leg=24)
FLIGHT = CASE.flight
KNOWN = Medium(spread_m=1.0, static=True)
EXTREME = [0.0, -1.0, 1e-320, 1e-12, 1e12, 1e300, -1e300, np.nan, np.inf]


def _changed(change, flight=FLIGHT):
    return Flight(tuple(replace(leg, **change(j, leg)) for j, leg in enumerate(flight.legs)))


class TestArguments:
    @pytest.mark.parametrize("k", [0, -1, 2.5, 2.0, True, 9, "2", np.nan, [2], 10**30])
    def test_impossible_numbers_of_sources(self, k):
        with pytest.raises(ValueError, match="n_sources"):
            estimate(FLIGHT, KNOWN, k)
        with pytest.raises(ValueError, match="max_sources"):
            estimate(FLIGHT, KNOWN, max_sources=k)

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            *[("seed", v) for v in (-1, 2.5, "x", None, True)],
            *[("method", v) for v in ("prony", None, 3)],
            *[("max_sources", v) for v in (None,)],
            *[("closed_sd_m", v) for v in (0.0, -1.0, np.nan, np.inf, "a", [1.0, 2.0], True)],
            *[("start", v) for v in ("x", 3, FLIGHT)],
            *[("known_points", v) for v in (5, [[0, 0], [1, 1]], {0: [0, 0]}, {0: [0, 0], 99: [1, 1]})],
            *[("known_points", {0: [0, 0], i: [1, 1]}) for i in (-1, True, "a", 1.0)],
            *[("known_points", {0: [0, 0], 1: v}) for v in ([np.nan, 0], [1, 1, 1], "x", None, 7.0)],
        ],
    )
    def test_impossible_options(self, name, value):
        with pytest.raises(ValueError, match=name):
            estimate(FLIGHT, KNOWN, 2, **{name: value})

    @pytest.mark.parametrize(
        "prior",
        [
            3.0,
            CASE.heading_rad,
            (CASE.heading_rad,),
            (None, 0.1),
            ("a", 0.1),
            (CASE.heading_rad[:3], 0.1),
            (CASE.heading_rad[None], 0.1),
            (CASE.heading_rad * np.nan, 0.1),
            *[(CASE.heading_rad, sd) for sd in (0.0, -1.0, np.nan, "a", None, [0.1, 0.2], CASE.heading_rad)],
        ],
    )
    def test_impossible_headings(self, prior):
        with pytest.raises(ValueError, match="heading_prior"):
            estimate(FLIGHT, KNOWN, 2, heading_prior=prior)

    def test_what_is_no_flight_or_medium(self):
        for flight in (None, list(FLIGHT.legs), Flight()):
            with pytest.raises(ValueError, match="flight"):
                estimate(flight, KNOWN, 2)
        with pytest.raises(ValueError, match="medium"):
            estimate(FLIGHT, None, 2)

    @pytest.mark.parametrize("tau", [0.0, 5.0, (-3.0, 5.0), (-3.0, -2.0, -1.0)])
    def test_activation_after_the_first_reading_or_of_other_sources(self, tau):
        with pytest.raises(ValueError, match="activation_s"):
            estimate(FLIGHT, Medium(diffusivity_m2_s=0.1, activation_s=tau), 2)

    @settings(max_examples=20, deadline=None)
    @given(st.sampled_from(EXTREME), st.sampled_from(["closed_sd_m", "heading", "length_sd_m"]))
    def test_extreme_deviations(self, value, which):
        flight, options = FLIGHT, {}
        try:
            if which == "length_sd_m":
                flight = _changed(lambda *_: {"length_sd_m": value})
            else:
                options = (
                    {"closed_sd_m": value} if which == "closed_sd_m" else {"heading_prior": (CASE.heading_rad, value)}
                )
            result = estimate(flight, KNOWN, 2, **options)
        except ValueError as error:
            assert which in str(error)  # noqa: PT017 - either outcome is right
            return
        sound(result)

    def test_exact_knowledge_is_exact(self):
        near, exact = (estimate(FLIGHT, KNOWN, 2, closed_sd_m=sd) for sd in (1e-5, 1e-300))
        assert exact.verdict is near.verdict is Verdict.IDENTIFIED
        np.testing.assert_allclose(exact.sd_m, near.sd_m, rtol=1e-3)
        np.testing.assert_allclose(exact.sources.position_m, near.sources.position_m, atol=1e-4)

    def test_points_nearer_than_the_leg_between_them(self):
        result = sound(estimate(FLIGHT, KNOWN, 2, known_points={0: [0, 0], 1: [0, 0]}))
        assert result.verdict is Verdict.MODEL_MISFIT
        assert "misses known point" in result.reason

    @pytest.mark.parametrize("points", [{0: [0, 0], 1: [3.5, 0]}, {1: [0, 0], 2: [0, 0], 6: [0, 14]}])
    def test_points_further_apart_than_the_path_between_them_is_long(self, points):
        with pytest.raises(ValueError, match=r"known_points: expected points . and . no further apart"):
            estimate(FLIGHT, KNOWN, 2, known_points=points)

    @pytest.mark.parametrize(
        ("call", "says"),
        [
            (lambda: estimate(FLIGHT.legs, KNOWN, 2), r"flight: expected a Flight, got its 7 legs alone; use Flight\("),
            (lambda: estimate(FLIGHT.legs[0], KNOWN, 2), "flight: expected a Flight, got a Leg"),
            (lambda: estimate(FLIGHT, FLIGHT, 2), "medium: expected a Medium, got a Flight"),
            (lambda: estimate(FLIGHT, KNOWN, 2, known_points={99: [0, 0]}), "known_points: .* from 0 to 7, got 99"),
            (lambda: estimate(FLIGHT, KNOWN, 2, known_points=np.zeros((90, 2))), "known_points: .*ndarray of 90"),
            (
                lambda: estimate(FLIGHT, Medium(diffusivity_m2_s=0.1, activation_s=(-3.0, -2.0))),
                "n_sources: expected 2, one for each time in medium.activation_s",
            ),
        ],
    )
    def test_misuse_is_told_in_a_line(self, call, says):
        with pytest.raises(ValueError, match=says) as told:
            call()
        assert len(str(told.value)) < 160
        assert "\n" not in str(told.value)


@pytest.fixture(scope="module")
def plain():
    return estimate(FLIGHT, KNOWN, 2)


class TestStart:
    """A start that is of no use changes nothing."""

    def _starts(self, plain):
        sources, path = plain.sources, plain.path
        nan, zero = np.nan, 0.0
        yield replace(plain, sources=replace(sources, position_m=sources.position_m * nan))
        yield replace(plain, sources=replace(sources, amplitude=sources.amplitude * nan))
        yield replace(plain, sources=replace(sources, amplitude=-sources.amplitude))
        yield replace(plain, path=replace(path, vertices_m=path.vertices_m * nan))
        yield replace(plain, path=replace(path, vertices_m=path.vertices_m * zero))
        yield estimate(FLIGHT, KNOWN, 3)
        yield estimate(Flight(FLIGHT.legs[:2]), KNOWN, 2)
        yield estimate(random_case((99,), 2, 30.0, readings_per_leg=24).flight, KNOWN, 2)

    def test_useless_starts(self, plain):
        for start in self._starts(plain):
            result = sound(estimate(FLIGHT, KNOWN, 2, start=start))
            assert result.verdict is plain.verdict
            np.testing.assert_allclose(result.sources.position_m, plain.sources.position_m, atol=1e-3)

    def test_a_start_in_space_or_with_more_legs(self, plain):
        sound(estimate(Flight(FLIGHT.legs[:4]), KNOWN, 2, start=plain))
        flat = _changed(lambda *_: {"rise_m": 0.0})
        space = estimate(Flight(flat.legs[:4]), replace(KNOWN, dimensions=3), 1, start=plain)
        sound(space)
        assert sound(estimate(FLIGHT, KNOWN, 1, start=space)).sources.position_m.shape == (1, 2)


class TestRecords:
    @settings(max_examples=60, deadline=None)
    @given(
        st.sampled_from(["distance_m", "time_s", "reading"]),
        st.sampled_from([None, "a", 3.0, [], [1.0], [[1.0], [1.0, 2.0]], np.zeros((3, 3)), [1j] * 24, [object()] * 24])
        | st.sampled_from(EXTREME).map(lambda v: [v] * 24),
    )
    def test_bad_arrays_of_a_leg(self, name, value):
        try:
            leg = replace(FLIGHT.legs[0], **{name: value})
        except ValueError as error:
            assert name in str(error)  # noqa: PT017 - either outcome is right
        else:
            assert np.isfinite(getattr(leg, name)).all()

    @pytest.mark.parametrize("name", ["length_m", "length_sd_m", "rise_m"])
    @pytest.mark.parametrize("value", [-99.0, np.nan, np.inf, "a", [1.0, 2.0], True])
    def test_bad_numbers_of_a_leg(self, name, value):
        with pytest.raises(ValueError, match=name):
            replace(FLIGHT.legs[0], **{name: value})

    def test_a_leg_of_no_length_and_masked_readings(self):
        with pytest.raises(ValueError, match="length_m"):
            replace(FLIGHT.legs[0], length_m=0.0)
        reading = FLIGHT.legs[0].reading
        with pytest.raises(ValueError, match="reading"):
            replace(FLIGHT.legs[0], reading=np.ma.masked_greater(reading, float(np.median(reading))))

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            *[
                (n, v)
                for n in ("diffusivity_m2_s", "spread_m")
                for v in (0.0, -1.0, np.nan, "a", [1.0], (1.0, 2.0), True)
            ],
            *[(n, v) for n in ("ambient", "extent") for v in (np.nan, np.inf, "a", [1.0, 2.0])],
            *[("sensor_lag_s", v) for v in (-1.0, np.nan, "a", [1.0, 2.0])],
            *[("activation_s", v) for v in (np.nan, "x", (), [[1, 2], [3, 4]], [np.nan, 1.0], {}, ["a"], True)],
            *[("dimensions", v) for v in (1, 4, 2.0, "2", None, True, [2])],
            *[("static", v) for v in ("yes", None, 1)],
        ],
    )
    def test_bad_media(self, name, value):
        with pytest.raises(ValueError, match=name):
            Medium(**{"static": True, name: value})

    @pytest.mark.parametrize(
        ("make", "named"),
        [
            (lambda: Leg(1.0, [0.0, 1.0], [0.0, 1.0], [1.0, np.nan]), r"reading\[1\]"),
            (lambda: Leg(1.0, [0.0, 1.0], [0.0, 0.0], [1.0, 2.0]), "time_s"),
            (lambda: Leg(1.0, [0.0, 1.0], [0.0, 1.0], [1.0]), "reading"),
            (lambda: Flight((Leg(1.0, [0.0], [5.0], [1.0]), Leg(1.0, [0.0], [4.0], [1.0]))), r"legs\[1\].time_s"),
            (lambda: Medium(spread_m=1.0), "spread_m"),
        ],
    )
    def test_impossible_records_name_the_field(self, make, named):
        with pytest.raises(ValueError, match=named):
            make()

    def test_bad_flights(self):
        for legs in (None, 3, (1, 2), FLIGHT.legs[0]):
            with pytest.raises(ValueError, match="legs"):
                Flight(legs)
        with pytest.raises(ValueError, match="time_s"):
            Flight(FLIGHT.legs[::-1])
        with pytest.raises(ValueError, match="parametric"):
            Flight(parametric=3)
        for basis in (np.zeros((8, 0)), np.ones(8), np.full((8, 2), np.nan)):
            with pytest.raises(ValueError, match="basis"):
                ParametricPath(basis, np.arange(8.0), np.ones(8))
