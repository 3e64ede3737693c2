"""Vertices and a home position -> the mission to upload.

The layout is the one ArduPilot and PX4 both fly (home, take-off, speed, a waypoint for every vertex,
landing); for PX4 `dslam_mav.mission.without_home_item` takes the first item away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from dslam_mav.errors import BadInputError
from dslam_mav.mission import (
    CMD_CHANGE_SPEED,
    CMD_LAND,
    CMD_RETURN_TO_LAUNCH,
    CMD_TAKEOFF,
    CMD_WAYPOINT,
    FRAME_GLOBAL_RELATIVE_ALT,
    FRAME_MISSION,
    SAME_PLACE_M,
    Home,
    Mission,
    MissionItem,
    enu_to_e7,
    with_home_item,
)

_UNSET = math.nan
_GROUND_SPEED = 1.0
_THROTTLE_UNCHANGED = -1.0
# The tangent plane is 1 cm off there.
FURTHEST_M = 10_000.0


@dataclass(frozen=True, slots=True)
class Profile:
    """How a path is flown: height above home, speed, the wait at each corner, and how it ends.

    With `hold_s` 0 a real copter cuts its corners by metres; with a hold of 1 s it passes within 6 cm.
    `accept_m` is the radius at which a corner counts as reached: PX4 needs a small one, ArduPilot keeps its
    own (0). `take_off` is False for a rover.
    """

    altitude_m: float = 10.0
    speed_m_s: float = 2.0
    hold_s: float = 1.0
    ending: Literal["land", "rtl", "none"] = "land"
    take_off: bool = True
    accept_m: float = 0.0

    def __post_init__(self) -> None:
        lowest_m = 0.1 if self.take_off else 0.0
        if not lowest_m <= self.altitude_m <= 10_000.0:
            raise BadInputError(f"altitude {self.altitude_m:g} m: expected {lowest_m:g} to 10000 m above home")
        if not 0.01 <= self.speed_m_s <= 100.0:
            raise BadInputError(f"speed {self.speed_m_s:g} m/s: expected 0.01 to 100 m/s")
        if not (0.0 <= self.hold_s <= 3600.0 and float(self.hold_s).is_integer()):
            # ArduPilot stores whole seconds, and would silently cut the rest off.
            raise BadInputError(f"hold {self.hold_s:g} s: expected whole seconds from 0 to 3600")
        if self.ending not in ("land", "rtl", "none"):
            raise BadInputError(f"ending {self.ending!r}: expected land, rtl or none")
        if not 0.0 <= self.accept_m <= 1000.0:
            raise BadInputError(f"acceptance radius {self.accept_m:g} m: expected 0 to 1000 m")


def plan_mission(vertices_m: ArrayLike, home: Home, profile: Profile | None = None) -> Mission:
    """The mission that flies `vertices_m` (V, 2), metres east and north of home, V ≥ 2; item 0 is home. A third column
    is metres above the profile's altitude.

    BadInputError on a leg too short to have a direction, or a vertex too far from home; ValueError on a
    shape.
    """
    how = Profile() if profile is None else profile
    vertices = np.asarray(vertices_m, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[1] not in (2, 3) or len(vertices) < 2:
        raise ValueError(f"vertices_m: expected shape (2 or more, 2 or 3), got {vertices.shape}")
    _check_vertices(vertices[:, :2])
    places = [enu_to_e7(east_m, north_m, home) for east_m, north_m in vertices[:, :2]]
    higher = vertices[:, 2] if vertices.shape[1] == 3 else np.zeros(len(vertices))
    if (0, 0) in places:
        raise BadInputError(
            f"vertex {places.index((0, 0))} at 0, 0 degrees: an autopilot reads that as no position, move it"
        )
    waypoints = [_waypoint(place, how, float(up)) for place, up in zip(places, higher, strict=True)]
    items = [*_start(home, how), *waypoints, *_end(places[-1], how)]
    return with_home_item(Mission(tuple(items), home))


def _check_vertices(vertices_m: np.ndarray) -> None:
    far = ~(np.linalg.norm(vertices_m, axis=1) <= FURTHEST_M)
    if far.any():
        j = int(np.flatnonzero(far)[0])
        east_m, north_m = vertices_m[j]
        raise BadInputError(f"vertex {j} at {east_m:g}, {north_m:g} m: expected at most {FURTHEST_M:g} m from home")
    short = np.linalg.norm(np.diff(vertices_m, axis=0), axis=1) < SAME_PLACE_M
    if short.any():
        raise BadInputError(f"leg {int(np.flatnonzero(short)[0])}: shorter than {SAME_PLACE_M:g} m")


def _start(home: Home, how: Profile) -> list[MissionItem]:
    speed = MissionItem(
        CMD_CHANGE_SPEED,
        FRAME_MISSION,
        (_GROUND_SPEED, float(how.speed_m_s), _THROTTLE_UNCHANGED, 0.0),
        0,
        0,
        0.0,
    )
    if not how.take_off:
        return [speed]
    x, y = enu_to_e7(0.0, 0.0, home)
    unset = (0.0, 0.0, 0.0, _UNSET)
    altitude_m = _altitude_m(how)
    return [MissionItem(CMD_TAKEOFF, FRAME_GLOBAL_RELATIVE_ALT, unset, x, y, altitude_m), speed]


def _waypoint(place: tuple[int, int], how: Profile, higher_m: float) -> MissionItem:
    params = (float(how.hold_s), float(how.accept_m), 0.0, _UNSET)
    return MissionItem(CMD_WAYPOINT, FRAME_GLOBAL_RELATIVE_ALT, params, *place, _altitude_m(how, higher_m))


def _end(last: tuple[int, int], how: Profile) -> list[MissionItem]:
    if how.ending == "land":
        return [MissionItem(CMD_LAND, FRAME_GLOBAL_RELATIVE_ALT, (0.0, 0.0, 0.0, _UNSET), *last, 0.0)]
    if how.ending == "rtl":
        return [MissionItem(CMD_RETURN_TO_LAUNCH, FRAME_MISSION, (0.0, 0.0, 0.0, 0.0), 0, 0, 0.0)]
    return []


def _altitude_m(how: Profile, higher_m: float = 0.0) -> float:
    """Whole centimetres, which is what ArduPilot keeps."""
    return round(float(how.altitude_m) + higher_m, 2)
