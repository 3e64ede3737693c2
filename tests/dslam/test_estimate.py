"""estimate(): known answers, what must not change them, and verdicts."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_scenes import random_case

from dslam_mav import Flight, Leg, Medium, Verdict, estimate
from dslam_mav.dslam.align import to_canonical
from missions.patterns import from_turns, star

KNOWN = Medium(spread_m=1.0, static=True)
FREE = Medium(static=True, ambient=None)


def _with(flight, change):
    return Flight(tuple(change(j, leg) for j, leg in enumerate(flight.legs)), closed=flight.closed)


def _readings(flight, change):
    return _with(flight, lambda j, leg: replace(leg, reading=change(j, leg.reading)))


def _by_x(result):
    return result.sources.position_m[np.argsort(result.sources.position_m[:, 0])]


@pytest.mark.parametrize("k_sources", [2, 3, 4])
def test_noiseless_readings_give_the_truth(k_sources):
    case = random_case((60, k_sources), k_sources, 200.0)
    result = estimate(case.flight, KNOWN, k_sources)
    assert result.verdict is Verdict.IDENTIFIED
    expected = case.position_m[np.argsort(-case.amplitude)]
    np.testing.assert_allclose(result.sources.position_m, expected, atol=1e-5)
    np.testing.assert_allclose(result.sources.amplitude, np.sort(case.amplitude)[::-1], rtol=1e-5)
    np.testing.assert_allclose(np.cos(result.path.heading_rad), np.cos(case.heading_rad), atol=1e-5)
    np.testing.assert_allclose(np.abs(result.residual).max(), 0.0, atol=1e-5)


@pytest.mark.parametrize(
    ("medium", "age"),
    [
        (Medium(static=True, ambient=None), None),
        (Medium(diffusivity_m2_s=0.25 / 44.8, activation_s=-44.8), 2.0),
        (Medium(diffusivity_m2_s=0.25 / 44.8, activation_s="shared", ambient=None), 2.0),
        (Medium(activation_s=-44.8, ambient=None), 2.0),
        (Medium(activation_s="shared", ambient=None), 2.0),
    ],
)
def test_what_is_unknown_of_the_medium_is_found(medium, age):
    case = random_case((71,), 2, 60.0, medium=medium, ambient=0.0, age_over_flight=age)
    if age is not None:  # the scene's own μ and τ
        duration = 22.4
        mu, tau = 0.25 / (age * duration), -age * duration
        medium = replace(
            medium,
            diffusivity_m2_s=None if medium.diffusivity_m2_s is None else mu,
            activation_s="shared" if medium.activation_s == "shared" else tau,
        )
    result = estimate(case.flight, medium, 2)
    np.testing.assert_allclose(_by_x(result), case.position_m[np.argsort(case.position_m[:, 0])], atol=0.02)
    assert result.spread_m == pytest.approx(1.0, rel=0.02)
    if age is not None:
        assert result.medium.diffusivity_m2_s == pytest.approx(0.25 / (age * 22.4), rel=0.15)
        assert result.sources.activation_s[0] == pytest.approx(-age * 22.4, rel=0.15)


def test_sources_come_strongest_first_in_the_canonical_gauge():
    result = estimate(random_case((3, 3), 3, 30.0).flight, KNOWN, 3)
    assert (np.diff(result.sources.amplitude) <= 0.0).all()
    assert result.gauge == "canonical"
    np.testing.assert_array_equal(result.path.vertices_m[0], [0.0, 0.0])
    assert result.path.heading_rad[0] == 0.0
    alignment = to_canonical(result.path.vertices_m)
    np.testing.assert_allclose(alignment.rotation, np.eye(2), atol=1e-12)
    assert result.path.vertices_m.shape == (8, 2)
    assert result.residual.shape == (448,)


def test_a_seed_repeats_bit_for_bit_and_another_finds_the_same():
    case = random_case((21,), 2, 30.0)
    one, again, other = (estimate(case.flight, FREE, 2, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.sources.position_m, again.sources.position_m)
    np.testing.assert_array_equal(one.parameter_covariance, again.parameter_covariance)
    assert len(one.alternatives) == len(again.alternatives)
    np.testing.assert_allclose(one.sources.position_m, other.sources.position_m, atol=2e-3)


@settings(max_examples=6, deadline=None)
@given(st.sampled_from([1e-12, 1e-6, 1e-2, 40.0, 1e6, 1e12]), st.sampled_from([1e-12, 1e-3, 1.0, 1e12]))
def test_units_do_not_matter(length, reading):
    case = random_case((22,), 2, 30.0)
    plain = estimate(case.flight, FREE, 2)
    scaled = _with(
        case.flight,
        lambda _, leg: Leg(leg.length_m * length, leg.distance_m * length, leg.time_s, leg.reading * reading),
    )
    result = estimate(scaled, FREE, 2)
    assert result.verdict is plain.verdict
    np.testing.assert_allclose(result.sources.position_m / length, plain.sources.position_m, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(result.noise_sd / reading, plain.noise_sd, rtol=1e-4)
    np.testing.assert_allclose(result.sources.peak_reading / reading, plain.sources.peak_reading, rtol=1e-3)


def test_a_mirrored_flight_gives_the_same_answer():
    """Nothing in the readings tells left from right, so the canonical gauge hides which was flown."""
    path = star(7, 3, 3.2)
    case = random_case((23,), 2, 30.0, vertices=path)
    mirrored = random_case((23,), 2, 30.0, vertices=path * np.array([1.0, -1.0]))
    a, b = (estimate(c.flight, KNOWN, 2) for c in (case, mirrored))
    for c, result in ((case, a), (mirrored, b)):
        expected = c.position_m[np.argsort(-c.amplitude)]
        assert np.abs(result.sources.position_m - expected).max() < 0.3


def test_more_readings_of_the_same_field_only_sharpen():
    few = random_case((24,), 2, 30.0, readings_per_leg=32)
    many = random_case((24,), 2, 30.0, readings_per_leg=512)
    coarse, fine = (estimate(c.flight, KNOWN, 2) for c in (few, many))
    assert (fine.sd_m < 0.5 * coarse.sd_m).all()
    np.testing.assert_allclose(_by_x(fine), _by_x(coarse), atol=5.0 * coarse.sd_m.max())


def test_hovering_and_overshoot_are_welcome():
    case = random_case((25,), 2, 40.0)

    def overshoot(_, leg):
        s = np.concatenate([np.full(5, leg.distance_m[0]), leg.distance_m])
        t = np.concatenate([leg.time_s[0] - 0.01 + 0.001 * np.arange(5), leg.time_s])
        return Leg(leg.length_m, s, t, np.concatenate([np.full(5, leg.reading[0]), leg.reading]))

    plain, hovered = estimate(case.flight, KNOWN, 2), estimate(_with(case.flight, overshoot), KNOWN, 2)
    np.testing.assert_allclose(hovered.sources.position_m, plain.sources.position_m, atol=0.05)


class TestVerdicts:
    def test_too_few_legs(self):
        result = estimate(Flight(random_case((1,), 2, 30.0).flight.legs[:2]), KNOWN, 2)
        assert result.verdict is Verdict.TOO_FEW_DATA
        assert "2 legs were flown" in result.reason
        assert result.sources.position_m.shape == (2, 2)
        assert np.isnan(result.sources.position_m).all()

    def test_more_sources_than_readings_can_carry(self):
        case = random_case((1,), 2, 30.0, readings_per_leg=4)
        result = estimate(Flight(case.flight.legs[:3]), KNOWN, 5)
        assert result.verdict is Verdict.TOO_FEW_DATA
        assert "12 readings cannot carry 17 unknowns" in result.reason

    def test_a_leg_without_readings(self):
        case = random_case((1,), 2, 30.0)
        empty = np.empty(0)
        flight = _with(case.flight, lambda j, leg: Leg(leg.length_m, empty, empty, empty) if j == 3 else leg)
        result = estimate(flight, KNOWN, 2)
        assert result.verdict is Verdict.TOO_FEW_DATA
        assert "Leg 4 has 0 readings" in result.reason

    def test_no_signal(self):
        flight = _readings(random_case((1,), 2, 30.0).flight, lambda _, y: np.full_like(y, 21.5))
        result = estimate(flight, FREE, 2)
        assert result.verdict is Verdict.NOT_IDENTIFIABLE
        assert "21.5" in result.reason

    def test_one_source_on_an_open_path(self):
        result = estimate(random_case((1, 1), 1, 30.0).flight, KNOWN, 1)
        assert result.verdict is Verdict.NOT_IDENTIFIABLE
        assert np.isnan(result.sources.position_m).all()
        assert np.isfinite(result.residual).all()
        assert result.unseen_directions

    def test_a_march_out_of_the_area(self):
        zigzag = from_turns(np.full(7, 3.2), np.array([1, -1, 1, -1, 1, -1]) * 0.5 * np.pi)
        case = random_case((8,), 2, 20.0, vertices=zigzag)
        assert estimate(case.flight, KNOWN, 2).verdict in (Verdict.NOT_IDENTIFIABLE, Verdict.AMBIGUOUS)

    def test_a_stuck_leg_is_no_diffusion(self):
        case = random_case((3, 2, 20), 2, 30.0)
        peak = max(leg.reading.max() for leg in case.flight.legs)
        flight = _readings(case.flight, lambda j, y: np.full_like(y, 0.7 * peak) if j in (2, 4) else y)
        result = estimate(flight, KNOWN, 2)
        assert result.verdict in (Verdict.MODEL_MISFIT, Verdict.NOT_IDENTIFIABLE)
        assert result.diagnostics["whiteness_p"] < 1e-6

    def test_a_misfit_widens_the_covariance(self):
        case = random_case((26,), 2, 40.0)
        bent = _readings(case.flight, lambda _, y: y + 0.02 * np.ptp(y) * np.sin(np.linspace(0.0, 6.0, y.size)))
        plain, off = estimate(case.flight, KNOWN, 2), estimate(bent, KNOWN, 2)
        assert off.diagnostics["whiteness_p"] < 1e-3 < plain.diagnostics["whiteness_p"]
        assert (off.sd_m > 2.0 * plain.sd_m).all()

    def test_an_ambiguous_answer_carries_its_alternatives(self):
        found = []
        for seed in range(12):
            result = estimate(random_case((seed, 2, 77), 2, 20.0).flight, KNOWN, 2)
            if result.verdict is Verdict.AMBIGUOUS:
                found.append(result)
        assert found
        for result in found:
            assert result.alternatives
            likelihoods = [e.log_likelihood for e in (result, *result.alternatives)]
            assert likelihoods[0] - min(likelihoods) < 4.6
            assert all(not e.alternatives for e in result.alternatives)

    def test_a_field_that_stands_still_has_no_age(self):
        case = random_case((33,), 2, 40.0)
        result = estimate(case.flight, Medium(activation_s="shared"), 2)
        assert result.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
        assert np.isnan(result.sources.activation_s).all()
        assert result.medium.diffusivity_m2_s is None
        assert result.spread_m == pytest.approx(1.0, rel=0.05)

    @pytest.mark.parametrize("medium", [KNOWN, FREE])
    def test_odd_readings_never_raise(self, medium):
        case = random_case((34,), 2, 30.0)
        rng = np.random.default_rng(0)
        for change in (
            lambda j, leg: replace(leg, distance_m=np.full(64, 1.0)),
            lambda j, leg: replace(leg, distance_m=leg.distance_m + (1e4 if j == 2 else 0.0)),
            lambda j, leg: replace(leg, reading=np.zeros(64)),
            lambda j, leg: replace(leg, reading=-leg.reading),
            lambda j, leg: replace(leg, reading=rng.standard_normal(64)),
            lambda j, leg: replace(leg, reading=np.where(np.arange(64) == 5, 1e3, 0.0)),
            lambda j, leg: replace(leg, reading=leg.reading * 1e200),
        ):
            result = estimate(_with(case.flight, change), medium, 2)
            assert result.reason
            assert result.residual.shape == (448,)


class TestNumberOfSources:
    @pytest.mark.parametrize("k_sources", [2, 3])
    def test_is_found(self, k_sources):
        for seed in range(3):
            result = estimate(random_case((seed, k_sources, 50), k_sources, 30.0).flight, KNOWN)
            assert len(result.sources) == k_sources

    def test_is_at_most_what_was_allowed(self):
        result = estimate(random_case((2, 3, 50), 3, 30.0).flight, KNOWN, max_sources=2)
        assert len(result.sources) <= 2

    def test_is_not_raised_by_a_small_misfit(self):
        """A shape the model does not have must not be mended by one more source, whichever side of a test it falls."""
        for seed in range(4):
            case = random_case((seed, 2, 51), 2, 30.0)
            bend = 1.0 + 0.25 * seed
            flight = _readings(
                case.flight, lambda _, y, b=bend: y + 0.004 * b * np.ptp(y) * np.sin(np.linspace(0.0, 9.0, y.size))
            )
            assert len(estimate(flight, KNOWN).sources) == 2


class TestKnownHeadings:
    @pytest.mark.parametrize("first_turn_deg", [0.0, 1.0, 2.0])
    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_tell_left_from_right_where_the_first_turn_hardly_does(self, first_turn_deg, side):
        turns = np.radians([first_turn_deg, 154.3, 154.3, 154.3, 154.3, 154.3, 154.3])
        lengths = np.array([1.6, 1.6, 3.2, 3.2, 3.2, 3.2, 3.2, 3.2])
        path = from_turns(lengths, side * turns)
        for seed in range(3):
            case = random_case((seed, 31), 2, 30.0, vertices=path)
            headings = np.concatenate([[0.0], side * np.cumsum(turns)])
            rng = np.random.default_rng(seed)
            given = headings + np.radians(3.0) * rng.standard_normal(headings.size)
            result = estimate(case.flight, KNOWN, 2, heading_prior=(given, np.radians(5.0)))
            assert result.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
            turned = np.angle(np.exp(1j * (result.path.heading_rad - headings)))
            assert np.abs(turned).max() < np.radians(15.0)

    def test_that_contradict_the_readings_are_told(self):
        case = random_case((27,), 2, 30.0)
        wrong = case.heading_rad.copy()
        wrong[3] += 1.5
        result = estimate(case.flight, KNOWN, 2, heading_prior=(wrong, 0.02))
        assert result.verdict is not Verdict.IDENTIFIED

    def test_anchor_the_answer(self):
        case = random_case((27,), 2, 30.0)
        plain = estimate(case.flight, KNOWN, 2)
        result = estimate(case.flight, KNOWN, 2, heading_prior=(case.heading_rad + 0.7, 0.02))
        assert result.gauge == "anchored"
        rotation = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
        np.testing.assert_allclose(result.sources.position_m, plain.sources.position_m @ rotation.T, atol=0.15)
        assert np.abs(np.sin(result.path.heading_rad - case.heading_rad - 0.7)).max() < 0.05

    def test_keep_left_and_right(self):
        case = random_case((27,), 2, 30.0)
        left = estimate(case.flight, KNOWN, 2, heading_prior=(case.heading_rad, 0.02))
        right = estimate(case.flight, KNOWN, 2, heading_prior=(-case.heading_rad, 0.02))
        np.testing.assert_allclose(right.sources.position_m, left.sources.position_m * [1.0, -1.0], atol=1e-6)

    def test_sharpen_the_shape_and_own_up_to_the_turn(self):
        case = random_case((28,), 3, 20.0)
        plain = estimate(case.flight, KNOWN, 3)
        sharp = estimate(case.flight, KNOWN, 3, heading_prior=(case.heading_rad, 0.003))
        loose = estimate(case.flight, KNOWN, 3, heading_prior=(case.heading_rad, 0.5))
        assert np.trace(sharp.path_aligned_covariance_m2.sum(0)) < np.trace(plain.path_aligned_covariance_m2.sum(0))
        assert loose.sd_m.max() > plain.sd_m.max()

    def test_make_one_source_identifiable(self):
        case = random_case((29,), 1, 30.0)
        result = estimate(case.flight, KNOWN, 1, heading_prior=(case.heading_rad, 0.02))
        assert result.verdict is Verdict.IDENTIFIED
        np.testing.assert_allclose(result.sources.position_m, case.position_m, atol=0.2)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"n_sources": 0}, "n_sources"),
        ({"n_sources": 9}, "n_sources"),
        ({"n_sources": 2.5}, "n_sources"),
        ({"max_sources": 0}, "max_sources"),
        ({"max_sources": 9}, "max_sources"),
        ({"method": "magic"}, "method"),
        ({"closed_sd_m": -1.0}, "closed_sd_m"),
        ({"heading_prior": (np.zeros(3), 0.1)}, "heading_prior"),
        ({"heading_prior": (np.zeros(7), 0.0)}, "heading_prior"),
        ({"heading_prior": (np.full(7, np.nan), 0.1)}, "heading_prior"),
    ],
)
def test_misuse_names_the_argument(arguments, named):
    with pytest.raises(ValueError, match=named):
        estimate(random_case((1,), 2, 30.0).flight, KNOWN, **arguments)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Leg(0.0, [0.0], [0.0], [1.0]), "length_m"),
        (lambda: Leg(1.0, [0.0, 1.0], [0.0, 1.0], [1.0, np.nan]), r"reading\[1\]"),
        (lambda: Leg(1.0, [0.0, 1.0], [0.0, 0.0], [1.0, 2.0]), "time_s"),
        (lambda: Leg(1.0, [0.0, 1.0], [0.0, 1.0], [1.0]), "reading"),
        (lambda: Flight((Leg(1.0, [0.0], [5.0], [1.0]), Leg(1.0, [0.0], [4.0], [1.0]))), r"legs\[1\].time_s"),
        (lambda: Medium(spread_m=-1.0, static=True), "spread_m"),
        (lambda: Medium(spread_m=1.0), "spread_m"),
        (lambda: estimate(Flight(()), KNOWN, 2), "flight"),
        (lambda: estimate(random_case((1,), 2, 30.0).flight, Medium(activation_s=0.0), 2), "activation_s"),
    ],
)
def test_impossible_records_name_the_field(make, named):
    with pytest.raises(ValueError, match=named):
        make()
