"""When which message is due, in simulated milliseconds, and for whom. Pure.

Every kind has a default rate for all peers; a peer that asked for another (SET_MESSAGE_INTERVAL) gets its own
and not the default one.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass

Peer = Hashable


@dataclass(slots=True)
class _Stream:
    kind: int
    peer: Peer | None  # None: everybody without a rate of their own
    interval_ms: int
    due_ms: int


class Streams:
    """The schedule of all periodic messages; `default_ms`: message number -> interval."""

    def __init__(self, default_ms: Mapping[int, int]) -> None:
        self._default_ms = dict(default_ms)
        self._streams = [_Stream(kind, None, ms, ms) for kind, ms in default_ms.items()]
        self._own_rate: dict[int, frozenset[Peer]] = {}

    @property
    def next_ms(self) -> int:
        """When the next message is due."""
        return min((stream.due_ms for stream in self._streams), default=2**62)

    def pop(self, time_ms: int) -> list[tuple[int, Peer | None]]:
        """(message number, peer or None: all without their own rate) due at `time_ms`; each at most once."""
        due: list[tuple[int, Peer | None]] = []
        for stream in self._streams:
            if stream.due_ms <= time_ms:
                due.append((stream.kind, stream.peer))
                stream.due_ms += stream.interval_ms * (1 + (time_ms - stream.due_ms) // stream.interval_ms)
        return due

    def anchor(self, time_ms: int) -> None:
        """Begin every stream anew at `time_ms`, so that what follows does not depend on what was before."""
        for stream in self._streams:
            stream.due_ms = time_ms

    def without(self, kind: int) -> frozenset[Peer]:
        """The peers that do not get the default stream of that kind."""
        return self._own_rate.get(kind, frozenset())

    def set_interval(self, peer: Peer, kind: int, interval_ms: int | None, time_ms: int) -> None:
        """A rate of its own for `peer`; 0: the default again; None: off."""
        self._streams = [s for s in self._streams if (s.kind, s.peer) != (kind, peer)]
        own = self.without(kind) - {peer}
        if interval_ms is None or interval_ms > 0:
            own |= {peer}
        self._own_rate[kind] = own
        if interval_ms:
            self._streams.append(_Stream(kind, peer, interval_ms, time_ms + interval_ms))

    def interval_ms(self, peer: Peer, kind: int) -> int:
        """What `peer` gets: milliseconds, 0 if nothing."""
        for stream in self._streams:
            if (stream.kind, stream.peer) == (kind, peer):
                return stream.interval_ms
        return 0 if peer in self.without(kind) else self._default_ms.get(kind, 0)

    def forget(self, peer: Peer) -> None:
        """The peer is gone."""
        self._streams = [s for s in self._streams if s.peer is None or s.peer != peer]
        self._own_rate = {kind: peers - {peer} for kind, peers in self._own_rate.items()}
