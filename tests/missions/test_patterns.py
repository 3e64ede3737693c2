"""The named patterns are the shapes they are called by."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.errors import BadInputError
from missions.patterns import PATTERN_NAMES, pattern, star

LEG_M = st.floats(0.5, 500.0)
HEADING = st.floats(-math.pi, math.pi)


def legs_of(vertices):
    step = np.diff(vertices, axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    turns = (np.diff(heading) + math.pi) % (2 * math.pi) - math.pi
    return np.hypot(*step.T), heading, turns


@st.composite
def stars(draw):
    n = draw(st.integers(3, 15))
    k = draw(st.sampled_from([k for k in range(1, (n + 1) // 2) if math.gcd(n, k) == 1]))
    return n, k


@settings(deadline=None)
@given(stars(), LEG_M, HEADING)
def test_a_star_is_closed_with_equal_legs_and_turns(nk, leg_m, heading_rad):
    n, k = nk
    vertices = star(n, k, leg_m, heading_rad=heading_rad)
    lengths, headings, turns = legs_of(vertices)
    assert len(lengths) == n
    assert np.allclose(lengths, leg_m, rtol=1e-12)
    assert np.allclose(turns, 2 * math.pi * k / n, atol=1e-9)
    assert np.allclose(vertices[-1], vertices[0], atol=1e-10 * leg_m)
    assert math.cos(headings[0] - heading_rad) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(("n", "k"), [(6, 2), (4, 2), (7, 0), (2, 1), (7, 4)])
def test_what_is_no_single_star_is_refused(n, k):
    with pytest.raises(ValueError, match="star"):
        star(n, k, 1.0)


@pytest.mark.parametrize(
    ("name", "n", "turn_deg"),
    [("star7", 7, 360 * 3 / 7), ("star5", 5, 144), ("triangle", 3, 120), ("square", 4, 90)],
)
def test_named_polygons(name, n, turn_deg):
    vertices = pattern(name, 40.0)
    lengths, _, turns = legs_of(vertices)
    assert len(lengths) == n
    assert np.allclose(np.rad2deg(turns), turn_deg)
    assert np.allclose(lengths, 40.0)
    assert np.linalg.norm(vertices[-1] - vertices[0]) < 1e-9


def test_more_legs_fly_a_closed_pattern_again():
    twice = pattern("square", 10.0, legs=8)
    assert np.allclose(twice[4:], twice[:5], atol=1e-12)


def test_lawnmower_goes_to_and_fro_in_lanes_a_third_apart():
    vertices = pattern("lawnmower", 30.0)
    lengths, headings, _ = legs_of(vertices)
    assert np.allclose(lengths, [30, 10, 30, 10, 30, 10, 30])
    assert np.allclose(np.cos(headings[::2]), [1, -1, 1, -1])
    assert np.allclose(vertices[-1], [0, 30])
    assert vertices[:, 0].min() > -1e-9


def test_spiral_narrows_and_never_meets_itself():
    vertices = pattern("spiral", 40.0)
    lengths, _, turns = legs_of(vertices)
    assert np.allclose(lengths, [40, 40, 30, 30, 20, 20, 10])
    assert np.allclose(turns, math.pi / 2)
    gaps = [np.linalg.norm(a - b) for i, a in enumerate(vertices) for j, b in enumerate(vertices) if abs(i - j) > 1]
    assert min(gaps) > 9.0


@settings(deadline=None)
@given(st.integers(0, 2**32), LEG_M)
def test_random_turns_lie_between_30_and_150_degrees(seed, leg_m):
    lengths, _, turns = legs_of(pattern("random", leg_m, rng=np.random.default_rng(seed)))
    assert len(lengths) == 7
    assert np.allclose(lengths, leg_m)
    assert ((np.abs(np.rad2deg(turns)) >= 30 - 1e-6) & (np.abs(np.rad2deg(turns)) <= 150 + 1e-6)).all()


def test_random_repeats_with_its_seed_and_turns_both_ways():
    def drawn(seed):
        return pattern("random", 10.0, legs=40, rng=np.random.default_rng(seed))

    assert np.array_equal(drawn(3), drawn(3))
    assert not np.array_equal(drawn(3), drawn(4))
    turns = legs_of(drawn(3))[2]
    assert (turns > 0).any()
    assert (turns < 0).any()


@pytest.mark.parametrize("name", PATTERN_NAMES)
@settings(deadline=None)
@given(heading_rad=HEADING)
def test_every_pattern_begins_at_the_origin_or_is_centred(name, heading_rad):
    path = pattern(name, 20.0, heading_rad=heading_rad)
    assert np.array_equal(path[0], [0.0, 0.0])
    assert math.cos(legs_of(path)[1][0] - heading_rad) == pytest.approx(1.0)
    centred = pattern(name, 20.0, heading_rad=heading_rad, centre_m=(5.0, -7.0))
    assert np.allclose(0.5 * (centred.min(axis=0) + centred.max(axis=0)), [5.0, -7.0])
    assert np.allclose(np.diff(centred, axis=0), np.diff(path, axis=0))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"name": "star9", "leg_m": 1.0}, ["star9", *PATTERN_NAMES]),
        ({"name": "star7", "leg_m": 0.0}, ["leg length 0 m", "0.1"]),
        ({"name": "star7", "leg_m": -3.0}, ["-3"]),
        ({"name": "star7", "leg_m": math.nan}, ["nan"]),
        ({"name": "star7", "leg_m": 1e6}, ["1e+06", "5000"]),
        ({"name": "star7", "leg_m": 10.0, "legs": 0}, ["legs 0"]),
        ({"name": "star7", "leg_m": 10.0, "legs": 10**9}, ["legs 1000000000", "500"]),
        ({"name": "star7", "leg_m": 10.0, "heading_rad": math.inf}, ["heading inf"]),
        ({"name": "star7", "leg_m": 10.0, "centre_m": (math.nan, 0.0)}, ["centre nan"]),
        ({"name": "spiral", "leg_m": 1.0, "legs": 100}, ["legs 100", "spiral"]),
    ],
)
def test_bad_values_are_refused_in_one_line(arguments, words):
    with pytest.raises(BadInputError) as caught:
        pattern(**arguments)
    message = str(caught.value)
    assert "\n" not in message
    assert all(word in message for word in words)
