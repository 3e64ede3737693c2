"""QGroundControl `.plan`: JSON, file version 1, mission version 2 (docs.qgroundcontrol.com, "Plan File
Format").

Home stands apart from the items there; in a `Mission` it is item 0. A survey and its kin are complex items
that carry the simple items they were expanded to: those are taken.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from typing import Any

from dslam_mav.errors import BadInputError
from dslam_mav.mission import (
    CMD_CHANGE_SPEED,
    CMD_JUMP,
    CMD_LAND,
    CMD_TAKEOFF,
    CMD_WAYPOINT,
    DEGREES_E7,
    GLOBAL_FRAMES,
    Home,
    Mission,
    MissionItem,
    home_of,
    with_home_before,
    without_home_item,
)
from dslam_mav.records.words import count
from missions.plan_fields import MOST_ITEMS, ItemMaker, Spot

FILE_VERSION = 1
MISSION_VERSION = 2
FENCE_VERSION = 2
_ARDUPILOT = 3
_QUADROTOR = 2
_PARAMS = tuple(f"params[{j}]" for j in range(7))
# The *_INT frames are other names for these on the wire; QGroundControl knows only these.
_PLAIN_FRAME = {5: 0, 6: 3, 11: 10}
_ALTITUDE_MODE = {0: 2, 3: 1, 10: 4}  # absolute, relative to home, above terrain
_WITH_ALTITUDE = frozenset({CMD_WAYPOINT, CMD_TAKEOFF, CMD_LAND})


def parse(text: str, file: str) -> tuple[Mission, tuple[str, ...], dict[str, Any] | None]:
    """The mission in a `.plan`'s text, notes, its `geoFence` as it is; BadInputError names file, field and value."""
    spot = Spot(file)
    root = load(text, file)
    if get(spot, root, "fileType", str, '"Plan"') != "Plan":
        raise spot.error("fileType", root["fileType"], '"Plan"')
    _version(spot, root, FILE_VERSION)
    mission = get(spot, root, "mission", dict, "an object")
    inside = spot.at("mission.")
    _version(inside, mission, MISSION_VERSION)
    reader = _Reader(ItemMaker(_PARAMS))
    reader.read_all(inside, "items", get(inside, mission, "items", list, "a list of items"))
    if not reader.items:
        raise inside.error("items", [], "at least one item")
    home = _home(inside, mission, reader.maker.notes)
    found = reader.resolved()
    mission_read = Mission(found) if home is None else with_home_before(found, home)
    fence = root.get("geoFence")
    return mission_read, tuple(reader.maker.notes), fence if isinstance(fence, dict) else None


def text_of(mission: Mission, fence: dict[str, Any] | None = None) -> str:
    """The mission as `.plan` text, with the `geoFence` object given; one without any known place is a ValueError."""
    home = home_of(mission)
    if home is None:
        raise ValueError("home: the mission has no position to take it from")
    items = without_home_item(mission).items
    speeds = [i.params[1] for i in items if i.command == CMD_CHANGE_SPEED and i.params[1] > 0.0]
    speed = max(1, round(speeds[0])) if speeds else 5  # Mission Planner reads whole numbers only
    plan = {
        "fileType": "Plan",
        "geoFence": fence or {"circles": [], "polygons": [], "version": FENCE_VERSION},
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": speed,
            "firmwareType": _ARDUPILOT,
            "globalPlanAltitudeMode": 1,
            "hoverSpeed": speed,
            "items": [_item_json(q, item) for q, item in enumerate(items)],
            "plannedHomePosition": [home.latitude_deg, home.longitude_deg, home.altitude_m],
            "vehicleType": _QUADROTOR,
            "version": MISSION_VERSION,
        },
        "rallyPoints": {"points": [], "version": FENCE_VERSION},
        "version": FILE_VERSION,
    }
    return json.dumps(plan, indent=4, allow_nan=False) + "\n"


def _item_json(position: int, item: MissionItem) -> dict[str, Any]:
    frame = _PLAIN_FRAME.get(item.frame, item.frame)
    place = [item.x, item.y] if frame not in GLOBAL_FRAMES else [item.x / DEGREES_E7, item.y / DEGREES_E7]
    params = [_short(p) for p in item.params]
    if item.command == CMD_JUMP and params[0] is not None:
        params[0] += 1  # it names a doJumpId
    altitude_m = _short(item.z) or 0
    written: dict[str, Any] = {}
    if item.command in _WITH_ALTITUDE and frame in _ALTITUDE_MODE:
        # QGroundControl wants these three together or not at all.
        written = {
            "AMSLAltAboveTerrain": None,
            "Altitude": altitude_m,
            "AltitudeMode": _ALTITUDE_MODE[frame],
        }
    return written | {
        "autoContinue": item.autocontinue,
        "command": item.command,
        "doJumpId": position + 1,
        "frame": frame,
        "params": [*params, *place, altitude_m],
        "type": "SimpleItem",
    }


def _short(number: float) -> float | int | None:
    if not math.isfinite(number):
        return None
    return int(number) if float(number).is_integer() and abs(number) < 1e15 else number


@dataclass(slots=True)
class _Reader:
    """The simple items in file order, and the doJumpId each is called by."""

    maker: ItemMaker
    items: list[MissionItem] = field(default_factory=list)
    spots: list[Spot] = field(default_factory=list)
    place_of_id: dict[int, int] = field(default_factory=dict)

    def read_all(self, spot: Spot, name: str, items: list[Any]) -> None:
        for j, item in enumerate(items):
            self.read(spot.at(f"{name}[{j}]"), item)

    def read(self, spot: Spot, item: Any) -> None:
        if not isinstance(item, dict):
            raise spot.error("", item, "an object")
        inside = spot.at(".")
        kind = get(inside, item, "type", str, "SimpleItem or ComplexItem")
        if kind == "SimpleItem":
            self._simple(inside, item)
        elif kind == "ComplexItem":
            self._complex(inside, item)
        else:
            raise inside.error("type", kind, "SimpleItem or ComplexItem")

    def _simple(self, spot: Spot, item: dict[str, Any]) -> None:
        if len(self.items) >= MOST_ITEMS:
            raise spot.error("doJumpId", len(self.items) + 1, f"at most {MOST_ITEMS} items")
        params = get(spot, item, "params", list, "a list of 7 numbers")
        if len(params) != 7:
            raise spot.error("params", params, f"7 numbers, got {len(params)}")
        for name, number in zip(_PARAMS, params, strict=True):
            if number is not None and (isinstance(number, bool) or not isinstance(number, int | float)):
                raise spot.error(name, number, "a number or null")
        command = get(spot, item, "command", int, "a command's number")
        frame = get(spot, item, "frame", int, "a frame's number")
        autocontinue = get(spot, item, "autoContinue", bool, "true or false")
        jump_id = get(spot, item, "doJumpId", int, "a whole number") if "doJumpId" in item else len(self.items) + 1
        self.place_of_id.setdefault(jump_id, len(self.items))
        self.items.append(self.maker.make(spot, command, frame, params, autocontinue))
        self.spots.append(spot)

    def _complex(self, spot: Spot, item: dict[str, Any]) -> None:
        kind = get(spot, item, "complexItemType", str, "a name")
        style = item.get("TransectStyleComplexItem")
        inner = style.get("Items") if isinstance(style, dict) else None
        if not isinstance(inner, list) or not inner:
            raise spot.error("complexItemType", kind, "one that carries its own items, as a survey does")
        before = len(self.items)
        self.read_all(spot.at("TransectStyleComplexItem."), "Items", inner)
        made = count(len(self.items) - before, "item")
        self.maker.notes.append(f"{spot.place[:-1]}: the {kind} is taken as the {made} it expands to")

    def resolved(self) -> tuple[MissionItem, ...]:
        """The items with every DO_JUMP naming a place among them (from 0) instead of a doJumpId."""
        out = []
        for item, spot in zip(self.items, self.spots, strict=True):
            if item.command == CMD_JUMP:
                target = item.params[0]
                if target not in self.place_of_id:  # a float equals its int; NaN equals nothing
                    raise spot.error("params[0]", target, "the doJumpId of an item")
                place = float(self.place_of_id[int(target)])
                out.append(replace(item, params=(place, *item.params[1:])))
            else:
                out.append(item)
        return tuple(out)


def _home(spot: Spot, mission: dict[str, Any], notes: list[str]) -> Home | None:
    place = mission.get("plannedHomePosition")
    if place is None:
        return None
    name = "plannedHomePosition"
    if not isinstance(place, list) or len(place) != 3:
        raise spot.error(name, place, "[latitude, longitude, altitude]")
    for number in place:
        if number is not None and (isinstance(number, bool) or not isinstance(number, int | float)):
            raise spot.error(name, number, "[latitude, longitude, altitude]")
    latitude, longitude, altitude = place
    if (latitude or 0.0) == 0.0 and (longitude or 0.0) == 0.0:
        notes.append(f"{spot.place}{name} is not set: the first waypoint stands in for home")
        return None
    try:
        return Home(float(latitude), float(longitude), float(altitude or 0.0))
    except (TypeError, ValueError, OverflowError):
        raise spot.error(name, place, "degrees of -90 to 90 and -180 to 180, and metres") from None


def load(text: str, file: str) -> dict[str, Any]:
    """The JSON object in a file's text; BadInputError names what is none."""
    try:
        root = json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise BadInputError(f"{file}: line {error.lineno} column {error.colno}: bad JSON: {error.msg}") from None
    except _NoJsonNumberError as error:
        raise BadInputError(f"{file}: {error}: JSON has no such number, expected null") from None
    except (RecursionError, ValueError):
        raise BadInputError(f"{file}: bad JSON: too deep, or a number too long") from None
    if not isinstance(root, dict):
        raise BadInputError(f"{file}: expected a JSON object")
    return root


class _NoJsonNumberError(Exception):
    pass


def _refuse_constant(name: str) -> None:
    raise _NoJsonNumberError(name)


def get(spot: Spot, owner: dict[str, Any], name: str, kind: type, expected: str) -> Any:
    """A field of the right kind; BadInputError where it is missing or another."""
    if name not in owner:
        raise spot.missing(name, expected)
    value = owner[name]
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise spot.error(name, value, expected)
    return value


def _version(spot: Spot, owner: dict[str, Any], supported: int) -> None:
    if get(spot, owner, "version", int, str(supported)) != supported:
        raise spot.error("version", owner["version"], str(supported))
