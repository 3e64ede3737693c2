"""Starting the mission a vehicle holds: arm, AUTO, MISSION_START, each in the order its autopilot wants."""

from __future__ import annotations

import time

from dslam_mav.errors import MissionError
from dslam_mav.mav.link import Link
from dslam_mav.mav.mission.talk import ACCEPTED, ARDUPILOT, PX4, UNSUPPORTED, Talk, result_in_words

_DO_SET_MODE = 176
_MISSION_START = 300
_ARM_DISARM = 400

_CUSTOM_MODE = 1
_AUTO_MODE = 4
_COPTER_TYPES = frozenset({2, 3, 4, 12, 13, 14, 15, 29, 35})  # and ArduSub: GUIDED is 4
_GUIDED_COPTER = 4
_GUIDED_OTHERS = 15

_ARMED_WITHIN_S = 3.0
_AGAIN_S = 1.0


def start(link: Link, vehicle_system: int, patience_s: float = 0.0) -> None:
    """Arm the vehicle and start its mission; for `patience_s` a refused arming is tried again every second.

    MissionError with the vehicle's reason and last STATUSTEXT when it refuses, LinkError when it does not
    answer. ArduPilot judges arming by mode: GUIDED, arm, MISSION_START. PX4's MISSION_START arms by itself.
    Others: arm, set AUTO, MISSION_START.
    """
    talk = Talk(link, vehicle_system)
    autopilot, kind = talk.autopilot()
    if autopilot == ARDUPILOT:
        guided = _GUIDED_COPTER if kind in _COPTER_TYPES else _GUIDED_OTHERS
        _demand(talk, "mode GUIDED", _DO_SET_MODE, _CUSTOM_MODE, guided)
    if autopilot != PX4:
        _arm(talk, patience_s)
    if autopilot not in (ARDUPILOT, PX4):
        result = talk.command(_DO_SET_MODE, _AUTO_MODE)
        if result not in (ACCEPTED, UNSUPPORTED):
            raise _refused(talk, "mode AUTO", result)
    _demand(talk, "the start of its mission", _MISSION_START)
    _await_armed(talk)


def _arm(talk: Talk, patience_s: float) -> None:
    until_s = time.monotonic() + patience_s
    while (result := talk.command(_ARM_DISARM, 1)) != ACCEPTED:
        if result == UNSUPPORTED or time.monotonic() >= until_s:
            raise _refused(talk, "to arm", result)
        pause_s = time.monotonic() + _AGAIN_S
        while time.monotonic() < pause_s:
            talk.receive(pause_s)


def _demand(talk: Talk, what: str, command: int, *params: float) -> None:
    result = talk.command(command, *params)
    if result != ACCEPTED:
        raise _refused(talk, what, result)


def _refused(talk: Talk, what: str, result: int) -> MissionError:
    return MissionError(f"vehicle {talk.system} refused {what}: {result_in_words(result)}{talk.last_words()}")


def _await_armed(talk: Talk) -> None:
    """A start may be accepted by a vehicle that then does not fly: its HEARTBEATs tell."""
    until_s = time.monotonic() + _ARMED_WITHIN_S
    while not talk.armed:
        if time.monotonic() >= until_s:
            words = talk.last_words()
            raise MissionError(f"vehicle {talk.system} accepted the start of its mission but is not armed{words}")
        talk.receive(until_s)
