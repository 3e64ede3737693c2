"""Starting the mission a vehicle holds: arm, AUTO, MISSION_START, each in the order its autopilot wants."""

from __future__ import annotations

import time
from collections.abc import Callable

from dslam_mav.errors import MissionError
from dslam_mav.mav.mission.talk import ACCEPTED, UNSUPPORTED, Talk, result_in_words
from dslam_mav.mav.ports import Port
from dslam_mav.mav.profile import modes_of

_DO_SET_MODE = 176
_SET_MISSION_CURRENT = 224
_MISSION_START = 300
_ARM_DISARM = 400

_CUSTOM_MODE = 1
_AUTO_MODE = 4

_FLIES_WITHIN_S = 10.0  # a bad radio loses several HEARTBEATs in a row
_GROUNDED_BEATS = 3
_AGAIN_S = 1.0
_STARTS = 3

Waiting = Callable[[str], None]


def start(link: Port, vehicle_system: int, patience_s: float = 0.0, waiting: Waiting | None = None) -> None:
    """Arm the vehicle and start its mission; for `patience_s` what is refused is tried again every second, and
    `waiting` told why.

    MissionError with the vehicle's reason and last STATUSTEXT when it refuses, LinkError when it does not
    answer. ArduPilot judges arming by mode: GUIDED, arm, MISSION_START. PX4's MISSION_START arms by itself.
    Others: arm, set AUTO, MISSION_START.
    """
    talk = Talk(link, vehicle_system)
    profile = talk.profile()
    until_s = time.monotonic() + patience_s
    patient = _Patient(talk, until_s, waiting or (lambda _: None))
    if profile.guided_first:
        _start_ardupilot(talk, patient)
        return
    if not profile.starts_armed:
        patient.demand("to arm", _ARM_DISARM, 1)
        _start_armed(talk)
    else:
        patient.demand("the start of its mission", _MISSION_START)
    _await_armed(talk)


def _start_armed(talk: Talk) -> None:
    """AUTO, MISSION_START. Some begin with the mode: such a one may have flown before a start got through to it."""
    talk.under_way = False
    result = talk.command(_DO_SET_MODE, _AUTO_MODE)
    if result not in (ACCEPTED, UNSUPPORTED):
        raise _refused(talk, "mode AUTO", result)
    result = talk.command(_MISSION_START)
    if result != ACCEPTED and not (talk.armed and talk.under_way):
        raise _refused(talk, "the start of its mission", result)


class _Patient:
    """Asks again while the vehicle is not ready, until `until_s`."""

    def __init__(self, talk: Talk, until_s: float, waiting: Waiting) -> None:
        self.talk = talk
        self.until_s = until_s
        self.waiting = waiting

    def demand(self, what: str, command: int, *params: float) -> None:
        talk = self.talk
        while (result := talk.command(command, *params)) != ACCEPTED:
            if result == UNSUPPORTED or time.monotonic() >= self.until_s:
                raise _refused(talk, what, result)
            self.waiting(f"vehicle {talk.system} refuses {what}: {result_in_words(result)}{talk.last_words()}")
            pause_s = time.monotonic() + _AGAIN_S
            while time.monotonic() < pause_s:
                talk.receive(pause_s)


def _start_ardupilot(talk: Talk, patient: _Patient) -> None:
    """GUIDED, arm, MISSION_START; again if it disarmed in between: it accepts the start all the same."""
    guided, auto = modes_of(talk.autopilot()[1])
    talk.command(_SET_MISSION_CURRENT, 1, 1)  # or it goes on where an earlier flight of the mission was broken off
    for _ in range(_STARTS):
        patient.demand("mode GUIDED", _DO_SET_MODE, _CUSTOM_MODE, guided)
        patient.demand("to arm", _ARM_DISARM, 1)
        result = talk.command(_MISSION_START)
        if result == UNSUPPORTED:
            result = talk.command(_DO_SET_MODE, _CUSTOM_MODE, auto)
        if result != ACCEPTED:
            raise _refused(talk, "the start of its mission", result)
        if _flies(talk, auto):
            return
        patient.waiting(f"vehicle {talk.system} disarmed before its mission began{talk.last_words()}: once more")
    raise _grounded(talk)


def _flies(talk: Talk, auto: int) -> bool:
    """Whether the HEARTBEATs from now on say armed and AUTO; MissionError if they say neither that nor disarmed."""
    talk.receive(time.monotonic())
    seen, until_s = talk.beats, time.monotonic() + _FLIES_WITHIN_S
    while time.monotonic() < until_s:
        talk.receive(until_s)
        if talk.beats > seen and talk.state == (True, auto):
            return True
        if talk.beats > seen + 1 and not talk.state[0]:
            return False
    raise _grounded(talk)


def _grounded(talk: Talk) -> MissionError:
    words = talk.last_words()
    return MissionError(f"vehicle {talk.system} accepted the start of its mission but does not fly it{words}")


def _refused(talk: Talk, what: str, result: int) -> MissionError:
    return MissionError(f"vehicle {talk.system} refused {what}: {result_in_words(result)}{talk.last_words()}")


def _await_armed(talk: Talk) -> None:
    """A start may be accepted by a vehicle that then does not fly: its HEARTBEATs tell, of which not each is heard."""
    seen, until_s = talk.beats, time.monotonic() + _FLIES_WITHIN_S
    while not talk.armed:
        if talk.beats - seen >= _GROUNDED_BEATS or time.monotonic() >= until_s:
            words = talk.last_words()
            raise MissionError(f"vehicle {talk.system} accepted the start of its mission but is not armed{words}")
        talk.receive(until_s)
