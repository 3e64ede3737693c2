"""What every mission file must hold, whatever its format: an item's checked numbers, one-line complaints."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from dslam_mav.errors import BadInputError
from dslam_mav.mission import CMD_WAYPOINT, DEGREES_E7, FRAME_MISSION, GLOBAL_FRAMES, MissionItem

_INT32 = 2**31 - 1
_FLOAT32 = (2.0 - 2.0**-23) * 2.0**127  # the largest
_FRAMES = sorted({FRAME_MISSION, *GLOBAL_FRAMES})
_SHOWN = 40
MOST_ITEMS = 65_534  # MISSION_COUNT is a uint16, and home may come on top


@dataclass(frozen=True, slots=True)
class Spot:
    """A place in a file, for a person to find: the file's name and what leads to a field there."""

    file: str
    place: str = ""

    def at(self, place: str) -> Spot:
        """A place further in."""
        return Spot(self.file, self.place + place)

    def error(self, name: str, value: object, expected: str) -> BadInputError:
        """One line: file, place and field, the value as it stands there, and what would be right."""
        return BadInputError(f"{self.file}: {self.place}{name} {shown(value)}: expected {expected}")

    def missing(self, name: str, expected: str) -> BadInputError:
        """One line for a field that is not there."""
        return BadInputError(f"{self.file}: {self.place}{name} is missing: expected {expected}")


def shown(value: object) -> str:
    """A value as a file holds it, on one line and never long."""
    try:
        text = value if isinstance(value, str) and value.isprintable() else json.dumps(value)
    except (TypeError, ValueError):
        text = repr(value)
    text = " ".join(text.split()) or '""'
    return text if len(text) <= _SHOWN else text[: _SHOWN - 1] + "…"


@dataclass(slots=True)
class ItemMaker:
    """Turns seven numbers and their command into a MissionItem; gathers notes on what could not be kept."""

    names: Sequence[str]
    notes: list[str] = field(default_factory=list)

    def make(
        self, spot: Spot, command: int, frame: int, numbers: Sequence[float | None], autocontinue: bool
    ) -> MissionItem:
        """One item from its params 1 to 7 (None: not set); BadInputError names the first that is wrong."""
        if not 0 <= command <= 0xFFFF:
            raise spot.error("command", command, "0 to 65535")
        if frame not in _FRAMES:
            known = ", ".join(map(str, _FRAMES))
            raise spot.error("frame", frame, f"a global or mission frame ({known})")
        for name, number in zip(self.names, numbers, strict=True):
            if number is not None and abs(number) > _FLOAT32:  # NaN passes: it means "not set"
                raise spot.error(name, number, "a finite number that fits 32 bits")
        p1, p2, p3, p4 = (math.nan if n is None or math.isnan(n) else float(n) for n in numbers[:4])
        x, y = (self._place(spot, 4 + j, command, frame, numbers[4 + j]) for j in (0, 1))
        z = numbers[6]
        if z is None or math.isnan(z):
            if command == CMD_WAYPOINT:
                raise spot.error(self.names[6], z, "an altitude in metres")
            z = 0.0
        return MissionItem(command, frame, (p1, p2, p3, p4), x, y, float(z), autocontinue)

    def _place(self, spot: Spot, j: int, command: int, frame: int, number: float | None) -> int:
        """Param 5 or 6 as the wire's int32: degrees · 1e7 in a global frame, a whole number otherwise."""
        name = self.names[j]
        if number is None or math.isnan(number):
            if command == CMD_WAYPOINT:
                raise spot.error(name, None, "degrees")
            return 0
        if frame in GLOBAL_FRAMES:
            limit = 90 if j == 4 else 180
            if abs(number) > limit:
                kind = "latitude" if j == 4 else "longitude"
                raise spot.error(name, number, f"a {kind} of -{limit} to {limit} degrees")
            return round(number * DEGREES_E7)
        if abs(number) > _INT32:
            raise spot.error(name, number, f"a whole number of at most {_INT32} either way")
        if not float(number).is_integer():
            self.notes.append(f"{spot.place}{name} {number:g} is carried as a whole number: {int(number)}")
        return int(number)
