"""A mission as both ends of the wire see it: items of MISSION_ITEM_INT, and the legs they make on the ground.

Horizontal geometry is WGS-84 through `pymap3d`: metres east and north of home on the tangent plane at home.

Autopilots disagree on item 0. ArduPilot, QGC WPL files and Mission Planner keep home there; PX4 has no such
item. Here a mission whose home is known carries it (`with_home_item`); `without_home_item` makes what PX4
takes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pymap3d
from numpy.typing import NDArray

DEGREES_E7 = 1e7

CMD_WAYPOINT = 16
CMD_RETURN_TO_LAUNCH = 20
CMD_LAND = 21
CMD_TAKEOFF = 22
CMD_JUMP = 177
CMD_CHANGE_SPEED = 178

FRAME_GLOBAL = 0
FRAME_MISSION = 2
FRAME_GLOBAL_RELATIVE_ALT = 3
FRAME_GLOBAL_INT = 5
GLOBAL_FRAMES = frozenset({0, 3, 5, 6, 10, 11})
ABSOLUTE_FRAMES = frozenset({FRAME_GLOBAL, FRAME_GLOBAL_INT})

# Waypoints closer than this are one place: five steps of the wire's 1e-7 degrees.
SAME_PLACE_M = 0.05
# An item 0 is the known home if it lies this near to it: the vehicle rounds what it holds.
HOME_MATCH_E7 = 10
HOME_MATCH_M = 0.5


@dataclass(frozen=True, slots=True)
class Home:
    """The place missions and anchored results are measured from, in WGS-84."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.latitude_deg) and abs(self.latitude_deg) <= 90.0):
            raise ValueError(f"home latitude_deg {self.latitude_deg}: expected -90 to 90")
        if not (math.isfinite(self.longitude_deg) and abs(self.longitude_deg) <= 180.0):
            raise ValueError(f"home longitude_deg {self.longitude_deg}: expected -180 to 180")
        if not math.isfinite(self.altitude_m):
            raise ValueError(f"home altitude_m {self.altitude_m}: expected a finite number")


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One item as MISSION_ITEM_INT carries it; its sequence number is its place in the mission.

    `x`, `y` are degrees · 1e7 (latitude, longitude) in a global frame, otherwise params 5 and 6; `z` is
    metres. A parameter that is not set is NaN.
    """

    command: int
    frame: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    autocontinue: bool = True

    @property
    def has_position(self) -> bool:
        """Whether x and y are a place on the ground (0, 0 means "here")."""
        return self.frame in GLOBAL_FRAMES and (self.x, self.y) != (0, 0)


@dataclass(frozen=True, slots=True)
class Mission:
    """The items to upload, and the home they were planned from (None: unknown)."""

    items: tuple[MissionItem, ...]
    home: Home | None = None

    def waypoints(self) -> tuple[tuple[int, MissionItem], ...]:
        """(sequence number, item) of every NAV_WAYPOINT with a position but the home item: the path flown."""
        first = 1 if has_home_item(self) else 0
        return tuple(
            (q, i) for q, i in enumerate(self.items) if q >= first and i.command == CMD_WAYPOINT and i.has_position
        )


def home_item(home: Home) -> MissionItem:
    """Home as ArduPilot's item 0: a waypoint at absolute altitude."""
    x, y = round(home.latitude_deg * DEGREES_E7), round(home.longitude_deg * DEGREES_E7)
    return MissionItem(CMD_WAYPOINT, FRAME_GLOBAL, (0.0, 0.0, 0.0, 0.0), x, y, float(home.altitude_m))


def has_home_item(mission: Mission) -> bool:
    """Whether item 0 is home and not a place to fly to.

    With a known home: a waypoint at absolute altitude at that very place. Without (a mission read back from a
    vehicle): a waypoint at absolute altitude that a take-off or items at relative altitudes follow.
    """
    if not mission.items:
        return False
    first, rest = mission.items[0], mission.items[1:]
    if first.command != CMD_WAYPOINT or first.frame not in ABSOLUTE_FRAMES:
        return False
    if mission.home is not None:
        expected = home_item(mission.home)
        near = max(abs(first.x - expected.x), abs(first.y - expected.y)) <= HOME_MATCH_E7
        return near and abs(first.z - expected.z) <= HOME_MATCH_M
    relative = GLOBAL_FRAMES - ABSOLUTE_FRAMES
    return bool(rest) and (rest[0].command == CMD_TAKEOFF or any(i.frame in relative for i in rest))


def home_of(mission: Mission) -> Home | None:
    """Where the mission is measured from: its home, home item or first place (None: has none)."""
    if mission.home is not None:
        return mission.home
    if has_home_item(mission):
        first = mission.items[0]
        return Home(first.x / DEGREES_E7, first.y / DEGREES_E7, first.z)
    waypoints = mission.waypoints()
    placed = [i for _, i in waypoints] or [i for i in mission.items if i.has_position]
    return Home(placed[0].x / DEGREES_E7, placed[0].y / DEGREES_E7) if placed else None


def with_home_item(mission: Mission, home: Home | None = None) -> Mission:
    """The mission with home as item 0 (ArduPilot, QGC WPL); unchanged where it is there already.

    `home` stands in where the mission knows none, or else its first place. ValueError where no place is
    known.
    """
    if has_home_item(mission):
        return replace(mission, home=home_of(mission))
    place = mission.home or home or home_of(mission)
    if place is None:
        raise ValueError("home: the mission has no position to take it from")
    return with_home_before(mission.items, place)


def with_home_before(items: Sequence[MissionItem], home: Home) -> Mission:
    """The mission of a home item and then all of `items`, whatever the first of them looks like."""
    return Mission((home_item(home), *_jumps_moved(items, 1)), home)


def without_home_item(mission: Mission) -> Mission:
    """The mission without its home item (PX4, QGroundControl's items); its `home` stays known."""
    if not has_home_item(mission):
        return mission
    return Mission(_jumps_moved(mission.items[1:], -1), home_of(mission))


def moved_to(mission: Mission, home: Home) -> Mission:
    """The mission as it would be flown from another home: every place as far east and north of that one.

    ValueError where the mission knows no home of its own.
    """
    before = home_of(mission)
    if before is None:
        raise ValueError("home: the mission has no position to move it from")
    items = [_moved_item(item, before, home) for item in mission.items]
    if has_home_item(mission):
        items[0] = home_item(home)
    return Mission(tuple(items), home)


def _moved_item(item: MissionItem, before: Home, home: Home) -> MissionItem:
    if not item.has_position:
        return item
    x, y = enu_to_e7(*e7_to_enu(item.x, item.y, before), home)
    higher_m = home.altitude_m - before.altitude_m if item.frame in ABSOLUTE_FRAMES else 0.0
    return replace(item, x=x, y=y, z=item.z + higher_m)


def _jumps_moved(items: Sequence[MissionItem], by: int) -> tuple[MissionItem, ...]:
    """Items whose DO_JUMP targets follow when everything moves `by` places."""
    return tuple(replace(i, params=(i.params[0] + by, *i.params[1:])) if i.command == CMD_JUMP else i for i in items)


def enu_to_e7(east_m: float, north_m: float, home: Home) -> tuple[int, int]:
    """Metres from home -> (latitude, longitude) in degrees · 1e7, as the wire carries them (1 cm steps)."""
    latitude_deg, longitude_deg, _ = pymap3d.enu2geodetic(
        east_m, north_m, 0.0, home.latitude_deg, home.longitude_deg, 0.0
    )
    return round(float(latitude_deg) * DEGREES_E7), round(float(longitude_deg) * DEGREES_E7)


def e7_to_enu(x: int, y: int, home: Home) -> tuple[float, float]:
    """(latitude, longitude) in degrees · 1e7 -> metres east and north of home."""
    east_m, north_m, _ = pymap3d.geodetic2enu(
        x / DEGREES_E7, y / DEGREES_E7, 0.0, home.latitude_deg, home.longitude_deg, 0.0
    )
    return float(east_m), float(north_m)


def vertices_enu_m(items: Sequence[MissionItem], home: Home) -> NDArray[np.float64]:
    """(V, 2) places of the items in metres east and north of home."""
    return np.array([e7_to_enu(i.x, i.y, home) for i in items], dtype=np.float64).reshape(-1, 2)


@dataclass(frozen=True, slots=True, eq=False)
class LegPlan:
    """The legs of a plan: `vertices_m` (V, 2) east and north of home, and each vertex's sequence number (V,).

    Leg j goes from vertex j to vertex j+1: it begins when `sequence[j]` is reached (and left) and ends when
    `sequence[j + 1]` is reached. A waypoint at the place of the one before it makes no leg and is not here.
    """

    sequence: tuple[int, ...]
    vertices_m: NDArray[np.float64]

    @property
    def lengths_m(self) -> NDArray[np.float64]:
        """(V-1,) lengths of the legs."""
        return np.asarray(np.linalg.norm(np.diff(self.vertices_m, axis=0), axis=1), dtype=np.float64)

    @property
    def headings_rad(self) -> NDArray[np.float64]:
        """(V-1,) directions of the legs, counter-clockwise from east."""
        step = np.diff(self.vertices_m, axis=0)
        return np.asarray(np.arctan2(step[:, 1], step[:, 0]), dtype=np.float64)


def leg_plan(mission: Mission) -> LegPlan:
    """The legs of any mission in global frames; `leg_vertices` says what counts as a vertex."""
    waypoints, home = mission.waypoints(), home_of(mission)
    if home is None or not waypoints:
        return LegPlan((), np.empty((0, 2)))
    places = vertices_enu_m([i for _, i in waypoints], home)
    kept = [0]
    for j in range(1, len(places)):
        if np.linalg.norm(places[j] - places[kept[-1]]) >= SAME_PLACE_M:
            kept.append(j)
    return LegPlan(tuple(waypoints[j][0] for j in kept), places[kept])


def leg_vertices(mission: Mission) -> NDArray[np.float64]:
    """(V, 2) vertices flown, metres east and north of the mission's home (or else of its first waypoint).

    Every NAV_WAYPOINT with a place counts, but the home item, and those within 5 cm of the one before.
    """
    return leg_plan(mission).vertices_m
