"""Corners flown round are told from the straight part of a leg, by scalars that know no frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dslam_mav.legs.straight import straight_part

ALONG = np.linspace(0.0, 40.0, 400)


def leg_with_corner(slope: float, swing_m: float) -> np.ndarray:
    """Across the chord: a line of this slope, and out of the first corner a swing that dies away within 6 m."""
    return slope * (ALONG - 20.0) + swing_m * np.exp(-ALONG / 2.0)


@given(st.floats(-0.03, 0.03), st.floats(1.0, 4.0), st.sampled_from([1.0, -1.0]))
def test_the_line_is_that_of_the_straight_part(slope, swing_m, side):
    offset_m, found, straight = straight_part(ALONG, side * leg_with_corner(slope, swing_m), 40.0)
    assert abs(found - side * slope) < 2e-3
    assert abs(offset_m + side * slope * 20.0) < 0.05
    assert not straight[ALONG < 1.0].any()
    assert straight[ALONG > 10.0].all()


@given(st.floats(-0.03, 0.03), st.floats(0.0, 4.0))
def test_mirrored_it_is_the_same_to_the_last_bit(slope, swing_m):
    across = leg_with_corner(slope, swing_m)
    *line, straight = straight_part(ALONG, across, 40.0)
    *mirrored, also = straight_part(ALONG, -across, 40.0)
    assert [-each for each in mirrored] == line
    assert np.array_equal(straight, also)


def test_readings_of_a_vehicle_that_turns_on_the_spot_do_not_outweigh_its_way():
    """A rover stands and turns at the corner for longer than it drives, 1.8 m beside where it came from."""
    standing = np.zeros(600)
    along = np.concatenate([standing, ALONG])
    across = np.concatenate([np.linspace(0.0, 1.8, 600), leg_with_corner(-0.03, 0.0) + 1.2])
    offset_m, slope, straight = straight_part(along, across, 40.0)
    assert (offset_m, slope) == pytest.approx((1.8, -0.03), abs=1e-3)
    assert straight[600:].all()
    assert not straight[:500].any()


def test_a_straight_leg_and_an_unsteady_one_keep_all_readings():
    assert straight_part(ALONG, np.zeros(400), 40.0)[2].all()
    swaying = 1.5 * np.sin(ALONG)
    assert straight_part(ALONG, swaying, 40.0)[2].all()


def test_hardly_any_readings_are_a_leg_all_the_same():
    for n in (0, 1, 2):
        offset_m, slope, straight = straight_part(ALONG[:n], np.zeros(n), 40.0)
        assert offset_m == slope == 0.0
        assert straight.shape == (n,)
        assert straight.all()
