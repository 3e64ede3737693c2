"""What is proposed after a leg: that it serves, that frames do not matter, and when it is enough."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_scenes import random_case

from dslam_mav import Flight, Medium
from dslam_mav.dslam.belief import Belief, believed, noise_of
from dslam_mav.dslam.expected import Sensing, errors_on
from dslam_mav.dslam.known import Known
from dslam_mav.dslam.layouts import Layouts, Prior, Region, drawn
from dslam_mav.dslam.path import vertices
from missions.adviser import Adviser, Assumed, _as_seen, canonical_box
from missions.fence import Fence, box
from missions.next_legs import Flown, Limits, next_legs
from missions.patterns import star
from missions.telling_apart import Answers

KNOWN = Medium(spread_m=1.0, static=True)
STAR = star(7, 3, 3.2)
LOW, HIGH = canonical_box(STAR)
PRIOR = Known(2, Region(tuple(LOW), tuple(HIGH)), (1.0, 1.0))
SENSING = Sensing(0.05, 20.0)


def first(flight: Flight, n_legs: int) -> Flight:
    return Flight(flight.legs[:n_legs])


def layouts(count: int, k_sources: int = 2) -> Layouts:
    prior = Prior((k_sources, k_sources), (1.0, 1.0), PRIOR.region)
    return drawn(prior, count, np.random.default_rng(5))[0]


def flown(count: int, n_legs: int = 2) -> Flown:
    path = star(5, 2, 4.48)[: n_legs + 1]
    return Flown(np.repeat(path[None], count, axis=0), layouts(count))


def path_after(path: np.ndarray, turn_rad: tuple[float, ...], length_m: tuple[float, ...]) -> np.ndarray:
    step = path[-1] - path[-2]
    heading = math.atan2(step[1], step[0]) + np.cumsum(turn_rad)
    return np.vstack([path, path[-1] + vertices(heading, np.array(length_m))[1:]])


def test_the_truth_is_among_what_is_believed_and_gains_weight_leg_by_leg() -> None:
    case = random_case((31, 2), 2, 30.0)
    rng, belief, near = np.random.default_rng(0), None, []
    for n_legs in range(1, 5):
        belief = believed(first(case.flight, n_legs), PRIOR, rng, belief)
        off = np.linalg.norm(belief.layouts.places[:, :, None] - case.position_m[None, None], axis=3)
        near.append(float(belief.weight[(off.min(axis=1) < 0.3).all(axis=1)].sum()))
        assert belief.vertices_m.shape[1:] == (n_legs + 1, 2)
        np.testing.assert_allclose(belief.vertices_m[:, 1, 1], 0.0, atol=1e-12)
        assert n_legs == 1 or (belief.vertices_m[:, 2, 1] >= 0.0).all()  # the first turn is to +y
    assert near[0] < 0.3
    assert near[-1] > 0.7


def test_noise_is_told_without_a_model() -> None:
    for snr_db in (20.0, 40.0):
        case = random_case((32, int(snr_db)), 3, snr_db)
        assert 0.7 < noise_of(case.flight) / case.noise_sd < 1.4


def test_the_rest_serves_those_believed_in_better_than_a_stars() -> None:
    one = flown(1)
    one = Flown(np.repeat(one.vertices_m, 12, axis=0), one.layouts.chosen(np.zeros(12, np.int64)))
    left = 3 * 4.48
    proposal = next_legs(one, SENSING, Limits(left), np.random.default_rng(1))
    assert sum(proposal.length_m) == pytest.approx(left)
    own = path_after(one.vertices_m[0], proposal.turn_rad, proposal.length_m)
    error = errors_on(own, one.layouts.part(0, 1), SENSING).source[0]
    assert error < 0.8 * errors_on(star(5, 2, 4.48), one.layouts.part(0, 1), SENSING).source[0]


@settings(max_examples=5, deadline=None)
@given(angle=st.floats(0.1, 6.0), east_m=st.floats(-50.0, 50.0), seed=st.integers(0, 3))
def test_a_proposal_does_not_know_where_north_is_or_where_it_is(angle: float, east_m: float, seed: int) -> None:
    """Every draw may be in a frame of its own: only turns and lengths from the leg just flown mean anything."""
    one = flown(8)
    turned = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])

    def moved(points: np.ndarray) -> np.ndarray:
        half = len(points) // 2
        return np.concatenate([points[:half], points[half:] @ turned.T + (east_m, 3.0)])

    other = Flown(moved(one.vertices_m), replace(one.layouts, places=moved(one.layouts.places)))
    a, b = (next_legs(f, SENSING, Limits(9.0), np.random.default_rng(seed)) for f in (one, other))
    assert a.log_error == pytest.approx(b.log_error, abs=0.02)
    np.testing.assert_allclose(a.turn_rad, b.turn_rad, atol=0.05)
    np.testing.assert_allclose(a.length_m, b.length_m, atol=0.1)


def test_what_is_expected_of_legs_is_the_same_in_a_mirror() -> None:
    one = flown(10, 3)
    mirror = np.array([1.0, -1.0])
    other = Answers.of(one.vertices_m * mirror, replace(one.layouts, places=one.layouts.places * mirror))
    turn, length = np.array([2.4, -1.9]), np.array([3.0, 4.0])
    here = Answers.of(one.vertices_m, one.layouts).confusion_m2(turn, length, SENSING)
    there = other.confusion_m2(-turn, length, SENSING)
    np.testing.assert_allclose(here, there, rtol=0.05, atol=1e-6)


def test_turn_limits_shortest_leg_and_fence_are_kept() -> None:
    limits = Limits(
        11.0, turn_rad=(math.radians(60.0), math.radians(120.0)), least_leg_m=1.5, fence=Fence((box((12.0, 12.0)),))
    )
    proposal = next_legs(flown(10), SENSING, limits, np.random.default_rng(2))
    turns = np.abs(proposal.turn_rad)
    assert (turns >= math.radians(60.0) - 1e-9).all()
    assert (turns <= math.radians(120.0) + 1e-9).all()
    assert min(proposal.length_m) >= 1.5 - 1e-9
    path = path_after(np.array([[-1.0, 0.0], [0.0, 0.0]]), proposal.turn_rad, proposal.length_m)
    assert limits.fence.lets_pass(path[1:])


def test_legs_that_tell_alternatives_apart_leave_less_confusion() -> None:
    """Two answers, alike but for a source that only one of them has on the left."""
    place = np.array([[[2.0, 1.0], [3.0, -1.0]], [[2.0, 1.0], [3.0, 1.0]]])
    pair = Layouts(place, np.ones((2, 2)), np.ones(2), np.zeros(2))
    path = np.repeat(np.array([[[0.0, 0.0], [5.0, 0.0]]]), 2, axis=0)
    answers = Answers.of(path, pair)
    away = answers.confusion_m2(np.array([0.0]), np.array([4.0]), SENSING)
    through = answers.confusion_m2(np.array([2.8]), np.array([6.0]), SENSING)
    assert (through < 0.01 * away).all()


def test_a_rival_counts_though_it_cannot_be_true() -> None:
    place = np.array([[[2.0, 1.0], [3.0, -1.0]], [[2.0, 1.0], [3.0, 1.0]]])
    pair = Layouts(place, np.ones((2, 2)), np.ones(2), np.zeros(2))
    path = np.repeat(np.array([[[0.0, 0.0], [5.0, 0.0]]]), 2, axis=0)
    away = (np.array([0.0]), np.array([4.0]), SENSING)
    true = Answers.of(path[:1], pair.part(0, 1))
    assert true.confusion_m2(*away)[0] == 0.0
    both = true.beside(Answers.of(path[1:], pair.part(1, 2))).confusion_m2(*away)
    assert both.shape == (1,)
    assert both[0] == pytest.approx(Answers.of(path, pair).confusion_m2(*away)[0])
    assert both[0] > 0.5


def test_it_is_enough_when_every_source_is_as_sure_as_wanted_and_not_before() -> None:
    case = random_case((33, 2), 2, 40.0)
    for target_sd_m, n_legs, reached in ((0.1, 7, True), (1e-6, 7, False), (0.1, 2, False)):
        adviser = Adviser(Assumed(KNOWN, 2, PRIOR), target_sd_m=target_sd_m)
        advice = adviser.advise(first(case.flight, n_legs), Limits(8.0))
        assert advice.reached is reached
        assert (advice.length_m == ()) is reached


def test_the_first_turn_of_all_is_to_the_side_that_the_gauge_calls_left() -> None:
    case = random_case((34, 2), 2, 20.0)
    advice = Adviser(Assumed(KNOWN, 2, PRIOR)).advise(first(case.flight, 1), Limits(19.2))
    assert advice.turn_rad[0] > 0.0
    assert advice.estimate is None


def test_number_of_sources_spread_and_ambient_may_be_unknown() -> None:
    case = random_case((35, 2), 2, 30.0, ambient=20.0)
    prior = replace(PRIOR, k_sources=3, spread_m=(0.6, 1.6), ambient=None)
    adviser = Adviser(Assumed(Medium(static=True, ambient=None), None, prior))
    for n_legs in (1, 2, 3, 4):
        advice = adviser.advise(first(case.flight, n_legs), Limits(3.2 * (7 - n_legs)))
        assert sum(advice.length_m) == pytest.approx(3.2 * (7 - n_legs))
        assert np.isfinite(advice.expected_m)


def test_what_may_be_true_keeps_to_what_is_known() -> None:
    """Sources in the region, apart and not too unequal; turns as told, which the readings of three legs leave open."""
    case = random_case((37, 3), 3, 20.0)
    known, turn = replace(PRIOR, k_sources=3), 6.0 * math.pi / 7.0
    told, open_ = (
        believed(first(case.flight, 3), known, np.random.default_rng(0), turn_rad=turns)
        for turns in ((turn, turn), None)
    )
    one, other = (belief.part(200, np.random.default_rng(1)) for belief in (told, open_))
    low, high = LOW - 0.15 * (HIGH - LOW), HIGH + 0.15 * (HIGH - LOW)
    assert ((one.layouts.places > low) & (one.layouts.places < high)).all(axis=(1, 2)).mean() > 0.9
    assert (np.ptp(np.log(one.layouts.peak), axis=1) < math.log(8.0)).mean() > 0.9

    def off(belief: Belief) -> float:
        bent = np.remainder(np.diff(belief.chains.theta, axis=1) - turn + math.pi, 2.0 * math.pi) - math.pi
        return float((np.abs(bent).max(axis=1) < math.radians(30.0)).mean())

    assert off(one) > 0.9
    assert off(other) < 0.5
    assert off(told.rivals(200, np.random.default_rng(1))) < 0.5


def test_a_slow_sensor_and_a_drifting_level_are_allowed_for() -> None:
    case = random_case((33, 2), 2, 30.0)
    known = replace(KNOWN, sensor_lag_s=0.15, ambient_drift_per_s=0.4)
    slow = tuple(
        replace(leg, distance_m=leg.distance_m + 0.15, reading=leg.reading + 0.4 * leg.time_s)
        for leg in first(case.flight, 2).legs
    )
    for fast, allowed in zip(case.flight.legs, _as_seen(Flight(slow), known).legs, strict=False):
        np.testing.assert_allclose(allowed.distance_m, fast.distance_m, atol=1e-9)
        np.testing.assert_allclose(allowed.reading, fast.reading, atol=1e-9)
    advice = Adviser(Assumed(known, 2, PRIOR)).advise(Flight(slow), Limits(12.8))
    assert sum(advice.length_m) == pytest.approx(12.8)
