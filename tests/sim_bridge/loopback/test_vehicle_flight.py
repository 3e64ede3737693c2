from __future__ import annotations

import math
import time
from itertools import pairwise

import numpy as np
import pytest
from fakes import flying, mission, star_corners

from dslam_mav.errors import BadInputError, LinkError
from dslam_mav.mav.frames import messages
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.transfer import start, upload
from dslam_mav.mission import Home, Mission, MissionItem, e7_to_enu
from sim_bridge.loopback.autopilot import Autopilot
from sim_bridge.loopback.flight_model import lay_out
from sim_bridge.loopback.telemetry import MissionState, Mode
from sim_bridge.vehicle import DEFAULT_HOME, Vehicle

KINDS = ("LOCAL_POSITION_NED", "MISSION_ITEM_REACHED", "MISSION_CURRENT", "ATTITUDE", "VFR_HUD", "HEARTBEAT")


def fly(plan: Mission, **options: object) -> list[object]:
    """The messages of one flight over a real socket, from upload to mission complete."""
    with (
        flying(**options) as (url,),
        Link(url, system=255, component=190) as ground,
        Link(url, system=1, component=191) as link,
    ):
        system = wait_for_vehicle(link, 5.0)
        upload(ground, system, plan)
        start(ground, system)
        heard = []
        until_s = time.monotonic() + 20.0
        while time.monotonic() < until_s:
            frame = link.receive(2.0)
            assert frame is not None, "the vehicle fell silent"
            if frame.message.get_type() in KINDS:
                heard.append(frame.message)
            if frame.message.get_type() == "MISSION_CURRENT" and frame.message.mission_state == 5:
                return heard
        raise AssertionError("the mission never ended")


def corners_ned(plan: Mission) -> np.ndarray:
    """(V, 2) float32 [north, east], as the wire carries them."""
    enu = [e7_to_enu(item.x, item.y, DEFAULT_HOME) for _, item in plan.waypoints()]
    return np.float32([[n, e] for e, n in enu])


@pytest.fixture(scope="module")
def flights() -> list[list[object]]:
    return [fly(mission(hold_s=1.0), speedup=50.0, seed=3) for _ in range(2)]


def positions(heard: list[object]) -> np.ndarray:
    """(N, 7): time, place and velocity from the take-off's end on, and times from then."""
    rows, zero_ms = [], None
    for m in heard:
        if m.get_type() == "MISSION_ITEM_REACHED" and m.seq == 0:
            zero_ms = rows[-1][0]
        if m.get_type() == "LOCAL_POSITION_NED":
            rows.append((m.time_boot_ms, m.x, m.y, m.z, m.vx, m.vy, m.vz))
    assert zero_ms is not None
    table = np.array([row for row in rows if row[0] >= zero_ms])
    table[:, 0] -= zero_ms
    return table


def test_every_waypoint_is_reached_in_order_and_exactly(flights: list[list[object]]) -> None:
    plan = mission(hold_s=1.0)
    reached, last = [], None
    for m in flights[0]:
        if m.get_type() == "LOCAL_POSITION_NED":
            last = m
        if m.get_type() == "MISSION_ITEM_REACHED":
            reached.append((m.seq, last.x, last.y, last.z))
    assert [r[0] for r in reached] == [0, *(seq for seq, _ in plan.waypoints())]
    assert np.array_equal(np.float32([r[1:3] for r in reached[1:]]), corners_ned(plan))
    assert all(r[3] == -10.0 for r in reached)


def test_current_names_the_waypoint_flown_to_right_after_reached(flights: list[list[object]]) -> None:
    progress = [m for m in flights[0] if m.get_type() in ("MISSION_ITEM_REACHED", "MISSION_CURRENT")]
    after = [(a.seq, b.get_type(), b.seq) for a, b in pairwise(progress) if a.get_type() == "MISSION_ITEM_REACHED"]
    assert after[0] == (0, "MISSION_CURRENT", 2)  # the speed item between is no waypoint
    assert after[1:] == [(seq, "MISSION_CURRENT", seq + 1) for seq in range(2, 10)]


def test_legs_are_straight_and_at_mission_speed(flights: list[list[object]]) -> None:
    table = positions(flights[0])
    corners = corners_ned(mission(hold_s=1.0)).astype(float)
    moving = table[(np.abs(table[:, 4:6]).max(axis=1) > 0) & (table[:, 6] == 0)]
    speed = np.hypot(moving[:, 4], moving[:, 5])
    assert speed == pytest.approx(8.0, abs=1e-5)
    at = [int(np.flatnonzero((table[:, 1:3] == c).all(axis=1))[0]) for c in corners[:-1]]
    at.append(int(np.flatnonzero((table[:, 1:3] == corners[-1]).all(axis=1))[-1]))
    for a, b, i, j in zip(corners, corners[1:], at, at[1:], strict=False):
        leg = table[i:j, 1:3] - a
        along = (b - a) / np.hypot(*(b - a))
        assert np.abs(leg @ [-along[1], along[0]]).max() < 1e-4


def test_a_hold_is_kept_before_the_waypoint_counts_as_reached(flights: list[list[object]]) -> None:
    table = positions(flights[0])
    corner = corners_ned(mission(hold_s=1.0))[2]
    there = table[(np.float32(table[:, 1:3]) == corner).all(axis=1)]
    assert there[-1, 0] - there[0, 0] == 1000


def test_positions_come_at_their_rate_and_never_twice(flights: list[list[object]]) -> None:
    steps = np.diff(positions(flights[0])[:, 0])
    assert steps.min() > 0
    assert steps.max() == 20


def test_two_flights_are_the_same_bit_for_bit(flights: list[list[object]]) -> None:
    one, two = (positions(heard) for heard in flights)
    n = min(len(one), len(two))  # how long we listened after the end may differ
    assert n > 1000
    assert np.array_equal(one[:n], two[:n])
    begun = [
        next(m.time_boot_ms for m in heard if m.get_type() == "LOCAL_POSITION_NED" and m.z < 0) for heard in flights
    ]
    assert begun[0] % 1000 == begun[1] % 1000
    yaws = [
        [(m.time_boot_ms - zero, m.yaw) for m in heard if m.get_type() == "ATTITUDE" and m.time_boot_ms > zero]
        for heard, zero in zip(flights, begun, strict=True)
    ]
    n = min(map(len, yaws))
    assert n > 200
    assert yaws[0][:n] == yaws[1][:n]


def test_yaw_is_the_legs_heading_but_for_a_small_tremble(flights: list[list[object]]) -> None:
    course = None
    off = []
    for m in flights[0]:
        if m.get_type() == "LOCAL_POSITION_NED":
            course = (m.time_boot_ms, math.atan2(m.vy, m.vx), math.hypot(m.vx, m.vy))
        if m.get_type() == "ATTITUDE" and course and course[2] > 1 and course[0] == m.time_boot_ms:
            off.append(math.remainder(m.yaw - course[1], math.tau))
    assert len(off) > 50
    assert 1e-4 < np.std(off) < 0.01
    assert abs(np.mean(off)) < 0.002


def test_without_hold_the_vehicle_flies_on() -> None:
    heard = fly(mission(star_corners(10.0)), speedup=50.0)
    table = positions(heard)
    corner = corners_ned(mission(star_corners(10.0)))[2]
    assert (np.float32(table[:, 1:3]) == corner).all(axis=1).sum() == 1


def test_the_last_heartbeat_says_landed_and_disarmed() -> None:
    autopilot = Autopilot(DEFAULT_HOME)
    autopilot.set_items(mission().items)
    assert autopilot.arm() == ""
    assert autopilot.start_mission() == ""
    out = [o.message for o in autopilot.advance(200_000)]
    beats = [m for m in out if m.get_type() == "HEARTBEAT"]
    assert not beats[-1].base_mode & messages().MAV_MODE_FLAG_SAFETY_ARMED
    assert autopilot.mission_state is MissionState.COMPLETE
    assert autopilot.snapshot().place_m == (0.0, 0.0, 0.0)


def test_time_in_one_step_or_in_many_gives_the_same_messages() -> None:
    def messages_of(step_ms: int) -> list[bytes]:
        autopilot = Autopilot(DEFAULT_HOME, seed=5)
        autopilot.set_items(mission().items)
        autopilot.arm()
        autopilot.start_mission()
        out = []
        for to_ms in range(step_ms, 60_000 + step_ms, step_ms):
            out += autopilot.advance(min(to_ms, 60_000))
        return [str(o.message) for o in out]

    assert messages_of(60_000) == messages_of(7)


def test_a_flight_does_not_depend_on_when_it_was_started() -> None:
    def places(wait_ms: int) -> list[tuple[float, ...]]:
        autopilot = Autopilot(DEFAULT_HOME, seed=5)
        autopilot.set_items(mission().items)
        autopilot.advance(wait_ms)
        autopilot.arm()
        autopilot.start_mission()
        start_ms = -(-(wait_ms + 1) // 1000) * 1000
        return [
            (
                m.time_boot_ms - start_ms,
                *([m.x, m.y, m.z] if m.get_type() == "LOCAL_POSITION_NED" else [m.yaw]),
            )
            for m in (o.message for o in autopilot.advance(start_ms + 30_000))
            if m.get_type() in ("LOCAL_POSITION_NED", "ATTITUDE") and m.time_boot_ms >= start_ms
        ]

    assert places(1) == places(12_345)
    assert len(places(1)) > 1800


def test_pause_and_go_on() -> None:
    autopilot = Autopilot(DEFAULT_HOME)
    autopilot.set_items(mission().items)
    autopilot.arm()
    autopilot.start_mission()
    autopilot.advance(8_000)
    before = autopilot.snapshot()
    autopilot.set_mode(Mode.HOLD)
    autopilot.advance(20_000)
    held = autopilot.snapshot()
    assert (held.place_m, held.mission_state) == (before.place_m, MissionState.PAUSED)
    assert held.velocity_m_s == (0.0, 0.0, 0.0)
    autopilot.set_mode(Mode.MISSION)
    autopilot.advance(20_500)
    now = autopilot.snapshot()
    moved = math.dist(now.place_m, held.place_m)
    assert moved == pytest.approx(4.0, abs=0.01)
    assert math.hypot(*now.velocity_m_s) == pytest.approx(8.0)


def test_return_home_in_flight() -> None:
    autopilot = Autopilot(DEFAULT_HOME)
    autopilot.set_items(mission().items)
    autopilot.arm()
    autopilot.start_mission()
    autopilot.advance(8_000)
    autopilot.set_mode(Mode.RETURN)
    autopilot.advance(60_000)
    assert autopilot.snapshot().place_m == (0.0, 0.0, 0.0)
    assert not autopilot.armed
    assert not autopilot.in_mission


def test_disarming_in_the_air_wants_force() -> None:
    autopilot = Autopilot(DEFAULT_HOME)
    autopilot.set_items(mission().items)
    autopilot.arm()
    autopilot.start_mission()
    autopilot.advance(8_000)
    assert "flying" in autopilot.disarm(force=False)
    assert autopilot.disarm(force=True) == ""
    assert not autopilot.armed


def test_absolute_altitudes_and_land_items() -> None:
    home = Home(47.0, 8.0, 400.0)
    items = (
        MissionItem(16, 0, (math.nan,) * 4, 470001000, 80000000, 420.0),
        MissionItem(21, 3, (0.0,) * 4, 470001000, 80001000, 0.0),
    )
    timeline = lay_out(items, home, (0.0, 0.0, 0.0), speed_m_s=5.0)
    assert timeline.segments[1].target_m[2] == -20.0
    assert timeline.lands
    end = timeline.segments[-1].target_m
    assert end[2] == 0.0
    assert end[1] == pytest.approx(7.6, abs=0.1)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"speedup": 0.0}, "speedup"), ({"speedup": math.nan}, "speedup"), ({"system": 0}, "system")],
)
def test_impossible_options_are_named(options: dict[str, float], words: str) -> None:
    with pytest.raises(BadInputError, match=words):
        Vehicle(["udpin:127.0.0.1:0"], **options)


def test_port_in_use_and_bad_url_leave_no_socket_open() -> None:
    with Vehicle(["udpin:127.0.0.1:0"]) as first:
        with pytest.raises(LinkError, match="in use"):
            Vehicle(["udpin:127.0.0.1:0", first.urls[0]])
        with pytest.raises(BadInputError, match="kind 'udpout'"):
            Vehicle(["udpout:127.0.0.1:5"])
    with Vehicle(list(first.urls)):
        pass  # the port is free again
