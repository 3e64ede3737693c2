"""Mission files: QGroundControl `.plan` and QGC WPL 110. Written by the file's ending, read by its content.

A mission that is read carries home as item 0 where the file knows home, so what one format holds the other
holds too.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dslam_mav.errors import BadInputError, unreadable
from dslam_mav.files import check_output, write_whole
from dslam_mav.mission import Mission, has_home_item
from missions import plan_json, plan_wpl
from missions.plan_fields import shown

_WRITERS: dict[str, Callable[[Mission], str]] = {
    ".plan": plan_json.text_of,
    ".waypoints": plan_wpl.text_of,
    ".txt": plan_wpl.text_of,
}
_LARGEST_BYTES = 64 * 2**20


@dataclass(frozen=True, slots=True)
class PlanFile:
    """A mission as read, notes: a sentence for each thing that was changed, and the `geoFence` object a `.plan` has."""

    mission: Mission
    notes: tuple[str, ...] = ()
    fence: dict[str, Any] | None = None


def parse_plan(data: bytes, name: str) -> PlanFile:
    """A mission file's bytes -> its mission; BadInputError names `name`, the field or line, and the value."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BadInputError(f"{name}: byte {error.start} is no text: expected a .plan or QGC WPL file") from None
    start = text.lstrip()
    if start.startswith("{"):
        return PlanFile(*plan_json.parse(text, name))
    if start.startswith(plan_wpl.HEADER):
        return PlanFile(*plan_wpl.parse(start, name))
    first = start.splitlines()[0] if start else ""
    raise BadInputError(f'{name}: begins with {shown(first)}: expected a .plan (JSON) or "{plan_wpl.HEADER} 110"')


def read_plan(path: str | os.PathLike[str]) -> PlanFile:
    """The mission in a file of either format; BadInputError names the file, field or line, and value."""
    source = Path(path)
    try:
        with source.open("rb") as stream:
            data = stream.read(_LARGEST_BYTES + 1)
    except OSError as error:
        raise unreadable(source, error) from None
    if len(data) > _LARGEST_BYTES:
        raise BadInputError(f"{source}: more than {_LARGEST_BYTES} bytes: expected a mission file")
    return parse_plan(data, str(source))


def plan_bytes(mission: Mission, ending: str = ".plan", fence: dict[str, Any] | None = None) -> bytes:
    """The mission as a file of this ending holds it, a `.plan` with the `geoFence` object given; BadInputError on an
    unknown ending or no items.
    """
    writer = _WRITERS.get(ending.lower())
    if writer is None:
        raise BadInputError(_unknown(ending))
    if len(mission.items) <= has_home_item(mission):
        raise BadInputError("the mission is empty: expected at least one item to write")
    try:
        text = plan_json.text_of(mission, fence) if writer is plan_json.text_of else writer(mission)
        return text.encode("utf-8")
    except ValueError:
        raise BadInputError("the mission has no home and no position: expected one to write it") from None


def check_plan_output(path: str | os.PathLike[str]) -> None:
    """Before there is a mission to write: BadInputError where the file could not be, or its ending says no format."""
    target = Path(path)
    if target.suffix.lower() not in _WRITERS:
        raise BadInputError(f"{target}: {_unknown(target.suffix)}")
    check_output(target)


def write_plan(path: str | os.PathLike[str], mission: Mission, fence: dict[str, Any] | None = None) -> None:
    """Write `.plan`, `.waypoints` or `.txt`, whole or not at all; BadInputError names the file and why."""
    target = Path(path)
    try:
        data = plan_bytes(mission, target.suffix, fence)
    except BadInputError as error:
        raise BadInputError(f"{target}: {error}") from None
    write_whole(target, data)


def _unknown(ending: str) -> str:
    return f"ending {ending!r}: expected .plan (QGroundControl), .waypoints or .txt (QGC WPL 110)"
