"""`dslam_mav.read_log`: a flight log with its legs and its mission, as scripts use it."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from flown import fly

import dslam_mav
from dslam_mav.errors import BadInputError
from dslam_mav.flight_log import read_flight
from dslam_mav.log import Recorder
from dslam_mav.mission import (
    CMD_CHANGE_SPEED,
    FRAME_MISSION,
    Home,
    Mission,
    MissionItem,
    with_home_item,
    without_home_item,
)
from dslam_mav.observations import Reading
from missions.patterns import pattern
from missions.plan import Profile, plan_mission
from missions.plan_file import parse_plan, plan_bytes

HOME = Home(-47.3977419, 8.5455938, 488.12)


def a_mission() -> Mission:
    planned = plan_mission(pattern("triangle", 30.0), HOME, Profile(altitude_m=20.0, speed_m_s=5.0, hold_s=0.0))
    more = MissionItem(CMD_CHANGE_SPEED, FRAME_MISSION, (1.0, 2.5, math.nan, 0.1), 7, -3, 0.25, autocontinue=False)
    return with_home_item(Mission((*planned.items, more), planned.home))


def logged(path: Path, attachment: bytes | None = None) -> Path:
    with Recorder(path) as recorder:
        if attachment is not None:
            recorder.attach("mission.waypoints", "text/plain", attachment)
        recorder.reading(1, Reading(17, 20.5))
        for frame in fly().frames:
            recorder.frame(frame.received_ns, frame.raw)
    return path


def same(a: Mission, b: Mission) -> bool:
    """Equal item by item; a parameter that is not set is NaN, which equals nothing."""
    return repr(a) == repr(b)


def test_legs_are_those_of_read_flight_and_all_else_is_there(tmp_path: Path) -> None:
    path = logged(tmp_path / "flight.mcap")
    log, flight = dslam_mav.read_log(str(path)), read_flight(path)
    assert len(log.legs) == len(flight.legs) == 4
    for mine, other in zip(log.legs, flight.legs, strict=True):
        assert mine.reading.tobytes() == other.reading.tobytes()
        assert mine.distance_m.tobytes() == other.distance_m.tobytes()
    readings = log.readings
    for number, leg in enumerate(log.legs, 1):
        on = readings.leg == number
        assert (readings.value[on] == leg.reading).all()
        assert (readings.distance_m[on] == leg.distance_m).all()
        assert (readings.time_s[on] == leg.time_s).all()
    assert (log.mission, log.truth, log.estimates, log.complete) == (None, None, (), True)


def test_the_mission_is_what_the_plan_reader_makes_of_the_attachment(tmp_path: Path) -> None:
    mission = a_mission()
    data = plan_bytes(mission, ".waypoints")
    log = dslam_mav.read_log(logged(tmp_path / "flight.mcap", data))
    assert log.mission is not None
    assert same(log.mission, mission)
    assert same(log.mission, parse_plan(data, "mission.waypoints").mission)


def test_a_mission_that_began_without_home_is_given_without_home(tmp_path: Path) -> None:
    mission = a_mission()
    with Recorder(tmp_path / "flight.mcap") as recorder:
        recorder.attach("mission.waypoints", "text/plain", plan_bytes(mission, ".waypoints"))
        recorder.attach("configuration.json", "application/json", b'{"assumptions": {}, "home_item": false}')
    log = dslam_mav.read_log(tmp_path / "flight.mcap")
    assert log.mission is not None
    assert same(log.mission, without_home_item(mission))


def test_legs_are_measured_as_on_board(tmp_path: Path) -> None:
    lengths = []
    for distance in (b"null", b'"odometry"', b'"speed"'):
        path = tmp_path / f"{len(lengths)}.mcap"
        with Recorder(path) as recorder:
            recorder.attach("configuration.json", "application/json", b'{"assumptions": {"distance": %b}}' % distance)
            for frame in fly().frames:
                recorder.frame(frame.received_ns, frame.raw)
        lengths.append([leg.length_m for leg in dslam_mav.read_log(path).legs])
    assert len(lengths[0]) == len(lengths[2]) == 4
    assert lengths[0] == lengths[1]
    assert lengths[0] != lengths[2]


@pytest.mark.parametrize(
    "configuration", [b"", b"[]", b"{}", b'{"assumptions": {"distance": [], "vehicle_system": "x"}}']
)
def test_a_configuration_that_is_none_says_nothing(tmp_path: Path, configuration: bytes) -> None:
    with Recorder(tmp_path / "flight.mcap") as recorder:
        recorder.attach("configuration.json", "application/json", configuration)
        for frame in fly().frames:
            recorder.frame(frame.received_ns, frame.raw)
    assert len(dslam_mav.read_log(tmp_path / "flight.mcap").legs) == 4


def test_a_log_without_legs_is_read_all_the_same(tmp_path: Path) -> None:
    with Recorder(tmp_path / "flight.mcap") as recorder:
        recorder.reading(1, Reading(17, 20.5))
    log = dslam_mav.read_log(tmp_path / "flight.mcap")
    assert log.legs == ()
    assert log.readings.value.tolist() == [20.5]
    assert log.readings_frame()["leg"].isna().all()


def test_a_log_prints_as_one_line(tmp_path: Path) -> None:
    with Recorder(tmp_path / "flight.mcap") as recorder:
        recorder.reading(1, Reading(17, 20.5))
    log = dslam_mav.read_log(tmp_path / "flight.mcap")
    assert repr(log) == "<LoggedFlight: 1 reading, 0 legs, 0 estimates, 0.0 s, complete>"


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"QGC WPL 110\n",
        b"QGC WPL 120\n0\t1\t0\t16\t0\t0\t0\t0\t47\t8\t488\t1\n",
        b"QGC WPL 110\n1\t1\t0\t16\t0\t0\t0\t0\t47\t8\t488\t1\n",
        b"QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47\t8\t488\n",
        b"QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\tNaN\t8\t488\t1\n",
        b"QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\tinf\t8\t488\t1\n",
        b"QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t147\t8\t488\t1\n",
        b"\xff\xfe",
    ],
)
def test_a_mission_that_is_none_is_one_line(tmp_path: Path, text: bytes) -> None:
    path = logged(tmp_path / "flight.mcap", text)
    with pytest.raises(BadInputError) as problem:
        dslam_mav.read_log(path)
    assert str(problem.value).startswith(f"{path}: attachment mission.waypoints: ")
    assert "\n" not in str(problem.value)
