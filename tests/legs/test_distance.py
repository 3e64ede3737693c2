"""How far along its leg the vehicle was: whatever the frame, whatever was heard."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.legs.distance import Motion, from_odometry, from_speed, from_velocity, place


def motion(time_s, along_m, speed_m_s, angle_rad=0.7):
    way = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    t, v = np.asarray(time_s), np.asarray(speed_m_s)
    return Motion(t, np.outer(along_m, way) + 5.0, np.outer(v, way), t, np.abs(v))


def test_overshoot_and_return_are_signed_but_ground_speed_is_not():
    t = np.arange(0.0, 13.01, 0.1)
    v = np.where(t <= 11.0, 1.0, -0.5)  # flies 11 m, comes back by 1 m
    s = np.where(t <= 11.0, t, 11.0 - 0.5 * (t - 11.0))
    m = motion(t, s, v)
    for placed in (from_odometry(m, 13.0, t), from_velocity(m, 13.0, t)):
        assert placed.length_m == pytest.approx(10.0, abs=0.1)
        assert placed.distance_m == pytest.approx(s, abs=0.1)
        assert placed.distance_m.max() > placed.length_m + 0.9
    assert from_speed(m, 13.0, t).length_m == pytest.approx(12.0, abs=0.1)


def test_sparse_dead_reckoning_is_bridged_by_its_velocities():
    """5 samples a second, braking at 2 m/s²: cubic interpolation is exact, straight lines are not."""
    t = np.arange(0.0, 5.01, 0.5)
    fine = np.arange(0.0, 5.0, 0.01)
    position = lambda x: 10.0 * x - x**2  # noqa: E731
    m = motion(t, position(t), 10.0 - 2.0 * t)
    placed = from_odometry(m, 5.0, fine)
    assert placed.distance_m == pytest.approx(position(fine), abs=1e-9)
    assert np.abs(np.interp(fine, t, position(t)) - position(fine)).max() > 0.05


def test_samples_that_miss_the_leg_by_much_do_not_measure_it():
    t = np.arange(3.0, 10.0, 0.1)
    m = motion(t, t, np.ones(t.size))
    at = np.array([5.0])
    assert place(m, 10.0, at, mode=None, planned_m=None) is None
    assert place(motion(t - 2.0, t, np.ones(t.size)), 8.0, at, mode=None, planned_m=None).length_m == pytest.approx(8.0)


@settings(max_examples=60, deadline=None)
@given(
    st.floats(-7.0, 7.0),
    st.booleans(),
    st.floats(-100.0, 100.0),
    st.floats(-100.0, 100.0),
    st.integers(0, 99),
)
def test_turned_mirrored_and_shifted_frames_tell_the_same_distance(angle, mirror, dx, dy, seed):
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 10.0, 0.2)
    track = np.cumsum(rng.normal([0.6, 0.2], 0.2, (t.size, 2)), axis=0)
    velocity = np.gradient(track, t, axis=0)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    turn = turn @ np.diag([1.0, -1.0]) if mirror else turn
    at = np.linspace(0.1, 9.7, 50)
    speed = np.hypot(*velocity.T)
    a = Motion(t, track, velocity, t, speed)
    b = Motion(t, track @ turn.T + [dx, dy], velocity @ turn.T, t, speed)
    for measure in (from_odometry, from_velocity):
        p, q = measure(a, 9.75, at), measure(b, 9.75, at)
        assert p.distance_m == pytest.approx(q.distance_m, abs=1e-9)
        assert p.length_m == pytest.approx(q.length_m, abs=1e-9)


def test_a_corner_flown_round_is_set_aside_and_the_leg_measured_along_its_line():
    """Out of the corner 1.5 m sideways: the line flown after it is longer than its part of the chord says."""
    t = np.arange(0.0, 40.01, 0.1)
    sideways = 1.5 * np.exp(-t / 2.0)
    along, across = np.array([math.cos(0.7), math.sin(0.7)]), np.array([-math.sin(0.7), math.cos(0.7)])
    place_m = np.outer(t, along) + np.outer(sideways, across)
    velocity = np.outer(np.ones(t.size), along) + np.outer(-0.5 * sideways, across)
    placed = from_odometry(Motion(t, place_m, velocity, t, np.ones(t.size)), 40.0, t)
    assert not placed.straight[t < 1.0].any()
    assert placed.straight[t > 10.0].all()
    assert placed.distance_m[placed.straight] == pytest.approx(t[placed.straight], abs=0.01)
