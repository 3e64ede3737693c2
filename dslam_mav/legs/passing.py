"""When corners were passed whose news came late or never: told by how far the vehicle had flown by then. Pure.

A lost MISSION_ITEM_REACHED is made up for by the next MISSION_CURRENT, which may come a second later, or after a
silence that hid several corners. Taken for the moment of passing, that would move a corner by metres. Between two
corners whose moments are certain the distance flown is a scalar known from speeds alone; the plan's leg lengths, scaled
to it, say when each corner between was passed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray

from dslam_mav.legs.plan import PlanFacts

Array = NDArray[np.float64]

CERTAIN_MS = 250
"""News of a corner that can be late by no more than this is taken as it comes."""

LOSSY = 0.02
"""The share of the vehicle's positions that do not come, from which on a link counts as one that loses packets."""

LONGER = 1.25
"""How much longer, or shorter, than planned a way over corners that nobody reported may be."""


@dataclass(frozen=True, slots=True)
class Event:
    """A mission item passed at `time_ms`, or at any time from `since_ms` to `until_ms`, the `index`-th event; `run`
    changes when numbers start again, `boot` when the vehicle's clock does.

    Samples count to the leg that begins here if they came after event number `opens`, by default itself. `implied`:
    nobody said that it was passed, only that a later item is flown to.
    """

    seq: int
    time_ms: int
    run: int
    index: int
    boot: int = 0
    since_ms: int | None = None
    opens: int | None = None
    implied: bool = False
    until_ms: int | None = None

    def certain(self, within_ms: float = CERTAIN_MS) -> bool:
        """Whether it was passed, and its moment is known so well."""
        return not self.implied and self.latest_ms - self.earliest_ms <= within_ms

    @property
    def latest_ms(self) -> int:
        """When it may have been passed at the latest."""
        return self.time_ms if self.until_ms is None else self.until_ms

    @property
    def earliest_ms(self) -> int:
        """When it may have been passed at the earliest."""
        return self.time_ms if self.since_ms is None else self.since_ms

    @property
    def opened_at(self) -> int:
        """The number of events after which samples may count to the leg that begins here."""
        return self.index if self.opens is None else self.opens


def settle(events: Sequence[Event], plan: PlanFacts, speeds: Array) -> list[Event]:
    """The events at the plan's vertices, uncertain ones moved to their likely moments and missing ones put in.

    `speeds` (N, 2): ms and m/s, times rising; without any the vehicle is taken to move evenly.
    """
    corners = [event for event in events if event.seq in plan.vertices]
    within_ms = _certain_ms(speeds)
    settled: list[Event] = []
    for _, group in groupby(corners, key=lambda event: event.run):
        run = list(group)
        if all(e.certain(within_ms) for e in run) and _complete(run, plan):
            settled += run
        else:
            settled += _settle_run(run, plan, speeds, within_ms)
    return settled


def _complete(run: list[Event], plan: PlanFacts) -> bool:
    places = [plan.vertices.index(event.seq) for event in run]
    return places == list(range(places[0], places[0] + len(places)))


def _certain_ms(speeds: Array) -> float:
    """How well a moment must be known: where packets are lost, to less than the time between two of them."""
    steps_ms = np.diff(speeds[:, 0])
    if steps_ms.size == 0:
        return CERTAIN_MS
    usual_ms = float(np.median(steps_ms))
    lossy = np.mean(steps_ms > 1.5 * usual_ms) > LOSSY
    return min(CERTAIN_MS, usual_ms - 1.0) if lossy else CERTAIN_MS


def _settle_run(run: list[Event], plan: PlanFacts, speeds: Array, within_ms: float) -> list[Event]:
    """One run: between neighbours that are certain, and beyond the outermost of those."""
    sure = [k for k, event in enumerate(run) if event.certain(within_ms)]
    sure = sure or [k for k, event in enumerate(run) if event.certain()]
    if not sure:
        return [event for event in run if not event.implied]
    out = _beyond(run[: sure[0]], run[sure[0]], plan, speeds, after=False)
    for a, b in pairwise(sure):
        out += [run[a], *_between(run[a], run[a + 1 : b], run[b], plan, speeds)]
    return [*out, run[sure[-1]], *_beyond(run[sure[-1] + 1 :], run[sure[-1]], plan, speeds, after=True)]


def _between(start: Event, late: list[Event], end: Event, plan: PlanFacts, speeds: Array) -> list[Event]:
    first, last = plan.vertices.index(start.seq), plan.vertices.index(end.seq)
    told = [event for event in late if not event.implied]
    if last <= first or end.time_ms <= start.time_ms:
        return told
    planned_m = np.concatenate([[0.0], np.cumsum(plan.lengths_m[first:last])])
    time_ms, way_m = _way(speeds, start.time_ms, end.time_ms)
    flown_m = float(way_m[-1])
    missing = len(told) < last - first - 1
    if planned_m[-1] <= 0.0 or (missing and not planned_m[-1] / LONGER <= flown_m <= planned_m[-1] * LONGER):
        return told
    if flown_m <= 0.0:
        time_ms, way_m = time_ms[[0, -1]], np.array([0.0, 1.0])
    moments = np.interp(planned_m * (way_m[-1] / planned_m[-1]), way_m, time_ms)
    heard = {event.seq: event for event in late}
    settled = []
    for seq, moment_ms in zip(plan.vertices[first + 1 : last], moments[1:-1], strict=True):
        index = min([e.index for e in (*late, end) if e.seq >= seq])
        event = heard.get(seq, Event(seq, end.time_ms, start.run, index, start.boot, start.time_ms))
        settled.append(_moved(event, moment_ms, start))
    return settled


def _beyond(late: list[Event], sure: Event, plan: PlanFacts, speeds: Array, *, after: bool) -> list[Event]:
    """Corners before the first certain one, or after the last: as far from it as planned."""
    if not late or len(speeds) < 2:
        return [event for event in late if not event.implied]
    at = plan.vertices.index(sure.seq)
    farthest_ms = max(e.latest_ms for e in late) if after else min(e.earliest_ms for e in late)
    start_ms, end_ms = sorted((farthest_ms, sure.time_ms))
    time_ms, way_m = _way(speeds, start_ms, end_ms, hold=1 if after else -1)
    settled = []
    for event in late:
        place = plan.vertices.index(event.seq)
        planned_m = sum(plan.lengths_m[min(place, at) : max(place, at)])
        moment_ms = np.interp(planned_m if after else way_m[-1] - planned_m, way_m, time_ms)
        outside_ms = max(event.earliest_ms - moment_ms, moment_ms - event.latest_ms)
        if not event.implied or outside_ms <= CERTAIN_MS:
            settled.append(_moved(event, moment_ms, sure if after else None))
    return settled


def _moved(event: Event, moment_ms: float, since: Event | None) -> Event:
    """The event at this moment, or as near to it as it can have been; samples since another event count after it."""
    moment = min(max(round(moment_ms), event.earliest_ms), event.latest_ms)
    return replace(event, time_ms=moment, since_ms=None, until_ms=None, opens=-1 if since is None else since.index)


def _way(speeds: Array, start_ms: int, end_ms: int, hold: int = 0) -> tuple[Array, Array]:
    """(N,) moments from start to end, and the metres flown until each.

    Between samples the speed changes evenly, or (`hold` 1, -1) is that of the earlier, of the later one.
    """
    if len(speeds) < 2:
        return np.array([start_ms, end_ms], np.float64), np.zeros(2)
    inside = speeds[(speeds[:, 0] > start_ms) & (speeds[:, 0] < end_ms), 0]
    time_ms = np.concatenate([[start_ms], inside, [end_ms]])
    speed = np.interp(time_ms, speeds[:, 0], speeds[:, 1])
    if hold:
        near = np.searchsorted(speeds[:, 0], time_ms, side="right" if hold > 0 else "left") - (hold > 0)
        speed = speeds[np.clip(near, 0, len(speeds) - 1), 1]
    mean = 0.5 * (speed[1:] + speed[:-1]) if not hold else speed[:-1] if hold > 0 else speed[1:]
    return time_ms, np.concatenate([[0.0], np.cumsum(mean * np.diff(time_ms) / 1000.0)])
