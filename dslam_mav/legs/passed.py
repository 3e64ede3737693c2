"""Which mission items were passed, and when, as the autopilot's news of its mission tell it. Pure.

An item is passed at the newest vehicle time seen until its news. MISSION_CURRENT going on says the same as
MISSION_ITEM_REACHED, should that be lost; news that others have overtaken, or that are repeated, say nothing.
"""

from __future__ import annotations

from dataclasses import replace

from dslam_mav.legs.passing import Event
from dslam_mav.legs.plan import PlanFacts
from dslam_mav.observations import Progress

SILENT_MS = 1_000
"""An autopilot that tells no time for longer was not heard, or its telemetry is slow."""

OVERTAKEN_MS = 150
"""A packet that others have overtaken is no later than that; what is told again after it is meant."""


class Passed:
    """The `events` of a flight, in order; times are the vehicle's, `now_ms` the newest (None: none was heard yet)."""

    def __init__(self, plan: PlanFacts | None) -> None:
        self.events: list[Event] = []
        self._plan = plan
        self._run = self._boot = 0
        self._current: int | None = None
        self._current_ms: int | None = None  # when it was last heard that the current item is still ahead
        self._told = False  # whether the newest event was told since the newest time
        self._fallen: tuple[int, int] | None = None  # an item before the current one, and when it was heard first
        self._early: int | None = None  # an item passed before any vehicle time was heard: at the first one

    @property
    def last(self) -> Event | None:
        """The last one; None before the first."""
        return self.events[-1] if self.events else None

    def news(self, progress: Progress, now_ms: int | None) -> None:
        """An item was reached, or is now flown to."""
        if progress.reached:
            self._pass(progress.seq, now_ms, reached=True)
            return
        before, since_ms = self._current, self._current_ms
        if before is not None and progress.seq < before and not self._jumped_back(progress.seq, now_ms or 0):
            return
        self._current, self._current_ms, self._fallen = progress.seq, now_ms, None
        if before is not None and progress.seq > before:
            self._pass(before, now_ms, reached=False, since_ms=since_ms)  # says the same should ITEM_REACHED be lost
            for seq in () if self._plan is None else self._plan.vertices:
                if before < seq < progress.seq:
                    self._pass(seq, now_ms, reached=False, since_ms=since_ms, implied=True)
        elif before is not None and progress.seq < before:
            self._run += 1

    def clock_set(self, now_ms: int) -> None:
        """A vehicle time is known: what was passed before any was is passed now."""
        if self._early is not None:
            early, self._early = self._early, None
            self._pass(early, now_ms, reached=True)

    def time_told(self, time_ms: int) -> None:
        """The autopilot tells the time: the events told last were passed before it. Told after a silence, they were so
        just before it.
        """
        if not self._told or time_ms <= self.events[-1].time_ms:
            return
        self._told = False
        told_ms = self.events[-1].time_ms
        for k in range(len(self.events) - 1, -1, -1):
            event = self.events[k]
            if event.time_ms != told_ms:
                break
            if time_ms - told_ms > SILENT_MS:
                self.events[k] = replace(event, time_ms=time_ms, since_ms=event.earliest_ms)
            elif event.since_ms is None:
                self.events[k] = replace(event, until_ms=time_ms)

    def restarted(self) -> None:
        """The autopilot's clock started again: numbers and times do."""
        self._run += 1
        self._boot += 1
        self._current = None

    def forget(self) -> None:
        """The times until now were of another clock: only what was passed last counts, at the first time to come."""
        self._early = self.events[-1].seq if self.events else None
        self.events.clear()
        self._told = False

    def _jumped_back(self, seq: int, now_ms: int) -> bool:
        """Whether the mission went back to an earlier item: if that is heard again a while later, and nothing else
        between. Once is a packet that others have overtaken.
        """
        if self._fallen is None:
            self._fallen = seq, now_ms
        return now_ms - self._fallen[1] >= OVERTAKEN_MS

    def _pass(
        self, seq: int, now_ms: int | None, *, reached: bool, since_ms: int | None = None, implied: bool = False
    ) -> None:
        last = self.events[-1] if self.events and self.events[-1].run == self._run else None
        if last is not None and (seq == last.seq or (seq < last.seq and not reached)):
            if reached and now_ms == last.time_ms:
                self.events[-1] = replace(last, since_ms=None)  # both at once: it is passed now
            return  # PX4 repeats MISSION_ITEM_REACHED up to ten times
        if now_ms is None:
            self._early = seq
            return
        if last is not None and seq < last.seq and now_ms - last.time_ms < OVERTAKEN_MS:
            return
        if last is not None and seq < last.seq:
            self._run += 1
            self._current, self._fallen = seq, None
        self.events.append(Event(seq, now_ms, self._run, len(self.events), self._boot, since_ms, implied=implied))
        self._told = True
