"""Known headings: they anchor the answer, tell left from right, and are told when they contradict the readings."""

from __future__ import annotations

import numpy as np
import pytest
from random_scenes import random_case

from dslam_mav import Medium, Verdict, estimate
from missions.patterns import from_turns

KNOWN = Medium(spread_m=1.0, static=True)


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
