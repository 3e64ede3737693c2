"""What passes the gate to the estimator, and what does not."""

import math

import pytest

from dslam_mav.mav.decode import autopilot_system, decode, names_heard
from dslam_mav.mav.frames import Encoder, Frame, messages, parse_frame
from dslam_mav.observations import GroundSpeed, Odometry, Progress, Reading, Yaw

M = messages()


def frame(message, system: int = 7, component: int = 1) -> Frame:
    packed = parse_frame(Encoder(system, component).pack(message), 5)
    assert packed is not None
    return packed


def named(name: bytes, value: float = 1.5):
    return M.MAVLink_named_value_float_message(123, name, value)


def test_what_an_estimate_may_see():
    assert decode(frame(named(b"THERMAL"), component=158), 7) == Reading(123, 1.5, "THERMAL", 158)
    assert decode(frame(named(b"THERMAL2")), 7) == Reading(123, 1.5, "THERMAL2", 1)
    assert decode(frame(M.MAVLink_mission_item_reached_message(4)), 7) == Progress(4, reached=True)
    assert decode(frame(M.MAVLink_mission_current_message(5)), 7) == Progress(5, reached=False)
    local = M.MAVLink_local_position_ned_message(9, 1.0, 2.0, -3.0, 0.5, 0.25, -0.125)
    assert decode(frame(local), 7) == Odometry(9, 1.0, 2.0, 0.5, 0.25)
    assert decode(frame(M.MAVLink_vfr_hud_message(9.0, 2.5, 90, 50, 1.0, 0.0)), 7) == GroundSpeed(2.5)
    nan = decode(frame(named(b"THERMAL", math.nan)), 7)
    assert isinstance(nan, Reading)
    assert math.isnan(nan.value)


def test_yaw_only_when_asked_for():
    attitude = frame(M.MAVLink_attitude_message(9, 0.1, 0.2, 0.5, 0.0, 0.0, 0.0))
    assert decode(attitude, 7) is None
    assert decode(attitude, 7, yaw=True) == Yaw(9, 0.5)


@pytest.mark.parametrize(
    "message",
    [
        M.MAVLink_global_position_int_message(1, 2, 3, 4, 5, 6, 7, 8, 9),
        M.MAVLink_gps_raw_int_message(1, 3, 2, 3, 4, 5, 6, 7, 8, 9),
        M.MAVLink_home_position_message(1, 2, 3, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0),
        M.MAVLink_position_target_local_ned_message(1, 1, 0, *[1.0] * 11),
        M.MAVLink_nav_controller_output_message(0.0, 0.0, 90, 90, 12, 0.0, 0.0, 0.0),
        named(b"TEMP"),
        named(b"XTHERMAL"),
    ],
)
def test_what_it_may_not(message):
    assert decode(frame(message), 7, yaw=True) is None


@pytest.mark.parametrize(("system", "component"), [(8, 1), (255, 190), (7, 158), (7, 191)])
def test_mission_progress_and_dead_reckoning_come_from_the_vehicles_autopilot_alone(system, component):
    for message in (
        M.MAVLink_mission_item_reached_message(4),
        M.MAVLink_local_position_ned_message(9, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0),
    ):
        assert decode(frame(message, system, component), 7) is None


def test_readings_come_from_the_vehicles_system_but_not_from_the_estimator():
    assert decode(frame(named(b"THERMAL"), 8, 158), 7) is None
    assert decode(frame(named(b"THERMAL"), 7, 191), 7) is None


def heartbeat(system: int, component: int = 1, autopilot: int = 3, kind: int = 2) -> Frame:
    return frame(M.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3), system, component)


def test_the_vehicle_is_the_autopilot_heard_most():
    others = [
        heartbeat(255, 190, M.MAV_AUTOPILOT_INVALID, M.MAV_TYPE_GCS),
        heartbeat(255, 1, 3, M.MAV_TYPE_GCS),
        heartbeat(51, 68, M.MAV_AUTOPILOT_INVALID),
        heartbeat(9, 191),
    ] * 9
    assert autopilot_system(others) is None
    assert autopilot_system([*others, heartbeat(4), heartbeat(3), heartbeat(3)]) == 3


def test_the_autopilot_with_readings_is_the_vehicle_though_another_is_heard_more():
    beat = M.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3)
    more, fewer = [frame(beat, system=1)] * 9, [frame(beat, system=4)] * 2
    sensor = frame(named(b"THERMAL"), system=4, component=158)
    assert autopilot_system([*more, *fewer]) == 1
    assert autopilot_system([*more, *fewer, sensor]) == 4
    assert autopilot_system([*more, *fewer, frame(named(b"LUX"), system=4)]) == 1
    assert autopilot_system([*more, *fewer, frame(named(b"THERMAL"), system=4, component=191)]) == 1


def test_names_heard_are_listed_for_somebody_who_calls_readings_otherwise():
    heard = [frame(named(b"TEMP")), frame(named(b"LUX")), frame(named(b"TEMP")), frame(named(b"OTHER"), system=8)]
    assert names_heard(heard, 7) == (
        "LUX",
        "TEMP",
    )
