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

LONGER = 1.25
"""How much longer, or shorter, than planned a way over corners that nobody reported may be."""


@dataclass(frozen=True, slots=True)
class Event:
    """A mission item passed at `time_ms`, or at any time since `since_ms`, the `index`-th event; `run` changes when
    numbers start again, `boot` when the vehicle's clock does.

    Samples that came before event number `opens` + 1 do not count to the leg that begins here.
    """

    seq: int
    time_ms: int
    run: int
    index: int
    boot: int = 0
    since_ms: int | None = None
    opens: int | None = None

    @property
    def certain(self) -> bool:
        """Whether its moment is known well enough."""
        return self.since_ms is None or self.time_ms - self.since_ms <= CERTAIN_MS

    @property
    def opened_at(self) -> int:
        """The number of events after which samples may count to the leg that begins here."""
        return self.index if self.opens is None else self.opens


def settle(events: Sequence[Event], plan: PlanFacts, speeds: Array) -> list[Event]:
    """The events at the plan's vertices, uncertain ones moved to their likely moments and missing ones put in.

    `speeds` (N, 2): ms and m/s, times rising; without any the vehicle is taken to move evenly.
    """
    corners = [event for event in events if event.seq in plan.vertices]
    settled: list[Event] = []
    for _, group in groupby(corners, key=lambda event: event.run):
        run = list(group)
        if all(e.certain for e in run) and _complete(run, plan):
            settled += run
        else:
            settled += _settle_run(run, plan, speeds)
    return settled


def _complete(run: list[Event], plan: PlanFacts) -> bool:
    places = [plan.vertices.index(event.seq) for event in run]
    return places == list(range(places[0], places[0] + len(places)))


def _settle_run(run: list[Event], plan: PlanFacts, speeds: Array) -> list[Event]:
    """One run: between neighbours that are certain, and beyond the outermost of those."""
    sure = [k for k, event in enumerate(run) if event.certain]
    if not sure:
        return run
    out = _beyond(run[: sure[0]], run[sure[0]], plan, speeds)
    for a, b in pairwise(sure):
        out += [run[a], *_between(run[a], run[a + 1 : b], run[b], plan, speeds)]
    return [*out, run[sure[-1]], *_beyond(run[sure[-1] + 1 :], run[sure[-1]], plan, speeds)]


def _between(start: Event, late: list[Event], end: Event, plan: PlanFacts, speeds: Array) -> list[Event]:
    first, last = plan.vertices.index(start.seq), plan.vertices.index(end.seq)
    if last <= first or end.time_ms <= start.time_ms:
        return late
    planned_m = np.concatenate([[0.0], np.cumsum(plan.lengths_m[first:last])])
    heard = {event.seq: event for event in late}
    missing = len(heard) < last - first - 1
    if planned_m[-1] <= 0.0 or (missing and not _as_planned(planned_m[-1], speeds, start, end)):
        return late
    moments = _moments(planned_m / planned_m[-1], speeds, start.time_ms, end.time_ms)
    settled = []
    for seq, moment_ms in zip(plan.vertices[first + 1 : last], moments[1:-1], strict=True):
        event = heard.get(seq)
        after = [e.index for e in late if e.seq > seq]
        if event is None:
            index = min([*after, end.index])
            settled.append(Event(seq, moment_ms, start.run, index, start.boot, opens=index - 1))
        else:
            settled.append(_moved(event, moment_ms))
    return settled


def _as_planned(planned_m: float, speeds: Array, start: Event, end: Event) -> bool:
    """Whether so much was flown: else the corners that nobody reported were not flown to."""
    flown_m = _way(speeds, start.time_ms, end.time_ms)[1][-1]
    return bool(planned_m / LONGER <= flown_m <= planned_m * LONGER)


def _beyond(late: list[Event], sure: Event, plan: PlanFacts, speeds: Array) -> list[Event]:
    """Corners before the first certain one, or after the last: as far from it as planned."""
    settled = []
    at = plan.vertices.index(sure.seq)
    for event in late:
        place = plan.vertices.index(event.seq)
        low, high = sorted((place, at))
        planned_m = sum(plan.lengths_m[low:high])
        since_ms = event.time_ms if event.since_ms is None else event.since_ms
        ends_ms = (since_ms, sure.time_ms) if place < at else (sure.time_ms, event.time_ms)
        moved = event
        if place != at and ends_ms[0] < ends_ms[1] and len(speeds) > 1:
            total_m = _way(speeds, *ends_ms)[1][-1]
            share = planned_m / total_m if total_m > 0.0 else 1.0
            shares = np.clip([1.0 - share if place < at else share], 0.0, 1.0)
            moved = _moved(event, _moments(shares, speeds, *ends_ms)[0])
        settled.append(moved)
    return settled


def _moved(event: Event, moment_ms: int) -> Event:
    earliest_ms = event.time_ms if event.since_ms is None else event.since_ms
    moment_ms = min(max(moment_ms, earliest_ms), event.time_ms)
    return replace(event, time_ms=moment_ms, since_ms=None, opens=event.index - 1)


def _moments(shares: Array, speeds: Array, start_ms: int, end_ms: int) -> list[int]:
    """When these shares (N,) of the way between two moments were flown, in whole ms."""
    time_ms, way_m = _way(speeds, start_ms, end_ms)
    if way_m[-1] <= 0.0:
        return [round(start_ms + float(share) * (end_ms - start_ms)) for share in shares]
    return [round(float(t)) for t in np.interp(shares * way_m[-1], way_m, time_ms)]


def _way(speeds: Array, start_ms: int, end_ms: int) -> tuple[Array, Array]:
    """(N,) moments from start to end, and the metres flown until each; speeds change evenly between samples."""
    if len(speeds) < 2:
        return np.array([start_ms, end_ms], np.float64), np.zeros(2)
    inside = speeds[(speeds[:, 0] > start_ms) & (speeds[:, 0] < end_ms), 0]
    time_ms = np.concatenate([[start_ms], inside, [end_ms]])
    speed = np.interp(time_ms, speeds[:, 0], speeds[:, 1])
    steps_m = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time_ms) / 1000.0
    return time_ms, np.concatenate([[0.0], np.cumsum(steps_m)])
