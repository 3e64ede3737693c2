"""Places on the ground: metres from home and back through the wire's 1e-7 degrees, anywhere on Earth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.errors import BadInputError
from dslam_mav.mission import (
    CMD_CHANGE_SPEED,
    CMD_JUMP,
    CMD_LAND,
    CMD_RETURN_TO_LAUNCH,
    CMD_TAKEOFF,
    CMD_WAYPOINT,
    Home,
    Mission,
    MissionItem,
    e7_to_enu,
    enu_to_e7,
    has_home_item,
    home_item,
    leg_plan,
    leg_vertices,
    with_home_item,
    without_home_item,
)
from missions.patterns import pattern
from missions.plan import Profile, plan_mission

ZURICH = Home(47.3977507, 8.5456075, 488.93)
NAN = math.nan


def waypoint(x, y, z=10.0, frame=3):
    return MissionItem(CMD_WAYPOINT, frame, (0.0, 0.0, 0.0, NAN), x, y, z)


homes = st.builds(
    Home,
    st.one_of(st.floats(-80.0, 80.0), st.just(0.0), st.just(-35.363262)),
    st.one_of(st.floats(-180.0, 180.0), st.sampled_from([180.0, -180.0, 179.9999, -179.9999, 0.0])),
    st.floats(-100.0, 4000.0),
)


@settings(deadline=None)
@given(homes, st.floats(-1500.0, 1500.0), st.floats(-1500.0, 1500.0))
def test_metres_to_degrees_and_back_within_a_centimetre(home, east_m, north_m):
    x, y = enu_to_e7(east_m, north_m, home)
    assert -900_000_000 <= x <= 900_000_000
    assert -1_800_000_000 <= y <= 1_800_000_000
    back = e7_to_enu(x, y, home)
    assert math.hypot(back[0] - east_m, back[1] - north_m) < 0.01


@pytest.mark.parametrize("latitude_deg", [0.001, 47.4, -35.36, 78.2, -77.8])
def test_north_is_latitude_and_east_is_longitude_by_the_ellipsoid(latitude_deg):
    """Against the radii of curvature of WGS-84, not against the library that computed it."""
    a, e2 = 6378137.0, 6.69437999014e-3
    sine = math.sin(math.radians(latitude_deg))
    n = a / math.sqrt(1 - e2 * sine**2)
    m = a * (1 - e2) / (1 - e2 * sine**2) ** 1.5
    home = Home(latitude_deg, 11.0)
    x, _ = enu_to_e7(0.0, 100.0, home)
    _, y = enu_to_e7(100.0, 0.0, home)
    assert math.radians(x / 1e7 - latitude_deg) * m == pytest.approx(100.0, abs=0.01)
    east_m = math.radians(y / 1e7 - 11.0) * n * math.cos(math.radians(latitude_deg))
    assert east_m == pytest.approx(100.0, abs=0.01)


def test_a_path_over_the_date_line_keeps_its_shape():
    home = Home(-17.0, 179.9999)
    vertices = pattern("star7", 60.0)
    mission = plan_mission(vertices, home)
    longitudes = [item.y for _, item in mission.waypoints()]
    assert min(longitudes) < 0 < max(longitudes)
    assert np.abs(leg_vertices(mission) - vertices).max() < 0.01


# At 0, 0 degrees an autopilot sees no position: refused, tested below.
@settings(deadline=None)
@given(
    homes.filter(lambda h: max(abs(h.latitude_deg), abs(h.longitude_deg)) > 0.1),
    st.sampled_from(["star7", "lawnmower", "random"]),
    st.floats(1.0, 300.0),
)
def test_the_legs_of_a_mission_are_those_of_its_pattern(home, name, leg_m):
    vertices = pattern(name, leg_m)
    plan = leg_plan(plan_mission(vertices, home))
    assert np.abs(plan.vertices_m - vertices).max() < 0.01
    assert plan.lengths_m == pytest.approx(np.linalg.norm(np.diff(vertices, axis=0), axis=1), abs=0.02)
    assert plan.sequence == tuple(range(3, 3 + len(vertices)))


def test_layout_is_home_takeoff_speed_every_vertex_land():
    mission = plan_mission(pattern("star5", 40.0), ZURICH, Profile(altitude_m=12.0, speed_m_s=3.5, hold_s=2.0))
    commands = [i.command for i in mission.items]
    assert commands == [CMD_WAYPOINT, CMD_TAKEOFF, CMD_CHANGE_SPEED, *[CMD_WAYPOINT] * 6, CMD_LAND]
    home, take_off, speed, first = mission.items[:4]
    assert (home.frame, home.x, home.y, home.z) == (0, 473977507, 85456075, 488.93)
    assert (take_off.frame, take_off.z) == (3, 12.0)
    assert (speed.frame, speed.params[:2]) == (2, (1.0, 3.5))
    assert (first.frame, first.z, first.params[0]) == (3, 12.0, 2.0)
    assert has_home_item(mission)
    px4 = without_home_item(mission)
    assert px4.items == mission.items[1:]
    assert np.array_equal(leg_vertices(px4), leg_vertices(mission))
    assert with_home_item(px4) == mission


def test_ending_and_take_off_follow_the_profile():
    path = pattern("triangle", 40.0)
    home_again = plan_mission(path, ZURICH, Profile(ending="rtl")).items[-1]
    assert (home_again.command, home_again.frame) == (CMD_RETURN_TO_LAUNCH, 2)
    rover = plan_mission(path, ZURICH, Profile(altitude_m=0.0, take_off=False, ending="none"))
    assert [i.command for i in rover.items] == [CMD_WAYPOINT, CMD_CHANGE_SPEED, *[CMD_WAYPOINT] * 4]
    assert len(leg_vertices(rover)) == 4


def test_a_mission_somebody_drew_without_a_home():
    """Read back from a vehicle: its absolute altitude makes item 0 home; a repeated place makes no leg."""
    a, b, c = (473977507, 85456075), (473987507, 85456075), (473987507, 85476075)
    items = (waypoint(*a, z=488.0, frame=0), waypoint(*b), waypoint(*b), waypoint(*c), waypoint(0, 0))
    mission = Mission(items)
    assert has_home_item(mission)
    plan = leg_plan(mission)
    assert plan.sequence == (1, 3)
    assert np.allclose(plan.vertices_m[0], [0.0, 111.2], atol=0.2)
    # No home item: measured from the first waypoint.
    assert np.allclose(leg_vertices(Mission(items[1:]))[0], [0.0, 0.0])


def test_an_absolute_waypoint_away_from_the_known_home_is_flown():
    items = (waypoint(473987507, 85456075, 500.0, 0), waypoint(473987507, 85476075))
    assert leg_plan(Mission(items, ZURICH)).sequence == (0, 1)


def test_no_waypoints_no_legs():
    assert leg_vertices(Mission(())).shape == (0, 2)
    assert leg_vertices(Mission((home_item(ZURICH),), ZURICH)).shape == (0, 2)


def test_jumps_follow_the_home_item():
    jump = MissionItem(CMD_JUMP, 2, (0.0, 3.0, 0.0, 0.0), 0, 0, 0.0)
    bare = Mission((waypoint(473977507, 85456075), waypoint(473987507, 85456075), jump), ZURICH)
    assert with_home_item(bare).items[3].params[0] == 1.0
    assert without_home_item(with_home_item(bare)) == bare


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"altitude_m": -1.0}, "altitude -1 m"),
        ({"altitude_m": NAN}, "altitude nan"),
        ({"speed_m_s": 0.0}, "speed 0 m/s"),
        ({"speed_m_s": math.inf}, "speed inf"),
        ({"hold_s": 1.5}, "hold 1.5 s: expected whole seconds"),
        ({"hold_s": -1.0}, "hold -1"),
        ({"hold_s": math.inf}, "hold inf"),
        ({"ending": "crash"}, "ending 'crash'"),
        ({"accept_m": -0.1}, "acceptance radius"),
    ],
)
def test_bad_profiles_are_refused_in_one_line(change, words):
    with pytest.raises(BadInputError) as caught:
        Profile(**change)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("vertices", "home", "words"),
    [
        ([[0, 0], [0.01, 0]], ZURICH, "leg 0"),
        ([[0, 0], [20_000, 0]], ZURICH, "vertex 1 at 20000, 0 m"),
        ([[0, 0], [NAN, 0]], ZURICH, "vertex 1 at nan"),
        ([[0, 0], [50, 0]], Home(0.0, 0.0), "vertex 0 at 0, 0 degrees"),
    ],
)
def test_vertices_no_vehicle_could_fly_are_refused(vertices, home, words):
    with pytest.raises(BadInputError, match=words):
        plan_mission(np.array(vertices, dtype=float), home)
    with pytest.raises(ValueError, match="vertices_m"):
        plan_mission(np.zeros((1, 2)), home)
