"""The vehicle's side of the mission handshake, as a pure state machine.

Several stations may talk at once: any may read, one at a time may write. The mission held is replaced only by
a whole new one; whatever interrupts an upload leaves the old mission in place.
https://mavlink.io/en/services/mission.html
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace

from dslam_mav.mav.mission.protocol import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    ERROR,
    INVALID_SEQUENCE,
    ITEM_RETRIES,
    ITEM_TIMEOUT_S,
    NO_SPACE,
    Ack,
    ClearAll,
    Count,
    Item,
    Message,
    Request,
    RequestList,
)
from dslam_mav.mission import MissionItem

MAX_ITEMS = 65535

Peer = Hashable
Reply = tuple[Peer, Message]
Judge = Callable[[int, MissionItem], int]  # (sequence number, item) -> MAV_MISSION_RESULT


@dataclass(frozen=True, slots=True)
class Incoming:
    """An upload under way: who sends, how many, what has come."""

    peer: Peer
    count: int
    deadline_s: float
    items: tuple[MissionItem, ...] = ()
    retries: int = ITEM_RETRIES


@dataclass(frozen=True, slots=True)
class Server:
    """The mission held, the upload under way, who finished the last one (its final ACK may get lost)."""

    items: tuple[MissionItem, ...] = ()
    incoming: Incoming | None = None
    finished: Peer | None = None
    locked: bool = False  # in flight: it may be replaced by another mission, but not by none

    @property
    def deadline_s(self) -> float:
        """When `step_server` with no message is due next; infinity: never."""
        return self.incoming.deadline_s if self.incoming else float("inf")


Step = tuple[Server, tuple[Reply, ...]]


def step_server(  # noqa: PLR0911  one return a message
    state: Server, peer: Peer, message: Message | None, now_s: float, judge: Judge
) -> Step:
    """Answer one message of `peer`, or (None) let time pass."""
    match message:
        case None:
            return _timeout(state, now_s)
        case Count(count):
            return _offer(state, peer, count, now_s)
        case Item():
            return _item(state, peer, message, now_s, judge)
        case RequestList():
            # who asks for the mission is not sending one any more
            return _drop(state, peer), ((peer, Count(len(state.items))),)
        case Request(seq):
            known = 0 <= seq < len(state.items)
            return state, ((peer, Item(seq, state.items[seq]) if known else Ack(INVALID_SEQUENCE)),)
        case ClearAll():
            if state.locked or _busy(state, peer):
                return state, ((peer, Ack(DENIED)),)
            return Server(), ((peer, Ack(ACCEPTED)),)
        case Ack(result):
            return (_drop(state, peer) if result != ACCEPTED else state), ()


def _busy(state: Server, peer: Peer) -> bool:
    return state.incoming is not None and state.incoming.peer != peer


def _drop(state: Server, peer: Peer) -> Server:
    mine = state.incoming is not None and state.incoming.peer == peer
    return replace(state, incoming=None) if mine else state


def _offer(state: Server, peer: Peer, count: int, now_s: float) -> Step:
    if _busy(state, peer) or (state.locked and count == 0):
        return state, ((peer, Ack(DENIED)),)
    if count > MAX_ITEMS:
        return state, ((peer, Ack(NO_SPACE)),)
    if count == 0:
        return Server(finished=peer), ((peer, Ack(ACCEPTED)),)
    incoming = Incoming(peer, count, now_s + ITEM_TIMEOUT_S)
    return replace(state, incoming=incoming, finished=None), ((peer, Request(0)),)


def _item(state: Server, peer: Peer, message: Item, now_s: float, judge: Judge) -> Step:
    seq, item = message.seq, message.item
    incoming = state.incoming
    if incoming is None or incoming.peer != peer:
        if state.finished != peer:
            return state, ((peer, Ack(ERROR)),)
        # an echo of an upload that is complete: only the last item can mean that our ACK was lost
        last = seq == len(state.items) - 1
        return state, ((peer, Ack(ACCEPTED)),) if last else ()
    expected = len(incoming.items)
    if seq != expected:
        return state, () if seq == expected - 1 else ((peer, Request(expected)),)
    if (result := judge(seq, item)) != ACCEPTED:
        return replace(state, incoming=None), ((peer, Ack(result)),)
    items = (*incoming.items, item)
    if len(items) == incoming.count:
        return Server(items=items, finished=peer), ((peer, Ack(ACCEPTED)),)
    incoming = replace(incoming, items=items, deadline_s=now_s + ITEM_TIMEOUT_S, retries=ITEM_RETRIES)
    return replace(state, incoming=incoming), ((peer, Request(seq + 1)),)


def _timeout(state: Server, now_s: float) -> Step:
    incoming = state.incoming
    if incoming is None or now_s < incoming.deadline_s:
        return state, ()
    if incoming.retries == 0:
        return replace(state, incoming=None), ((incoming.peer, Ack(CANCELLED)),)
    again = replace(incoming, deadline_s=now_s + ITEM_TIMEOUT_S, retries=incoming.retries - 1)
    return replace(state, incoming=again), ((incoming.peer, Request(len(incoming.items))),)
