"""Starting a mission: what refuses, what says that it starts and stays on the ground, what is only not heard."""

from __future__ import annotations

import time
from typing import Any

import pytest
from fakes import ScriptedVehicle, flying, mission

from dslam_mav.errors import MissionError
from dslam_mav.mav.frames import messages
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.transfer import clear, start, upload

M = messages()


def ground(url: str) -> Link:
    return Link(url, system=255, component=190)


def test_start_flies_and_a_mission_under_way_is_not_cleared() -> None:
    with flying(speedup=10.0) as (url,), ground(url) as link:
        upload(link, 1, mission())
        start(link, 1)
        with pytest.raises(MissionError, match="refused to clear its mission: denied"):
            clear(link, 1)


def test_start_without_a_mission_says_why() -> None:
    with flying() as (url,), ground(url) as link:
        with pytest.raises(MissionError, match='refused mode AUTO: denied: "mission mode refused: no mission"'):
            start(link, 1)


def test_start_of_an_ardupilot_goes_by_guided_and_tells_the_prearm_text() -> None:
    commands: list[tuple[int, float, float]] = []

    def answer(message: Any) -> list[Any]:
        if message.get_type() != "COMMAND_LONG":
            return []
        commands.append((message.command, message.param1, message.param2))
        if message.command == 400:
            return [
                M.MAVLink_command_ack_message(400, 4, 0, 0, 255, 190),
                M.MAVLink_statustext_message(2, b"PreArm: GPS 1: Bad fix"),
            ]
        return [M.MAVLink_command_ack_message(message.command, 0, 0, 0, 255, 190)]

    with ScriptedVehicle(answer, autopilot=3) as fake, ground(fake.url) as link:
        with pytest.raises(MissionError, match='refused to arm: failed: "PreArm: GPS 1: Bad fix"'):
            start(link, 1)
    assert commands == [(224, 1.0, 1.0), (176, 1.0, 4.0), (400, 1.0, 0.0)]


def test_heartbeats_that_are_lost_do_not_say_that_it_stays_on_the_ground() -> None:
    """Four seconds without one: as a radio that loses three packets in ten, and is silent for two seconds, does."""
    started_s: list[float] = []

    def answer(message: Any) -> list[Any]:
        if message.get_type() == "COMMAND_LONG":
            started_s.extend([time.monotonic()] if message.command == 300 else [])
            return [M.MAVLink_command_ack_message(message.command, 0, 0, 0, 255, 190)]
        flies = bool(started_s) and time.monotonic() - started_s[0] > 4.0
        lost = bool(started_s) and not flies
        return [
            M.MAVLink_system_time_message(0, 1) if lost else M.MAVLink_heartbeat_message(2, 0, 128 * flies, 0, 4, 3)
        ]

    with ScriptedVehicle(answer, beats=0) as fake, ground(fake.url) as link:
        link.send_heartbeat()
        wait_for_vehicle(link, 5.0)
        start(link, 1)
    assert time.monotonic() - started_s[0] > 4.0


def test_one_that_goes_on_saying_disarmed_is_found_out_soon() -> None:
    def answer(message: Any) -> list[Any]:
        if message.get_type() != "COMMAND_LONG":
            return []
        return [M.MAVLink_command_ack_message(message.command, 0, 0, 0, 255, 190)]

    begun_s = time.monotonic()
    with ScriptedVehicle(answer) as fake, ground(fake.url) as link:
        with pytest.raises(MissionError, match="accepted the start of its mission but is not armed"):
            start(link, 1)
    assert time.monotonic() - begun_s < 5.0


def test_an_ardupilot_that_accepts_the_start_and_stays_on_the_ground_is_found_out() -> None:
    def answer(message: Any) -> list[Any]:
        if message.get_type() != "COMMAND_LONG":
            return []
        return [M.MAVLink_command_ack_message(message.command, 0, 0, 0, 255, 190)]

    told: list[str] = []
    with ScriptedVehicle(answer, autopilot=3) as fake, ground(fake.url) as link:
        with pytest.raises(MissionError, match="accepted the start of its mission but does not fly it"):
            start(link, 1, 5.0, told.append)
    assert "disarmed before its mission began" in told[0]


def test_one_that_has_flown_before_the_start_got_through_is_not_refused() -> None:
    """As over a radio that loses the start for seconds, while a simulator flies faster than time."""
    commands: list[int] = []

    def answer(message: Any) -> list[Any]:
        if message.get_type() != "COMMAND_LONG":
            return []
        commands.append(message.command)
        denied = 2 * (message.command == 300)
        armed = M.MAVLink_heartbeat_message(2, 0, 128, 0, 4, 3)
        flies = M.MAVLink_mission_current_message(1, 8, M.MISSION_STATE_ACTIVE)
        said = [armed, flies] if message.command == 176 else []
        return [*said, M.MAVLink_command_ack_message(message.command, denied, 0, 0, 255, 190)]

    with ScriptedVehicle(answer) as fake, ground(fake.url) as link:
        start(link, 1)
    assert commands == [400, 176, 300]
