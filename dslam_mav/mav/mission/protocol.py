"""The mission handshake's messages, and the ground's side of it: upload, download and clear.

Pure state machines: `step(state, message | None, now_s) -> (state, replies)`; None is the passing of time.
Times are arguments, never read. https://mavlink.io/en/services/mission.html: a message without an answer is
sent again after 1500 ms (items 250 ms), at most five times; items go in order; one out of order is dropped
and the expected one asked for again; a refusal ends the transfer and the vehicle keeps its old mission. The
vehicle's side is `server`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from dslam_mav.mission import MissionItem

TIMEOUT_S = 1.5
ITEM_TIMEOUT_S = 0.25
RETRIES = 5
ITEM_RETRIES = 19
"""Items are asked for so often again, for 5 s as PX4 does: links that are silent for seconds lose no transfer."""

ACCEPTED = 0
ERROR = 1
UNSUPPORTED_FRAME = 2
UNSUPPORTED = 3
NO_SPACE = 4
INVALID_PARAM1 = 6
INVALID_PARAM2 = 7
INVALID_PARAM5_X = 10
INVALID_PARAM6_Y = 11
INVALID_PARAM7 = 12
INVALID_SEQUENCE = 13
DENIED = 14
CANCELLED = 15

_IN_WORDS = (
    "accepted",
    "error",
    "unsupported frame",
    "unsupported command",
    "too many items for its memory",
    "invalid item",
    "invalid parameter 1",
    "invalid parameter 2",
    "invalid parameter 3",
    "invalid parameter 4",
    "invalid latitude (parameter 5)",
    "invalid longitude (parameter 6)",
    "invalid altitude (parameter 7)",
    "item out of sequence",
    "denied",
    "transfer cancelled",
)


def result_in_words(result: int) -> str:
    """A MAV_MISSION_RESULT as a person reads it."""
    return _IN_WORDS[result] if 0 <= result < len(_IN_WORDS) else f"result {result}"


@dataclass(frozen=True, slots=True)
class Count:
    """MISSION_COUNT: so many items follow, or are there to be asked for."""

    count: int


@dataclass(frozen=True, slots=True)
class Request:
    """MISSION_REQUEST_INT, or MISSION_REQUEST, which is to be answered alike."""

    seq: int


@dataclass(frozen=True, slots=True)
class Item:
    """MISSION_ITEM_INT; `in_flight`: of a mission that goes on where it is, not at its beginning."""

    seq: int
    item: MissionItem
    in_flight: bool = False


@dataclass(frozen=True, slots=True)
class Ack:
    """MISSION_ACK with its MAV_MISSION_RESULT."""

    result: int


@dataclass(frozen=True, slots=True)
class RequestList:
    """MISSION_REQUEST_LIST: tell how many items there are."""


@dataclass(frozen=True, slots=True)
class ClearAll:
    """MISSION_CLEAR_ALL."""


Message = Count | Request | Item | Ack | RequestList | ClearAll


class Phase(Enum):
    """Where a transfer stands; the last four are its ends."""

    OPENING = "opening"  # our first message is not answered yet
    ITEMS = "items"
    DONE = "done"
    UNCONFIRMED = "unconfirmed"  # all was sent, the last word was lost: reading back will tell
    REFUSED = "refused"
    SILENT = "silent"

    @property
    def ended(self) -> bool:
        """Whether nothing more is to be sent or awaited."""
        return self not in (Phase.OPENING, Phase.ITEMS)


@dataclass(frozen=True, slots=True)
class Transfer:
    """One transfer, seen from the ground.

    `seq`: the item last sent (upload) or awaited (download), -1 before the first. `items`: to send, or
    received. `deadline_s`: when the next `step` with None is due. `result`: the refusal.
    """

    opening: Count | RequestList | ClearAll
    deadline_s: float
    phase: Phase = Phase.OPENING
    seq: int = -1
    count: int = 0
    items: tuple[MissionItem, ...] = ()
    retries: int = RETRIES
    result: int = ACCEPTED
    in_flight: bool = False


Step = tuple[Transfer, tuple[Message, ...]]


def begin_upload(items: tuple[MissionItem, ...], now_s: float, *, in_flight: bool = False) -> Step:
    """Offer `items` to the vehicle; go on with `step_upload`. `in_flight`: it goes on at the item it is at."""
    opening = Count(len(items))
    return Transfer(opening, now_s + TIMEOUT_S, count=len(items), items=items, in_flight=in_flight), (opening,)


def begin_download(now_s: float) -> Step:
    """Ask for the vehicle's mission; go on with `step_download`."""
    return Transfer(RequestList(), now_s + TIMEOUT_S), (RequestList(),)


def begin_clear(now_s: float) -> Step:
    """Ask the vehicle to forget its mission; go on with `step_clear`."""
    return Transfer(ClearAll(), now_s + TIMEOUT_S), (ClearAll(),)


def step_upload(state: Transfer, message: Message | None, now_s: float) -> Step:
    """The vehicle asks, we answer; it may ask for the same item again, and has the last word.

    INVALID_SEQUENCE is not the end: ArduPilot sends it for a duplicate and goes on. ACCEPTED before the last
    item was asked for is a straggler of an earlier transfer: taken for the end, it would leave a silently
    short mission.
    """
    if state.phase.ended:
        return state, ()
    match message:
        case None:
            return _upload_timeout(state, now_s)
        case Request(seq) if 0 <= seq < state.count:
            fresh = seq > state.seq
            state = replace(
                state,
                phase=Phase.ITEMS,
                seq=max(seq, state.seq),
                deadline_s=now_s + TIMEOUT_S,
                retries=RETRIES if fresh else state.retries,
            )
            return state, (Item(seq, state.items[seq], state.in_flight),)
        case Ack(result) if result == ACCEPTED:
            whole = state.seq == state.count - 1
            return (replace(state, phase=Phase.DONE) if whole else state), ()
        case Ack(result) if result != INVALID_SEQUENCE:
            return replace(state, phase=Phase.REFUSED, result=result), ()
    return state, ()


def _upload_timeout(state: Transfer, now_s: float) -> Step:
    if now_s < state.deadline_s:
        return state, ()
    if state.phase is Phase.OPENING:
        return _again(state, state.opening, TIMEOUT_S, now_s)
    if state.retries == 0:
        whole = state.seq == state.count - 1
        return replace(state, phase=Phase.UNCONFIRMED if whole else Phase.SILENT), ()
    # the vehicle leads: an item sent unasked would be a stray. After the last one, two timeouts are enough
    left = min(state.retries - 1, 0 if state.seq == state.count - 1 else RETRIES)
    return replace(state, deadline_s=now_s + TIMEOUT_S, retries=left), ()


def step_download(state: Transfer, message: Message | None, now_s: float) -> Step:  # noqa: PLR0911
    """We ask for one item after the other and confirm the last."""
    if state.phase.ended:
        return state, ()
    match message:
        case None if now_s >= state.deadline_s:
            if state.phase is Phase.OPENING:
                return _again(state, state.opening, TIMEOUT_S, now_s)
            return _again(state, Request(state.seq), ITEM_TIMEOUT_S, now_s)
        case Count(count) if state.phase is Phase.OPENING or count != state.count:
            if count == 0:
                return replace(state, phase=Phase.DONE, count=0, items=()), (Ack(ACCEPTED),)
            return _expect(replace(state, phase=Phase.ITEMS, count=count, items=()), 0, now_s)
        case Item(seq, item) if state.phase is Phase.ITEMS:
            if seq == state.seq:
                state = replace(state, items=(*state.items, item))
                if len(state.items) == state.count:
                    return replace(state, phase=Phase.DONE), (Ack(ACCEPTED),)
                return _expect(state, seq + 1, now_s)
            # an echo of the item just taken is answered already; asking again would double all that follows
            return state, () if seq == state.seq - 1 else (Request(state.seq),)
        case Ack(result) if result not in (ACCEPTED, INVALID_SEQUENCE):
            return replace(state, phase=Phase.REFUSED, result=result), ()
    return state, ()


def _expect(state: Transfer, seq: int, now_s: float) -> Step:
    return replace(state, seq=seq, deadline_s=now_s + ITEM_TIMEOUT_S, retries=ITEM_RETRIES), (Request(seq),)


def step_clear(state: Transfer, message: Message | None, now_s: float) -> Step:
    """One question, one answer."""
    if state.phase.ended:
        return state, ()
    match message:
        case None if now_s >= state.deadline_s:
            return _again(state, state.opening, TIMEOUT_S, now_s)
        case Ack(result):
            phase = Phase.DONE if result == ACCEPTED else Phase.REFUSED
            return replace(state, phase=phase, result=result), ()
    return state, ()


def _again(state: Transfer, message: Message, timeout_s: float, now_s: float) -> Step:
    if state.retries == 0:
        return replace(state, phase=Phase.SILENT), ()
    return replace(state, deadline_s=now_s + timeout_s, retries=state.retries - 1), (message,)
