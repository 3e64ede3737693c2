"""The mission that a recording's packets tell of: uploaded or downloaded while somebody logged. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, Frame
from dslam_mav.mav.mission.messages import from_message
from dslam_mav.mav.mission.protocol import ACCEPTED, Ack, Count, Item
from dslam_mav.mission import Mission, MissionItem


class _Transfer:
    """One way: items from the vehicle (a download), or to it (an upload, which counts once it is acknowledged)."""

    def __init__(self) -> None:
        self._count = 0
        self._items: dict[int, MissionItem] = {}

    def take(self, record: Count | Item) -> None:
        if isinstance(record, Count):
            self._count, self._items = record.count, {}
        elif record.seq < self._count:
            self._items[record.seq] = record.item

    def whole(self) -> Mission | None:
        if not self._count or len(self._items) < self._count:
            return None
        return Mission(tuple(self._items[seq] for seq in range(self._count)))


def mission_heard(frames: Iterable[Frame], system: int) -> Mission | None:
    """The last mission of `system` that was transferred whole; None where there is none."""
    down, up, last = _Transfer(), _Transfer(), None
    for frame in frames:
        message = frame.message
        if not message.get_type().startswith("MISSION_"):
            continue
        record = from_message(message)
        own = message.get_srcSystem() == system and message.get_srcComponent() == COMPONENT_AUTOPILOT
        if isinstance(record, Count | Item):
            transfer = down if own else up
            if own or getattr(message, "target_system", system) == system:
                transfer.take(record)
            last = (down.whole() if own else None) or last
        elif isinstance(record, Ack) and own and record.result == ACCEPTED:
            last = up.whole() or last
    return last
