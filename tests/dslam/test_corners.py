"""Legs that begin beside the corner the last one ended at: drift of the dead reckoning, corners flown round."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from random_scenes import INSIDE_95, random_case

from dslam_mav import Flight, Leg, Medium, Verdict, estimate
from dslam_mav.dslam.field import field

MEDIUM = Medium(spread_m=1.0, static=True)
CORNER_SD = 0.02
SEEDS = range(12)


def _with_loose_corners(seed: int, corner_sd: float) -> tuple[Flight, np.ndarray]:
    """A scene at 40 dB, every leg but the first begun `corner_sd` off along each axis, and where its sources are."""
    case = random_case((4711, seed), 2, 40.0)
    rng = np.random.default_rng((seed, 1))
    at, legs = np.zeros(2), []
    for leg, heading in zip(case.flight.legs, case.heading_rad, strict=True):
        way = np.array([np.cos(heading), np.sin(heading)])
        clean = field(at + leg.distance_m[:, None] * way, 1.0, case.position_m, case.amplitude)
        noisy = clean + case.noise_sd * rng.standard_normal(clean.size)
        legs.append(replace(leg, reading=noisy))
        at = at + leg.length_m * way + corner_sd * rng.standard_normal(2)
    return Flight(tuple(legs)), case.position_m


def _told(flight: Flight, corner_sd_m: float) -> Flight:
    return Flight(tuple(replace(leg, corner_sd_m=corner_sd_m) for leg in flight.legs))


def _off(result, truth) -> np.ndarray:
    """(K, 2) of the answer or alternative nearest to the truth; its covariance tells what was to be expected."""
    pairs = [
        (mode.sources.position_m[list(order)] - truth, mode.position_covariance_m2[list(order)])
        for mode in (result, *result.alternatives)
        for order in permutations(range(len(truth)))
    ]
    return min(pairs, key=lambda pair: float((pair[0] ** 2).sum()))


@pytest.fixture(scope="module")
def answers():
    flights = [_with_loose_corners(seed, CORNER_SD) for seed in SEEDS]
    return [
        (estimate(flight, MEDIUM, 2), estimate(_told(flight, CORNER_SD), MEDIUM, 2), truth) for flight, truth in flights
    ]


def test_loose_corners_are_fitted_where_they_are_told_of(answers):
    errors = [[np.linalg.norm(_off(result, truth)[0]) for result in pair] for *pair, truth in answers]
    taken_as_exact, fitted = np.median(errors, axis=0)
    assert fitted < 0.7 * taken_as_exact


def test_errors_are_what_the_covariance_says(answers):
    inside = []
    for _, result, truth in answers:
        assert result.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
        off, covariance = _off(result, truth)
        inside += [d @ np.linalg.solve(c, d) < INSIDE_95 for d, c in zip(off, covariance, strict=True)]
    assert np.mean(inside) >= 0.7


def test_the_answer_names_the_corners_it_found_loose(answers):
    named = [sum(name.startswith("corner") for name in result.parameter_names) for _, result, _ in answers]
    assert set(named) <= {0, 12}
    assert named.count(12) >= 9


@pytest.mark.parametrize("overshot", [True, False])
def test_corners_flown_past_or_before_are_told_by_how_far_legs_begin_beside_their_lines(overshot):
    """The vehicle stops past every corner, on the line it came by, or leaves that before: the next leg's line passes
    there by a distance its own dead reckoning knows.
    """
    errors = []
    for seed in SEEDS:
        case = random_case((4712, seed), 2, 40.0)
        rng = np.random.default_rng((seed, 2))
        past = 0.1 if overshot else -0.1
        legs = _flown_past(case, past, rng)
        plain = Flight(tuple(replace(leg, beside_m=0.0) for leg in legs))
        errors.append([np.linalg.norm(_off(estimate(f, MEDIUM, 2), case.position_m)[0]) for f in (plain, Flight(legs))])
    isotropic, told = np.median(errors, axis=0)
    assert told < 0.6 * isotropic


def _flown_past(case, past, rng) -> tuple[Leg, ...]:
    """Legs measured from where the last one ended, `past` the corner; their lines lead from corner to corner."""
    at, legs, came = np.zeros(2), [], None
    for leg, heading in zip(case.flight.legs, case.heading_rad, strict=True):
        way = np.array([np.cos(heading), np.sin(heading)])
        before = np.zeros(2) if came is None else past * came
        begun, beside = float(before @ way), abs(float(before[0] * way[1] - before[1] * way[0]))
        length = leg.length_m + past - begun
        s = np.linspace(0.0, length, leg.distance_m.size)
        if past > 0.0:  # and back a little
            s[-3:] = length + np.array([0.06, 0.04, 0.02])
        place = at + (begun + s)[:, None] * way
        noisy = field(place, 1.0, case.position_m, case.amplitude) + case.noise_sd * rng.standard_normal(s.size)
        legs.append(
            Leg(length, s, leg.time_s, noisy, corner_sd_m=CORNER_SD, beside_m=beside, overshot_m=max(past, 0.0))
        )
        at, came = at + leg.length_m * way, way
    return tuple(legs)


def test_exact_corners_stay_exact():
    """Readings that exact corners explain are not given away to corners that might be loose."""
    for seed in range(3):
        flight, _ = _with_loose_corners(seed, 0.0)
        plain, told = estimate(flight, MEDIUM, 2), estimate(_told(flight, CORNER_SD), MEDIUM, 2)
        np.testing.assert_allclose(told.sources.position_m, plain.sources.position_m, atol=1e-3)


def test_a_vehicle_known_to_overshoot_is_not_taken_for_one_that_cuts_corners():
    case = random_case((4712, 0), 2, 40.0)
    cut = _flown_past(case, -0.1, np.random.default_rng((0, 2)))
    told = tuple(replace(leg, overshot_m=0.1) for leg in cut)
    sides = [estimate(Flight(legs), MEDIUM, 2).diagnostics["corners_loose"] for legs in (cut, told)]
    assert sides[0] < 0.0 <= sides[1]


def test_a_first_leg_flown_beside_its_ends_widens_the_frame_and_nothing_else():
    """A source owes to each end a share of what that end lies off, and to the turn of their line the rest."""
    case = random_case((4711, 0), 2, 40.0)
    first, *rest = case.flight.legs
    plain, beside = (estimate(Flight((replace(first, beside_m=off), *rest)), MEDIUM, 2) for off in (0.0, 0.05))
    assert np.array_equal(plain.sources.position_m, beside.sources.position_m)
    assert np.array_equal(plain.path_aligned_covariance_m2, beside.path_aligned_covariance_m2)
    x, y = plain.sources.position_m[0] / first.length_m
    more = beside.position_covariance_m2[0] - plain.position_covariance_m2[0]
    assert more[0, 0] == pytest.approx(0.05**2 * 2.0 * y**2), "the turn"
    assert more[1, 1] == pytest.approx(0.05**2 * ((1.0 - x) ** 2 + x**2))


def test_distances_that_drift_widen_the_frame_by_as_much_as_the_corners_are_loose():
    flight, _ = _with_loose_corners(0, CORNER_SD)
    loose = estimate(_told(flight, CORNER_SD), MEDIUM, 2)
    share = abs(loose.diagnostics["corners_loose"]) * CORNER_SD
    assert share > 0.0
    least = share**2 * (1.0 + (loose.sources.position_m[0, 0] / flight.legs[0].length_m) ** 2)
    assert loose.position_covariance_m2[0, 0, 0] > least
