"""One field of one message in a .tlog, as a series: NAMED_VALUE_FLOAT by its name, others by their field."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dslam_mav.errors import BadInputError
from dslam_mav.mav.frames import Frame
from dslam_mav.mav.tlog import read_tlog

_NAMED = "NAMED_VALUE_FLOAT"
_CHOICE = re.compile(r"(?P<type>[A-Z0-9_]+)\.(?P<field>[^@]+)(?:@(?P<system>\d+)/(?P<component>\d+))?")


def samples(path: Path, choice: str) -> Iterator[tuple[float, float]]:
    """(seconds, value) of every message named by `choice`, "TYPE.field[@system/component]".

    Seconds are the sender's clock (`time_boot_ms`, `time_usec`) where a message has it, else the log's.
    BadInputError: no such message or field, or several senders and none chosen.
    """
    match = _CHOICE.fullmatch(choice)
    if match is None:
        raise BadInputError(f"--columns: value={choice}: expected MESSAGE.field, such as {_NAMED}.THERMAL")
    kind, field = match["type"], match["field"]
    sender = None if match["system"] is None else (int(match["system"]), int(match["component"]))
    found: list[tuple[float, float]] = []
    senders: Counter[tuple[int, int]] = Counter()
    kinds: set[str] = set()
    names: set[str] = set()
    for frame in read_tlog(path):
        message = frame.message
        kinds.add(message.get_type())
        if message.get_type() != kind:
            continue
        names.update(_names(message))
        address = (message.get_srcSystem(), message.get_srcComponent())
        value = _value(message, field)
        if value is None or sender not in (None, address):
            continue
        senders[address] += 1
        found.append((_seconds(frame), value))
    if not found:
        there = ", ".join(sorted(names or kinds)) or "no message"
        raise BadInputError(f"{path}: value {choice}: not in this log, it has {there}")
    if len(senders) > 1:
        who = ", ".join(f"{s}/{c}" for s, c in sorted(senders))
        raise BadInputError(f"{path}: value {choice}: several senders, choose with @ one of {who}")
    return iter(found)


def _names(message: Any) -> list[str]:
    kind = message.get_type()
    return [f"{kind}.{message.name}"] if kind == _NAMED else [f"{kind}.{f}" for f in message.get_fieldnames()]


def _value(message: Any, field: str) -> float | None:
    if message.get_type() == _NAMED:
        return float(message.value) if message.name == field else None
    value = getattr(message, field, None) if field in message.get_fieldnames() else None
    return float(value) if isinstance(value, int | float) else None


def _seconds(frame: Frame) -> float:
    message = frame.message
    if hasattr(message, "time_boot_ms"):
        return float(message.time_boot_ms) / 1e3
    if hasattr(message, "time_usec"):
        return float(message.time_usec) / 1e6
    return frame.received_ns / 1e9
