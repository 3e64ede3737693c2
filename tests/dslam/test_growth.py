"""Information leg by leg: it ends where the estimate's own covariance is, never falls, and knows what is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import random_case

from dslam_mav.dslam.estimator import estimate
from dslam_mav.dslam.growth import growth, path_sd_m
from dslam_mav.records import Medium


def flown(k=2, **settings):
    """A star over K sources at 25 dB, the medium as an estimator is told it, and the estimate."""
    case = random_case((77, k), k, 25.0, **settings)
    return case.flight, case.medium, estimate(case.flight, case.medium, k)


def test_it_ends_at_the_estimates_own_covariance_and_never_falls():
    flight, medium, found = flown()
    grown = growth(flight, found, medium)
    assert grown is not None
    # the result's own covariance is the bound, widened where the model bends
    assert grown.source_sd_m[-1] == pytest.approx(found.sd_m, rel=0.1)
    assert (grown.source_sd_m[-1] <= found.sd_m * 1.001).all()
    assert grown.path_sd_m[-1] == pytest.approx(path_sd_m(found), rel=0.1)
    assert np.isinf(grown.source_sd_m[1]).all(), "two legs place nothing"
    finite = np.isfinite(grown.source_sd_m).all(axis=1)
    assert finite[3:].all()
    assert (np.diff(grown.source_sd_m[finite], axis=0) <= 1e-9).all()


def test_the_bound_of_the_first_legs_is_what_they_alone_would_give():
    flight, medium, found = flown()
    grown = growth(flight, found, medium)
    first = replace(flight, legs=flight.legs[:4])
    alone = estimate(first, medium, 2)
    assert grown is not None
    assert grown.source_sd_m[3] == pytest.approx(alone.sd_m, rel=0.35)


@pytest.mark.parametrize("readings", [64, 4096])
def test_readings_in_number_count_by_their_root(readings):
    flight, medium, found = flown(readings_per_leg=readings)
    grown = growth(flight, replace(found, noise_sd=1.0), medium)
    few = flown()
    base = growth(few[0], replace(few[2], noise_sd=1.0), medium)
    assert grown is not None
    assert base is not None
    assert grown.source_sd_m[-1] * np.sqrt(readings / 64) == pytest.approx(base.source_sd_m[-1], rel=0.15)


def test_what_is_not_known_of_the_medium_costs():
    flight, medium, found = flown()
    known = growth(flight, found, medium)
    open_level = growth(flight, found, replace(medium, ambient=None))
    compass = growth(flight, found, medium, heading_sd_rad=0.001)
    assert known is not None
    assert open_level is not None
    assert compass is not None
    assert (open_level.source_sd_m[-1] > known.source_sd_m[-1]).all()
    assert compass.path_sd_m[-1] < 0.2 * known.path_sd_m[-1]
    assert np.isfinite(compass.source_sd_m[1]).all(), "with a compass two legs do"


def test_an_anchored_answer_grows_as_a_canonical_one():
    """Turned, shifted and mirrored, it is the same flight."""
    flight, medium, found = flown()
    turn = np.array([[0.6, 0.8], [0.8, -0.6]])
    moved = replace(
        found,
        sources=replace(found.sources, position_m=found.sources.position_m @ turn.T + [40.0, -7.0]),
        path=type(found.path)(
            found.path.vertices_m @ turn.T + [40.0, -7.0], np.arctan2(0.8, 0.6) - found.path.heading_rad
        ),
        gauge="anchored",
    )
    here, there = growth(flight, found, medium), growth(flight, moved, medium)
    assert here is not None
    assert there is not None
    assert there.source_sd_m[-1] == pytest.approx(here.source_sd_m[-1], rel=1e-6)
    assert path_sd_m(moved) == pytest.approx(path_sd_m(found), rel=1e-9)


@pytest.mark.parametrize(("closed", "heading_sd_rad"), [(True, None), (False, 0.05), (True, 0.05)])
def test_what_is_known_besides_makes_no_leg_worse(closed, heading_sd_rad):
    flight, medium, found = flown(k=3)
    grown = growth(replace(flight, closed=closed), found, medium, heading_sd_rad)
    free = growth(flight, found, medium)
    assert grown is not None
    assert free is not None
    finite = np.isfinite(grown.source_sd_m).all(axis=1)
    assert (np.diff(grown.source_sd_m[finite], axis=0) <= 1e-9).all()
    assert (grown.source_sd_m[-1] < free.source_sd_m[-1]).all()
    if heading_sd_rad is None:
        assert grown.source_sd_m[3] == pytest.approx(free.source_sd_m[3]), "a path closes with its last leg"


def test_nothing_grows_without_positions():
    flight, medium, found = flown(k=1)
    assert not np.isfinite(found.sources.position_m).all()
    assert growth(flight, found, medium) is None
    assert np.isnan(path_sd_m(found))


@pytest.mark.parametrize(
    "broken",
    [
        {"noise_sd": 0.0},
        {"noise_sd": 1e-300},
        {"noise_sd": float("nan")},
        {"peak_reading": [0.0, 1.0]},
        {"amplitude": [-1.0, 1.0]},
        {"amplitude": [1e300, 1.0]},
        {"peak_reading": [1e-300, 1.0]},
    ],
)
def test_numbers_that_make_no_sense_are_no_failure(broken):
    flight, medium, found = flown()
    of_sources = {name: np.array(value) for name, value in broken.items() if name != "noise_sd"}
    odd = replace(found, sources=replace(found.sources, **of_sources))
    odd = replace(odd, noise_sd=broken.get("noise_sd", found.noise_sd))
    grown = growth(flight, odd, medium)
    assert grown is None or not np.isnan(grown.source_sd_m).any()


def test_a_field_that_evolves_and_a_spread_that_is_found_are_bounded_too():
    flight, medium, found = flown(k=3, age_over_flight=2.0, medium=Medium(static=False))
    grown = growth(flight, found, medium)
    assert grown is not None
    assert grown.source_sd_m[-1] == pytest.approx(found.sd_m, rel=0.3)


def test_sources_whose_shape_is_found_too_are_bounded():
    flight, medium, found = flown(k=3)
    shaped = replace(
        found,
        parameter_names=(*found.parameter_names, "extent"),
        parameter_covariance=np.pad(found.parameter_covariance, (0, 1)),
    )
    plain, freed = growth(flight, found, medium), growth(flight, shaped, medium)
    assert plain is not None
    assert freed is not None
    assert (freed.source_sd_m[-1] >= plain.source_sd_m[-1]).all()
    assert freed.source_sd_m[-1].min() > 1.1 * plain.source_sd_m[-1].min()


@pytest.mark.parametrize("told", [("corner",), ("length",), ("corner", "length")])
def test_legs_that_are_not_exact_leave_as_much_unknown_as_the_answer_says(told):
    """Gaps between legs, and lengths, are unknowns; readings shifted along their legs are what exact ones cannot be."""
    flight, medium, exact = flown(k=2)
    off = np.random.default_rng(5).normal(0.0, 0.06, len(flight.legs))
    sds = {f"{name}_sd_m": 0.05 / len(told) for name in told}
    legs = (replace(leg, distance_m=leg.distance_m + m, **sds) for leg, m in zip(flight.legs, off, strict=True))
    loose = replace(flight, legs=tuple(legs))
    found = estimate(loose, medium, 2)
    assert {name.split()[0] for name in found.parameter_names} >= set(told)
    grown, as_exact = growth(loose, found, medium), growth(flight, exact, medium)
    assert grown is not None
    assert as_exact is not None
    assert grown.source_sd_m[-1] == pytest.approx(found.sd_m, rel=0.1)
    assert grown.path_sd_m[-1] == pytest.approx(path_sd_m(found), rel=0.1)
    assert (grown.source_sd_m[-1] > 1.2 * as_exact.source_sd_m[-1]).all()
    finite = np.isfinite(grown.source_sd_m).all(axis=1)
    assert finite[3:].all()
    assert (np.diff(grown.source_sd_m[finite], axis=0) <= 1e-9).all()


def test_an_answer_with_exact_corners_grows_with_exact_corners():
    """Corners that might be loose, but were found exact, are no unknowns of the answer."""
    flight, medium, _ = flown(k=2)
    told = replace(flight, legs=tuple(replace(leg, corner_sd_m=0.02) for leg in flight.legs))
    found = estimate(told, medium, 2)
    assert not any(name.startswith("corner") for name in found.parameter_names)
    grown = growth(told, found, medium)
    assert grown is not None
    assert grown.source_sd_m[-1] == pytest.approx(found.sd_m, rel=0.1)
