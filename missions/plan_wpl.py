"""QGC WPL 110 (`.waypoints`, `.txt`): one item a line, 12 fields (mavlink.io, "File Formats").

Line 0 of version 110 is home. Some writers leave it out and begin with the take-off, and version 120 has
none: both are read as missions without a known home. What is written always has it.
"""

from __future__ import annotations

import math

from dslam_mav.errors import BadInputError
from dslam_mav.mission import (
    ABSOLUTE_FRAMES,
    CMD_WAYPOINT,
    DEGREES_E7,
    GLOBAL_FRAMES,
    Home,
    Mission,
    MissionItem,
    with_home_item,
)
from missions.plan_fields import MOST_ITEMS, ItemMaker, Spot, shown

HEADER = "QGC WPL"
_WITH_HOME, _WITHOUT_HOME = "110", "120"
_FIELDS = (
    "sequence",
    "current",
    "frame",
    "command",
    "param 1",
    "param 2",
    "param 3",
    "param 4",
    "x (latitude)",
    "y (longitude)",
    "z (altitude)",
    "autocontinue",
)


def parse(text: str, file: str) -> tuple[Mission, tuple[str, ...]]:
    """The mission in the text of a WPL file, and notes; BadInputError names file, line, field and value."""
    lines = text.splitlines()
    version = lines[0].split()[2:] if lines else []
    if version not in ([_WITH_HOME], [_WITHOUT_HOME]):
        raise BadInputError(f"{file}: line 1 {shown(lines[0] if lines else '')}: expected {HEADER} {_WITH_HOME}")
    maker = ItemMaker(_FIELDS[4:11])
    items: list[MissionItem] = []
    for number, line in enumerate(lines[1:], start=2):
        if line.strip() and not line.lstrip().startswith("#"):
            items.append(_item(Spot(file, f"line {number}, "), line, len(items), maker))
    if not items:
        raise BadInputError(f"{file}: expected at least one item after the first line")
    first = items[0]
    home = None
    if version == [_WITH_HOME] and first.command == CMD_WAYPOINT and first.frame in ABSOLUTE_FRAMES:
        home = Home(first.x / DEGREES_E7, first.y / DEGREES_E7, first.z)
    return Mission(tuple(items), home), tuple(maker.notes)


def text_of(mission: Mission) -> str:
    """The mission as QGC WPL 110 text, home first; a mission without any known place is a ValueError."""
    lines = [
        f"{HEADER} {_WITH_HOME}",
        *map(_line, *zip(*enumerate(with_home_item(mission).items), strict=True)),
    ]
    return "\n".join(lines) + "\n"


def _item(spot: Spot, line: str, expected_sequence: int, maker: ItemMaker) -> MissionItem:
    fields = line.split()
    if len(fields) != len(_FIELDS):
        raise BadInputError(f"{spot.file}: {spot.place}{len(fields)} fields: expected {len(_FIELDS)}")
    if expected_sequence >= MOST_ITEMS:
        raise spot.error("sequence", fields[0], f"at most {MOST_ITEMS} items")
    sequence, _, frame, command = (_whole(spot, _FIELDS[j], fields[j]) for j in range(4))
    if sequence != expected_sequence:
        raise spot.error("sequence", sequence, f"{expected_sequence}")
    numbers = [_number(spot, _FIELDS[j], fields[j]) for j in range(4, 11)]
    autocontinue = _whole(spot, _FIELDS[11], fields[11])
    if autocontinue not in (0, 1):
        raise spot.error(_FIELDS[11], autocontinue, "0 or 1")
    return maker.make(spot, command, frame, numbers, autocontinue == 1)


def _whole(spot: Spot, name: str, text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise spot.error(name, text, "a whole number") from None


def _number(spot: Spot, name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise spot.error(name, text, "a number") from None


def _line(sequence: int, item: MissionItem) -> str:
    if item.frame in GLOBAL_FRAMES:
        place = [f"{item.x / DEGREES_E7:.7f}", f"{item.y / DEGREES_E7:.7f}"]
    else:
        place = [str(item.x), str(item.y)]
    numbers = [*map(_text, item.params), *place, _text(item.z)]
    current = 1 if sequence == 0 else 0
    head = [sequence, current, item.frame, item.command]
    return "\t".join([*map(str, head), *numbers, str(int(item.autocontinue))])


def _text(number: float) -> str:
    """The shortest text that reads back as the same number; every reader of the format knows "NaN"."""
    if math.isnan(number):
        return "NaN"
    return str(int(number)) if float(number).is_integer() and abs(number) < 1e15 else repr(float(number))
