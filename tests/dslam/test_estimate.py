"""estimate(): known answers, what must not change them, and the number of sources."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from changed import changed, changed_readings
from random_scenes import random_case

from dslam_mav import Leg, Medium, Verdict, estimate
from dslam_mav.dslam.align import to_canonical
from missions.patterns import star

KNOWN = Medium(spread_m=1.0, static=True)
FREE = Medium(static=True, ambient=None)


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

    plain, hovered = estimate(case.flight, KNOWN, 2), estimate(changed(case.flight, overshoot), KNOWN, 2)
    np.testing.assert_allclose(hovered.sources.position_m, plain.sources.position_m, atol=0.05)


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
        found = []
        for seed in range(6):
            case = random_case((seed, 2, 51), 2, 30.0)
            bend = 1.0 + 0.2 * seed
            flight = changed_readings(
                case.flight, lambda _, y, b=bend: y + 0.004 * b * np.ptp(y) * np.sin(np.linspace(0.0, 9.0, y.size))
            )
            found.append(len(estimate(flight, KNOWN).sources))
        assert found.count(2) >= 5  # noise alone looks like one more source in two flights of a hundred
