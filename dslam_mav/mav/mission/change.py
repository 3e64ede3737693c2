"""Another mission for a vehicle that is flying: sent whole, read back, and the old one restored where that fails.

The whole mission is sent again, rather than targets in GUIDED mode: the vehicle then always holds all that is to come,
flies on and comes home when this side falls silent, and its items' numbers keep telling the legs apart. No item is
marked as the one to begin with, so that PX4 and ArduPilot go on at the item they fly to; MISSION_SET_CURRENT follows
only where one lost its place, because ArduPilot begins the leg under way anew at every such request.
"""

from __future__ import annotations

import time

from dslam_mav.errors import DslamError, MissionError
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, messages
from dslam_mav.mav.mission.compare import first_difference
from dslam_mav.mav.mission.talk import Talk
from dslam_mav.mav.mission.transfer import download, upload
from dslam_mav.mav.ports import Port
from dslam_mav.mission import Mission

RESTORES = 3
PLACE_WAIT_S = 1.2  # autopilots send MISSION_CURRENT every second
PLACE_TRIES = 3


class PlaceLostError(MissionError):
    """The vehicle holds the new mission, `held`, and flies to the wrong item of it."""

    def __init__(self, text: str, held: Mission) -> None:
        super().__init__(text)
        self.held = held


class UnknownMissionError(MissionError):
    """Nobody knows what mission the vehicle holds."""


def change(link: Port, vehicle_system: int, old: Mission, new: Mission, flying_seq: int) -> Mission:
    """Give the vehicle `new` in place of `old` while it flies to item `flying_seq`: the mission as it holds it.

    DslamError, one line: it does not hold `new`. It says whether the vehicle holds `old`: what was there is read back,
    and sent again where it is no longer that.
    """
    try:
        held = upload(link, vehicle_system, new, in_flight=True)
    except DslamError as problem:
        if not _restore(link, vehicle_system, old):
            told = f"mission not changed: {problem}; what mission it holds now is NOT known"
            raise UnknownMissionError(told) from problem
        keep_place(link, vehicle_system, flying_seq)
        raise MissionError(f"mission not changed: {problem}; the old mission stays and is flown on") from problem
    try:
        keep_place(link, vehicle_system, flying_seq)
    except DslamError as problem:
        raise PlaceLostError(f"mission changed, but {problem}", held) from problem
    return held


def _restore(link: Port, vehicle_system: int, old: Mission) -> bool:
    """Whether the vehicle holds `old` again, or still."""
    profile = Talk(link, vehicle_system).profile()
    for _ in range(RESTORES):
        try:
            held = download(link, vehicle_system).items
            if first_difference(old.items, held, 1 if profile.home_item else 0, profile) is None:
                return True
            upload(link, vehicle_system, old, in_flight=True)
            return True
        except DslamError:
            continue
    return False


def keep_place(link: Port, vehicle_system: int, seq: int) -> None:
    """Make sure that the vehicle flies to item `seq` or one behind it. MissionError: it does not."""
    talk = Talk(link, vehicle_system)
    for _ in range(PLACE_TRIES):
        current = _current(talk)
        if current is None or current >= seq:
            return
        talk.send(messages().MAVLink_mission_set_current_message(vehicle_system, COMPONENT_AUTOPILOT, seq))
    if (current := _current(talk)) is not None and current < seq:
        raise MissionError(f"vehicle {vehicle_system} went back to item {current} and did not take item {seq}")


def _current(talk: Talk) -> int | None:
    """The item flown to, as last heard: what comes first may have waited. None: not heard."""
    until_s, heard = time.monotonic() + PLACE_WAIT_S, None
    while (message := talk.receive(until_s)) is not None and time.monotonic() < until_s:
        if message.get_type() == "MISSION_CURRENT":
            heard = int(message.seq)
    return heard
