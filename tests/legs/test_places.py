"""Corners found in a track of places."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.legs.places import passes, straight_pieces

CORNERS = np.array([[0.0, 0.0], [30.0, 2.0], [5.0, 24.0], [9.0, -12.0], [33.0, 20.0]])


def track(corners: np.ndarray, per_leg: int = 40, hold: int = 0) -> np.ndarray:
    """Places along straight legs, `hold` more at each corner."""
    share = np.linspace(0.0, 1.0, per_leg, endpoint=False)[:, None]
    parts = [np.vstack([np.repeat(a[None], hold, 0), a + share * (b - a)])
             for a, b in pairwise(corners)]  # fmt: skip
    return np.vstack([*parts, corners[-1:]])


@settings(max_examples=30, deadline=None)
@given(st.floats(-3.2, 3.2), st.floats(-1e4, 1e4), st.booleans(), st.integers(0, 9))
def test_the_corners_are_found_whichever_way_the_track_lies(turn, shift, mirrored, hold):
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    place_m = track(CORNERS, hold=hold) * [1.0, -1.0 if mirrored else 1.0] @ rotation + shift
    found = straight_pieces(place_m)
    np.testing.assert_allclose(place_m[found], place_m[[0, *np.arange(1, 5) * (40 + hold)]], atol=1e-6)


def test_noise_and_wobble_make_no_corners():
    rng = np.random.default_rng(1)
    place_m = track(CORNERS) + 0.3 * rng.standard_normal((161, 2))
    found = straight_pieces(place_m)
    assert len(found) == 5
    assert np.linalg.norm(place_m[found] - CORNERS, axis=1).max() < 2.0


def test_there_and_back_is_two_legs_and_standing_still_is_one():
    place_m = track(np.array([[0.0, 0.0], [20.0, 0.0], [0.0, 0.0]]))
    assert straight_pieces(place_m).tolist() == [0, 40, 80]
    assert straight_pieces(np.zeros((9, 2))).tolist() == [0, 8]


def test_a_plan_crossed_many_times_is_passed_in_its_order():
    corners, off_m = passes(track(CORNERS, hold=3), CORNERS)
    assert (np.diff(corners) > 0).all()
    np.testing.assert_allclose(off_m, 0.0, atol=1e-9)
    there = passes(track(CORNERS), CORNERS + np.array([0.0, 2.0]))[1]
    assert there.max() <= 2.0
