"""The geofence in a QGroundControl `.plan`: inclusion and keep-out polygons and circles (docs.qgroundcontrol.com,
"Plan File Format", GeoFence)."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dslam_mav.errors import BadInputError, unreadable
from dslam_mav.mission import DEGREES_E7, Home, e7_to_enu
from missions.fence import Fence, circle, crosses_itself
from missions.plan_fields import Spot
from missions.plan_json import FENCE_VERSION, get, load

Array = NDArray[np.float64]
Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Zone:
    """One polygon's corners, or one circle's centre with its radius: latitude and longitude in degrees."""

    corners: tuple[Place, ...]
    inclusion: bool
    radius_m: float | None = None


@dataclass(frozen=True, slots=True)
class GeoFence:
    """The zones of a file, as in the world; `raw` is what a `.plan` that keeps the fence has to say."""

    zones: tuple[Zone, ...]
    raw: dict[str, Any]
    file: str
    home: Home | None

    def around(self, home: Home) -> Fence:
        """In metres east and north of home; BadInputError where inclusion polygons have no room in common."""
        within = tuple(_outline(zone, home) for zone in self.zones if zone.inclusion)
        keep_out = tuple(_outline(zone, home) for zone in self.zones if not zone.inclusion)
        fence = Fence(within, keep_out)
        if within:
            low, high = fence.extent()
            if not (high > low).all():
                raise BadInputError(f"{self.file}: geoFence: its inclusion zones have no room in common")
        return fence

    def anywhere(self) -> Home:
        """The first zone's first corner: a home where the file has none."""
        return Home(*self.zones[0].corners[0])


def read_fence(path: str | os.PathLike[str], *, needed: bool = True) -> GeoFence:
    """The geofence of a `.plan`; BadInputError names the file, the field and the value, and where one is `needed` and
    there is none.
    """
    source = Path(path)
    try:
        text = source.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise unreadable(source, error) from None
    except UnicodeDecodeError as error:
        raise BadInputError(f"{source}: byte {error.start} is no text: expected a .plan with a geofence") from None
    return parse_fence(text, str(source), needed=needed)


def parse_fence(text: str, file: str, *, needed: bool = True) -> GeoFence:
    """The geofence in a `.plan`'s text."""
    spot = Spot(file)
    root = load(text, file)
    if not needed and "geoFence" not in root:
        return GeoFence((), {}, file, _home(root))
    raw = get(spot, root, "geoFence", dict, "an object")
    inside = spot.at("geoFence.")
    if get(inside, raw, "version", int, str(FENCE_VERSION)) != FENCE_VERSION:
        raise inside.error("version", raw["version"], str(FENCE_VERSION))
    zones = [_polygon(inside, i, each) for i, each in enumerate(_list(inside, raw, "polygons"))]
    zones += [_circle(inside, i, each) for i, each in enumerate(_list(inside, raw, "circles"))]
    if needed and not zones:
        raise spot.error("geoFence", raw, "at least one polygon or circle")
    return GeoFence(tuple(zones), raw, file, _home(root))


def _polygon(spot: Spot, i: int, value: Any) -> Zone:
    at = spot.at(f"polygons[{i}].")
    if not isinstance(value, dict):
        raise spot.error(f"polygons[{i}]", value, "an object")
    corners = get(at, value, "polygon", list, "a list of [latitude, longitude]")
    if len(corners) < 3:
        raise at.error("polygon", corners, f"at least 3 corners, got {len(corners)}")
    places = tuple(_place(at, f"polygon[{j}]", corner) for j, corner in enumerate(corners))
    flat = np.array(places) - np.array(places[0])
    if crosses_itself(flat * [1.0, math.cos(math.radians(places[0][0]))]):
        raise BadInputError(f"{spot.file}: {at.place}polygon: its edges cross: expected corners in order")
    return Zone(places, get(at, value, "inclusion", bool, "true or false"))


def _circle(spot: Spot, i: int, value: Any) -> Zone:
    at = spot.at(f"circles[{i}].")
    if not isinstance(value, dict):
        raise spot.error(f"circles[{i}]", value, "an object")
    shape = get(at, value, "circle", dict, "an object")
    centre = _place(at, "circle.center", shape.get("center"))
    radius = shape.get("radius")
    if isinstance(radius, bool) or not isinstance(radius, int | float) or not 0.0 < radius < 1e6:
        raise at.error("circle.radius", radius, "a positive number of metres")
    return Zone((centre,), get(at, value, "inclusion", bool, "true or false"), float(radius))


def _place(spot: Spot, name: str, value: Any) -> Place:
    right = isinstance(value, list) and len(value) in (2, 3)
    if not right or any(isinstance(n, bool) or not isinstance(n, int | float) for n in value[:2]):
        raise spot.error(name, value, "[latitude, longitude]")
    latitude, longitude = float(value[0]), float(value[1])
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise spot.error(name, value, "degrees of -90 to 90 and -180 to 180")
    return latitude, longitude


def _list(spot: Spot, owner: dict[str, Any], name: str) -> list[Any]:
    value = owner.get(name, [])
    if not isinstance(value, list):
        raise spot.error(name, value, "a list")
    return value


def _home(root: dict[str, Any]) -> Home | None:
    """Where the file says the mission starts; a mission that cannot be read has its own complaints elsewhere."""
    mission = root.get("mission")
    place = mission.get("plannedHomePosition") if isinstance(mission, dict) else None
    if not isinstance(place, list) or len(place) < 2 or not any(place[:2]):
        return None
    try:
        return Home(float(place[0]), float(place[1]), float(place[2] or 0.0) if len(place) > 2 else 0.0)
    except (TypeError, ValueError):
        return None


def _outline(zone: Zone, home: Home) -> Array:
    places = [e7_to_enu(round(lat * DEGREES_E7), round(lon * DEGREES_E7), home) for lat, lon in zone.corners]
    if zone.radius_m is not None:
        return circle(places[0], zone.radius_m, keep_out=not zone.inclusion)
    return np.array(places)
