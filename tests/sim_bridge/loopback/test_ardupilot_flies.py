"""How the loopback vehicle flies with ArduPilot's ways: corners, stops, drift, and what its navigation makes it do."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from fakes import mission

from dslam_mav.mav.frames import messages
from dslam_mav.mav.mission.suit import suited
from dslam_mav.mav.profile import profile_named
from dslam_mav.mission import e7_to_enu, with_home_item
from sim_bridge.loopback.autopilot import Autopilot
from sim_bridge.loopback.manners import manners
from sim_bridge.vehicle import DEFAULT_HOME

M = messages()
SQUARE = [(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0), (0.0, 0.0)]


def flown(items: tuple[Any, ...], feed: str = "gps") -> list[Any]:
    """The messages of one flight, by an autopilot without sockets."""
    autopilot = Autopilot(DEFAULT_HOME, manners=manners("ardupilot", feed), seed=4)
    autopilot.set_items(items)
    for name in ("LOCAL_POSITION_NED", "SIM_STATE"):
        autopilot.streams.set_interval("me", getattr(M, f"MAVLINK_MSG_ID_{name}"), 50, 0)
    autopilot.navigation.set_origin(DEFAULT_HOME, 30_000)
    autopilot.advance(60_000)
    autopilot.guided = True
    assert autopilot.arm() == ""
    autopilot.start_mission()
    return [out.message for out in autopilot.advance(125_000)]


def track(heard: list[Any]) -> np.ndarray:
    return np.array([(m.y, m.x) for m in heard if m.get_type() == "LOCAL_POSITION_NED" and m.z < -9.0])


def nearest_m(path: np.ndarray, corner: tuple[float, float]) -> float:
    return float(np.hypot(*(path - corner).T).min())


def test_corners_are_cut_without_a_hold_and_met_with_one() -> None:
    drawn = with_home_item(mission(SQUARE, speed_m_s=5.0))
    held, notes = suited(drawn, profile_named("ardupilot"), 2)
    assert notes
    cut_m, met_m = (nearest_m(track(flown(plan.items)), (40.0, 0.0)) for plan in (drawn, held))
    assert 1.5 < cut_m < 2.5
    assert met_m < 0.15


def test_it_speeds_up_stops_and_overshoots_by_one_to_three_metres() -> None:
    plan = with_home_item(mission(SQUARE, hold_s=1.0, speed_m_s=5.0))
    heard = flown(plan.items)
    assert 1.0 < track(heard)[:, 0].max() - 40.0 < 3.0
    speeds = np.array([math.hypot(m.vx, m.vy) for m in heard if m.get_type() == "LOCAL_POSITION_NED"])
    assert np.abs(np.diff(speeds)).max() < 5.0 * 0.05 * 2.0, "no jumps in speed"


def test_dead_reckoning_drifts_and_only_the_simulator_knows() -> None:
    heard = flown(with_home_item(mission(SQUARE, hold_s=1.0)).items, feed="flow")
    off_m, believed = [], None
    for m in heard:
        if m.get_type() == "LOCAL_POSITION_NED":
            believed = (m.y, m.x)
        elif m.get_type() == "SIM_STATE" and believed:
            off_m.append(math.dist(e7_to_enu(m.lat_int, m.lon_int, DEFAULT_HOME), believed))
    assert 0.5 < max(off_m) < 4.0
    assert m.get_type() in ("LOCAL_POSITION_NED", "SIM_STATE")


def test_odometry_in_other_frames_is_silently_ignored() -> None:
    autopilot = Autopilot(DEFAULT_HOME, manners=manners("ardupilot", "odometry"))
    autopilot.navigation.set_origin(DEFAULT_HOME, 30_000)
    for frames, answer in (((1, 12), "VisOdom: not healthy"), ((20, 12), "")):
        autopilot.navigation.feed(frames, (0.0, 0.0, 0.0), 0, 30_000)
        assert autopilot.navigation.why_not(30_000) == answer


@pytest.mark.parametrize(("resets", "mode"), [(0, "LAND"), (1, "MISSION")])
def test_a_place_that_jumps_lands_it_unless_a_new_reset_counter_says_so(resets: int, mode: str) -> None:
    """What every answer of `--send-odometry` must bring."""
    autopilot = Autopilot(DEFAULT_HOME, manners=manners("ardupilot", "odometry"))
    autopilot.set_items(with_home_item(mission(SQUARE, hold_s=1.0)).items)
    autopilot.navigation.set_origin(DEFAULT_HOME, 30_000)
    autopilot.advance(30_000)
    autopilot.guided = True
    for time_ms in range(30_000, 60_000, 100):
        jumped = time_ms >= 45_000
        autopilot.navigation.feed((20, 12), (6.0 * jumped, 0.0, -10.0), resets * jumped, time_ms)
        if time_ms == 30_000:
            assert autopilot.arm() == ""
            autopilot.start_mission()
        autopilot.advance(time_ms)
        if time_ms == 55_900:
            assert autopilot.mode.name == "MISSION", "11 s after"
    assert autopilot.mode.name == mode
