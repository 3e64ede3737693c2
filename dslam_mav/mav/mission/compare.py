"""Is the mission a vehicle holds the one that was sent? Pure.

Vehicles round what they store: ArduPilot gives frame 6 back as 3 and 5 as 0, altitudes to the centimetre,
hold times as whole seconds, and fills parameters it does not use; PX4 turns 3 into 6 and 0 into 5 and zeroes
unused parameters. Only what decides the flight is compared: command, place, altitude and the parameters that
command needs.
"""

from __future__ import annotations

import math

from dslam_mav.mav.frames import messages
from dslam_mav.mav.profile import Profile, profile_of
from dslam_mav.mission import (
    CMD_CHANGE_SPEED,
    CMD_LAND,
    CMD_RETURN_TO_LAUNCH,
    CMD_TAKEOFF,
    CMD_WAYPOINT,
    MissionItem,
)
from dslam_mav.records.words import agree, count

_PLAIN_FRAME = {5: 0, 6: 3, 11: 10}
_PLACE_STEPS_E7 = 1  # about 1 cm
_SLACK = 1.01
_RELATIVE = 1e-5  # float32 on the wire, twice
_PARAMETER = 0.0101
_ANY = profile_of(0)

# the parameters (from 0) that decide the flight; of other commands all
_NEEDED = {
    CMD_WAYPOINT: (0,),
    CMD_TAKEOFF: (),
    CMD_LAND: (),
    CMD_RETURN_TO_LAUNCH: (),
    CMD_CHANGE_SPEED: (0, 1),
}


def first_difference(
    sent: tuple[MissionItem, ...], held: tuple[MissionItem, ...], first: int = 0, profile: Profile = _ANY
) -> str | None:
    """The first item and field that differ beyond the profile's roundings, in words; None: the same mission.

    Items before `first` are the vehicle's own (ArduPilot keeps its home in item 0).
    """
    if len(sent) != len(held):
        return f"{count(len(sent), 'item')} {agree(len(sent), 'was', 'were')} sent, the vehicle holds {len(held)}"
    for seq, (ours, theirs) in enumerate(zip(sent[first:], held[first:], strict=True), first):
        if (field := _difference(ours, theirs, profile)) is not None:
            name, mine, other = field
            return f"item {seq} ({command_name(ours.command)}): {name}: sent {mine}, the vehicle holds {other}"
    return None


def command_name(command: int) -> str:
    """MAV_CMD's name without its prefix."""
    entry = messages().enums["MAV_CMD"].get(command)
    return f"command {command}" if entry is None else str(entry.name).removeprefix("MAV_CMD_")


def _difference(ours: MissionItem, theirs: MissionItem, profile: Profile) -> tuple[str, object, object] | None:
    if ours.command != theirs.command:
        return "command", command_name(ours.command), command_name(theirs.command)
    placed = ours.has_position and ours.command not in (CMD_CHANGE_SPEED, CMD_RETURN_TO_LAUNCH)
    if placed:
        if _PLAIN_FRAME.get(ours.frame, ours.frame) != _PLAIN_FRAME.get(theirs.frame, theirs.frame):
            return "frame", ours.frame, theirs.frame
        for name, mine, other in (("x", ours.x, theirs.x), ("y", ours.y, theirs.y)):
            if abs(mine - other) > _PLACE_STEPS_E7:
                return name, mine, other
    if (placed or ours.command in (CMD_TAKEOFF, CMD_WAYPOINT)) and not _near(
        ours.z, theirs.z, _SLACK * profile.altitude_step_m
    ):
        return "z", ours.z, theirs.z
    for index in _NEEDED.get(ours.command, (0, 1, 2, 3)):
        wanted, got = ours.params[index], theirs.params[index]
        cut = profile.whole_holds and ours.command == CMD_WAYPOINT
        whole = cut and math.isfinite(wanted) and got == math.trunc(wanted)
        if not whole and not _near(wanted, got, _PARAMETER):
            return f"param{index + 1}", wanted, got
    return None


def _near(mine: float, other: float, tolerance: float) -> bool:
    # "not set" (NaN) comes back as NaN or 0
    mine, other = (0.0 if math.isnan(v) else v for v in (mine, other))
    return abs(mine - other) <= tolerance + _RELATIVE * abs(mine)
