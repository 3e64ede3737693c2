"""A plan as a vehicle will fly it well: its corners flown to and stopped at, nothing that it cannot do. Pure."""

from __future__ import annotations

import math
from dataclasses import replace

from dslam_mav.mav.profile import Profile, stays_on_ground
from dslam_mav.mission import CMD_JUMP, CMD_LAND, CMD_TAKEOFF, CMD_WAYPOINT, Mission, MissionItem, has_home_item
from dslam_mav.records.words import agree, count


def suited(mission: Mission, profile: Profile, vehicle_type: int) -> tuple[Mission, tuple[str, ...]]:
    """The mission for this vehicle, and what was changed, one line each.

    Without a hold a copter cuts its corners by about 2 m, and its legs are neither straight nor as long as planned.
    """
    notes = []
    items = mission.items
    if stays_on_ground(vehicle_type) and not any(item.command == CMD_JUMP for item in items):
        kept = tuple(item for item in items if item.command not in (CMD_TAKEOFF, CMD_LAND))
        if len(kept) < len(items):
            notes.append("take-off and landing are left out: the vehicle stays on the ground")
        items = kept
    first = 1 if has_home_item(mission) else 0
    held = items[:first] + tuple(_held(item, profile) for item in items[first:])
    if n := sum(a.params[0] != b.params[0] for a, b in zip(items, held, strict=True)):
        who = f"{count(n, 'waypoint')} {agree(n, 'gets', 'get')}"
        notes.append(f"{who} a hold of {profile.corner_hold_s:g} s: without, their corners are cut")
    if n := sum(_set(a.params[1]) != _set(b.params[1]) for a, b in zip(items, held, strict=True)):
        who = f"{count(n, 'waypoint')} {agree(n, 'gets', 'get')}"
        notes.append(f"{who} an acceptance radius of {profile.corner_accept_m:g} m: PX4's own is 10 m")
    return replace(mission, items=held), tuple(notes)


def _held(item: MissionItem, profile: Profile) -> MissionItem:
    if item.command != CMD_WAYPOINT or not item.has_position:
        return item
    hold_s, accept_m, *rest = item.params
    if _set(hold_s) < profile.corner_hold_s:
        hold_s = profile.corner_hold_s
    if _set(accept_m) == 0.0 and profile.corner_accept_m:
        accept_m = profile.corner_accept_m
    return replace(item, params=(hold_s, accept_m, rest[0], rest[1]))


def _set(value: float) -> float:
    return 0.0 if math.isnan(value) else value
