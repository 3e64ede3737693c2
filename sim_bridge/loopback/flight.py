"""One flight of the loopback vehicle under way, and the messages it causes. Pure."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

from sim_bridge.loopback.flight_model import Timeline

NEVER_MS = 2**62

Peer = Hashable


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A message for `only` that peer, or for all but those in `without`."""

    message: Any
    only: Peer | None = None
    without: frozenset[Peer] = frozenset()


@dataclass(slots=True)
class Flight:
    """A timeline under way; `index` -1 before its start. `held_ms`: how far it was when it was paused."""

    timeline: Timeline
    start_ms: int
    is_mission: bool
    index: int = -1
    held_ms: int | None = None

    @property
    def next_ms(self) -> int:
        """When its next segment ends, or the first begins."""
        if self.held_ms is not None:
            return NEVER_MS
        return self.start_ms + (self.timeline.segments[self.index].end_ms if self.index >= 0 else 0)

    def redirect(self, timeline: Timeline) -> bool:
        """Another flight that is this one until the segment under way ends; False: it is not, nothing changes."""
        done = self.index + 1
        if timeline.segments[:done] != self.timeline.segments[:done] or len(timeline.segments) < max(done, 1):
            return False
        self.timeline = timeline
        return True

    def turned(self, timeline: Timeline, time_ms: int) -> Flight:
        """The flight gone on with another timeline from now; one not begun, or paused, stays so."""
        if self.index < 0:
            return Flight(timeline, self.start_ms, is_mission=True)
        return Flight(timeline, time_ms, is_mission=True, index=0, held_ms=None if self.held_ms is None else 0)

    def go_on(self, time_ms: int) -> None:
        """After a pause, from where it was."""
        if self.held_ms is not None:
            self.start_ms, self.held_ms = time_ms - self.held_ms, None
