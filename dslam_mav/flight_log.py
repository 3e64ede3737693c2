"""A flight log as a person opens it: all that `log` reads, with the flight's legs and its mission."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import get_args

from dslam_mav.errors import BadInputError
from dslam_mav.legs import Distance, plan_facts
from dslam_mav.log import reader
from dslam_mav.mission import DEGREES_E7, GLOBAL_FRAMES, Home, Mission, MissionItem, without_home_item
from dslam_mav.records import Flight, Leg
from dslam_mav.replay import flight_from_log, flight_from_packets

_MISSION_ATTACHMENT = "mission.waypoints"
_CONFIGURATION_ATTACHMENT = "configuration.json"


@dataclass(frozen=True, slots=True)
class LoggedFlight(reader.FlightLog):
    """All that a log holds, and what follows from it.

    `legs`: as the estimator on board had them, made with the mission's help and with the distance it was told to use;
    none where the log ends before the first. `mission`: as the vehicle held it, None where the log has none.
    """

    legs: tuple[Leg, ...]
    mission: Mission | None


def read_log(path: Path | str) -> LoggedFlight:
    """The whole of a flight log, cut or complete; BadInputError in one line for what is none."""
    path = Path(path)
    log = reader.read_log(path)
    flown, mission = _flown(log.attachments.get(_CONFIGURATION_ATTACHMENT, b"")), None
    if _MISSION_ATTACHMENT in log.attachments:
        try:
            mission = _mission(log.attachments[_MISSION_ATTACHMENT].decode())
        except (ValueError, OverflowError) as problem:
            raise BadInputError(f"{path}: attachment {_MISSION_ATTACHMENT}: {problem}") from None
        mission = mission if flown.home_item else without_home_item(mission)
    held = {field.name: getattr(log, field.name) for field in fields(log)}
    return LoggedFlight(**held, legs=_legs(log, str(path), mission, flown), mission=mission)


def read_flight(path: Path | str) -> Flight:
    """The flight in a .mcap log, its legs as on board, or in a .tlog; BadInputError says what the log lacks."""
    path = Path(path)
    if path.suffix == ".mcap" and (legs := read_log(path).legs):
        return Flight(legs)
    return flight_from_log(path).flight


@dataclass(frozen=True, slots=True)
class _Flown:
    """What a log's configuration says of how it was flown; `home_item`: the vehicle's mission began with home."""

    system: int | None = None
    distance: Distance | None = None
    home_item: bool = True


def _flown(configuration: bytes) -> _Flown:
    """Of a configuration that is missing or no configuration: nothing."""
    try:
        body = json.loads(configuration)
        system, distance = body.get("vehicle_system"), body["assumptions"].get("distance")
    except (ValueError, KeyError, TypeError, AttributeError):
        return _Flown()
    return _Flown(
        system if type(system) is int else None,
        distance if distance in get_args(Distance) else None,
        body.get("home_item") is not False,
    )


def _legs(log: reader.FlightLog, name: str, mission: Mission | None, flown: _Flown) -> tuple[Leg, ...]:
    plan = None if mission is None else plan_facts(mission)
    try:
        return flight_from_packets(
            log.frames, name, plan=plan, distance=flown.distance, system=flown.system
        ).flight.legs
    except BadInputError:  # says what is lacking for legs; all else in the log is worth having without them
        return ()


def _mission(text: str) -> Mission:
    """The mission in QGC WPL 110 as our logs carry it, home first; ValueError for anything else."""
    header, *lines = text.splitlines() or [""]
    if header != "QGC WPL 110" or not lines:
        raise ValueError(f"{header!r}: expected QGC WPL 110 and a home item")
    items = []
    for number, line in enumerate(lines):
        sequence, _, frame, command, *numbers, autocontinue = line.split("\t")
        if int(sequence) != number:
            raise ValueError(f"sequence {sequence}: expected {number}")
        p1, p2, p3, p4, x, y, z = map(float, numbers)
        unit = DEGREES_E7 if int(frame) in GLOBAL_FRAMES else 1.0
        place = round(x * unit), round(y * unit)
        items.append(MissionItem(int(command), int(frame), (p1, p2, p3, p4), *place, z, autocontinue == "1"))
    return Mission(tuple(items), Home(items[0].x / DEGREES_E7, items[0].y / DEGREES_E7, items[0].z))
