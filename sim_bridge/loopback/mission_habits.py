"""The mission handshake as ArduPilot and PX4 really speak it, beside the standard's (`dslam_mav.mav.mission.server`).

Pure state; times are simulated milliseconds. A reply is (station, message record or STATUSTEXT); requests are
MISSION_REQUEST where `Ask.plain`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace

from dslam_mav.mav.mission.protocol import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    ERROR,
    INVALID_SEQUENCE,
    Ack,
    ClearAll,
    Count,
    Item,
    Message,
    Request,
    RequestList,
)
from dslam_mav.mission import CMD_LAND, CMD_TAKEOFF, CMD_WAYPOINT, MissionItem

Station = Hashable
Judge = Callable[[int, MissionItem], int]


@dataclass(frozen=True, slots=True)
class Ask:
    """A question for item `seq`: MISSION_REQUEST if `plain`, else MISSION_REQUEST_INT."""

    seq: int
    plain: bool = True


@dataclass(frozen=True, slots=True)
class Say:
    """STATUSTEXT, a warning, to everybody."""

    text: str


Reply = tuple[Station, Message | Ask | Say]


@dataclass(slots=True)
class _Upload:
    station: Station
    count: int
    seq: int
    asked_ms: int
    begun_ms: int
    plain: bool = True


class ArduPilotHabits:
    """Item 0 is home; what comes is stored at once, rounded; whoever is silent leaves a mixture behind."""

    again_ms = 1_000
    gives_up_ms = 8_000

    def __init__(self, judge: Judge, home: MissionItem) -> None:
        self.items: tuple[MissionItem, ...] = (home,)
        self.flyable = True
        self._home = home
        self._judge = judge
        self._upload: _Upload | None = None

    @property
    def due_ms(self) -> float:
        """When `tick` has something to do."""
        return math.inf if self._upload is None else self._upload.asked_ms + self.again_ms

    def take(  # noqa: PLR0911  one return a message
        self, station: Station, message: Message, now_ms: int, *, locked: bool
    ) -> list[Reply]:
        """Answer one message."""
        upload = self._upload
        match message:
            case Count(count):
                if upload is not None and upload.station != station:
                    return [(station, Ack(DENIED))]
                self.items = self.items[: max(count, 1)]
                if count == 0:
                    return [(station, Ack(ACCEPTED))]
                self._upload = _Upload(station, count, 0, now_ms, now_ms)
                return [(station, Ask(0))]
            case Item(seq, item):
                return self._item(station, seq, item, now_ms)
            case RequestList():
                return [(station, Count(len(self.items)))]
            case Request(seq):
                if 0 <= seq < len(self.items):
                    return [(station, Item(seq, self.items[seq]))]
                return [(station, Count(len(self.items))), (station, Ack(INVALID_SEQUENCE))]
            case ClearAll():
                if locked or (upload is not None and upload.station != station):
                    return [(station, Ack(DENIED))]
                self.items = (self._home,)
                return [(station, Ack(ACCEPTED))]
            case Ack(result) if result != ACCEPTED and upload is not None and upload.station == station:
                self._upload = None
        return []

    def tick(self, now_ms: int) -> list[Reply]:
        """Ask again, or give up."""
        upload = self._upload
        if upload is None or now_ms < self.due_ms:
            return []
        if now_ms - upload.begun_ms >= self.gives_up_ms:
            self._upload = None
            return [(upload.station, Ack(CANCELLED))]
        upload.asked_ms = now_ms
        return [(upload.station, Ask(upload.seq))]

    def _item(self, station: Station, seq: int, item: MissionItem, now_ms: int) -> list[Reply]:
        upload = self._upload
        if upload is None or upload.station != station:
            return [(station, Ack(ERROR))]
        if seq != upload.seq:
            return [(station, Ack(INVALID_SEQUENCE))]  # and goes on all the same
        if (result := self._judge(seq, item)) != ACCEPTED:
            self._upload = None
            return [(station, Ack(result))]
        stored = self._home if seq == 0 else ardupilot_rounds(item)
        self.items = (*self.items[:seq], stored, *self.items[seq + 1 :])
        upload.seq, upload.asked_ms, upload.begun_ms = seq + 1, now_ms, now_ms
        if upload.seq == upload.count:
            self._upload = None
            return [(station, Ack(ACCEPTED))]
        return [(station, Ask(upload.seq))]


def ardupilot_rounds(item: MissionItem) -> MissionItem:
    """What ArduPilot gives back: frame 6 as 3, z in whole centimetres, whole seconds, LAND's p4 as 1."""
    frame = {5: 0, 6: 3, 11: 10}.get(item.frame, item.frame)
    a, b, c, d = item.params
    if item.command == CMD_WAYPOINT:
        a, d = float(math.trunc(a)), 0.0
    if item.command == CMD_LAND:
        d = 1.0
    return replace(item, frame=frame, params=(a, b, c, d), z=round(item.z * 100.0) / 100.0)


class Px4Habits:
    """All or nothing; wrong numbers are ignored; after five seconds a STATUSTEXT and no ACK; what it has accepted it
    looks at afterwards.
    """

    again_ms = 250
    gives_up_ms = 5_000

    def __init__(self, judge: Judge) -> None:
        self.items: tuple[MissionItem, ...] = ()
        self.flyable = False
        self._judge = judge
        self._upload: _Upload | None = None
        self._coming: list[MissionItem] = []

    @property
    def due_ms(self) -> float:
        """When `tick` has something to do."""
        return math.inf if self._upload is None else self._upload.asked_ms + self.again_ms

    def take(  # noqa: PLR0911  one return a message
        self, station: Station, message: Message, now_ms: int, *, locked: bool
    ) -> list[Reply]:
        """Answer one message."""
        upload = self._upload
        match message:
            case Count(count):
                if upload is not None and upload.station != station:
                    return [(station, Ack(ERROR))]
                if count == 0:
                    self.items, self.flyable = (), False
                    return [(station, Ack(ACCEPTED))]
                self._upload, self._coming = _Upload(station, count, 0, now_ms, now_ms), []
                return [(station, Ask(0))]
            case Item(seq, item):
                return self._item(station, seq, item, now_ms)
            case RequestList():
                return [(station, Count(len(self.items)))]
            case Request(seq) if 0 <= seq < len(self.items):
                return [(station, Item(seq, self.items[seq]))]
            case ClearAll():
                if locked:
                    return [(station, Ack(DENIED))]
                self.items, self.flyable = (), False
                return [(station, Ack(ACCEPTED))]
        return []

    def tick(self, now_ms: int) -> list[Reply]:
        """Ask again, or say that it gives up."""
        upload = self._upload
        if upload is None or now_ms < self.due_ms:
            return []
        if now_ms - upload.begun_ms >= self.gives_up_ms:
            self._upload = None
            return [(upload.station, Say("Operation timeout"))]
        upload.asked_ms = now_ms
        return [(upload.station, Ask(upload.seq, upload.plain))]

    def _item(self, station: Station, seq: int, item: MissionItem, now_ms: int) -> list[Reply]:
        upload = self._upload
        if upload is None:
            return [(station, Ack(ERROR))]
        if upload.station != station or seq != upload.seq:
            return []
        if (result := self._judge(seq, item)) != ACCEPTED:
            self._upload = None
            return [(station, Ack(result))]
        self._coming.append(px4_rounds(item))
        upload.seq, upload.asked_ms, upload.begun_ms, upload.plain = seq + 1, now_ms, now_ms, False
        if upload.seq < upload.count:
            return [(station, Ask(upload.seq, plain=False))]
        self._upload, self.items = None, tuple(self._coming)
        why = infeasible(self.items)
        self.flyable = not why
        return [(station, Ack(ACCEPTED)), *([(station, Say(f"Mission rejected: {why}"))] if why else [])]


def px4_rounds(item: MissionItem) -> MissionItem:
    """What PX4 gives back: frame 3 as 6, 0 as 5, unused parameters as 0."""
    frame = {0: 5, 3: 6}.get(item.frame, item.frame)
    a, b, c, d = item.params
    if item.command == CMD_WAYPOINT:
        c = 0.0
    if item.command in (CMD_TAKEOFF, CMD_LAND):
        a, b, c = (0.0, 0.0, 0.0) if item.command == CMD_TAKEOFF else (0.0, b, c)
    return replace(item, frame=frame, params=(a, b, c, d))


def infeasible(items: tuple[MissionItem, ...]) -> str:
    """Why PX4 will not fly a mission it has accepted; "" if it will."""
    flown = [item for item in items if item.command in (CMD_TAKEOFF, CMD_WAYPOINT, CMD_LAND)]
    if any(item.command == CMD_TAKEOFF for item in flown) and flown[0].command != CMD_TAKEOFF:
        return "takeoff is not the first waypoint item"
    if flown and flown[0].command == CMD_TAKEOFF and flown[0].frame == 6 and flown[0].z <= 0.0:
        return "takeoff altitude too low"
    return ""
