"""The mission items the loopback vehicle takes: each refusal is a MAV_MISSION_RESULT and a sentence. Pure."""

from __future__ import annotations

import math

from dslam_mav.mav.mission.protocol import (
    ACCEPTED,
    INVALID_PARAM1,
    INVALID_PARAM2,
    INVALID_PARAM5_X,
    INVALID_PARAM6_Y,
    INVALID_PARAM7,
    UNSUPPORTED,
    UNSUPPORTED_FRAME,
)
from dslam_mav.mission import (
    CMD_CHANGE_SPEED,
    CMD_LAND,
    CMD_RETURN_TO_LAUNCH,
    CMD_TAKEOFF,
    CMD_WAYPOINT,
    DEGREES_E7,
    FRAME_MISSION,
    GLOBAL_FRAMES,
    Home,
    MissionItem,
    e7_to_enu,
)
from sim_bridge.loopback.flight_model import CMD_DELAY, CMD_LOITER_TIME

FARTHEST_M = 50_000.0
HIGHEST_M = 20_000.0

_PLACED = frozenset({CMD_WAYPOINT, CMD_LOITER_TIME, CMD_LAND, CMD_TAKEOFF})
# camera, gimbal and region-of-interest commands of survey plans: taken, and nothing done
_IGNORED = frozenset({115, 195, 197, 201, 203, 205, 206, 214, 530, 531, 532, 1000, 1001, 2000, 2001, 2500, 2501})
_SUPPORTED = _PLACED | _IGNORED | {CMD_RETURN_TO_LAUNCH, CMD_CHANGE_SPEED, CMD_DELAY}

Refusal = tuple[int, str]


def check_item(item: MissionItem, home: Home) -> Refusal:
    """(ACCEPTED, "") or why the vehicle refuses the item."""
    if item.command not in _SUPPORTED:
        return UNSUPPORTED, f"command {item.command} is not supported"
    if item.command in _PLACED:
        if item.frame not in GLOBAL_FRAMES:
            return UNSUPPORTED_FRAME, f"frame {item.frame} is not supported"
        return _check_place(item, home)
    if item.frame not in GLOBAL_FRAMES and item.frame != FRAME_MISSION:
        return UNSUPPORTED_FRAME, f"frame {item.frame} is not supported"
    if item.command == CMD_CHANGE_SPEED:
        speed_m_s = item.params[1]
        if not (0.01 <= speed_m_s <= 100.0 or speed_m_s in (-1.0, -2.0)):
            return INVALID_PARAM2, f"speed {speed_m_s:g} m/s: expected 0.01 to 100"
    return ACCEPTED, ""


def _check_place(item: MissionItem, home: Home) -> Refusal:
    if abs(item.x) > 90 * DEGREES_E7:
        return INVALID_PARAM5_X, f"latitude {item.x / DEGREES_E7:g}: expected -90 to 90"
    if abs(item.y) > 180 * DEGREES_E7:
        return INVALID_PARAM6_Y, f"longitude {item.y / DEGREES_E7:g}: expected -180 to 180"
    if not abs(item.z) <= HIGHEST_M:
        return INVALID_PARAM7, f"altitude {item.z:g} m: expected at most {HIGHEST_M:g}"
    hold_s = item.params[0]
    if item.command in (CMD_WAYPOINT, CMD_LOITER_TIME) and not (math.isnan(hold_s) or 0.0 <= hold_s <= 1e5):
        return INVALID_PARAM1, f"hold {hold_s:g} s: expected 0 or more"
    if item.has_position:
        away_m = math.hypot(*e7_to_enu(item.x, item.y, home))
        if not away_m <= FARTHEST_M:
            return INVALID_PARAM5_X, f"{away_m / 1000:.0f} km away: set home"
    return ACCEPTED, ""
