"""Observations of a flight -> its legs. Pure: no files, no sockets, no clock but the vehicle's.

A leg is flown between two mission items; the moment an item is reached is the newest vehicle time seen until
then. Readings find their leg by their own time, because a bridge or a second link delivers them late. Dead
reckoning finds it by order of arrival as well, so that a frame that changes between two legs is never mixed.
"""

from __future__ import annotations

import heapq
import math
import threading
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from dslam_mav.legs.assembly import FlownLeg, Samples, assemble, readings_of
from dslam_mav.legs.clock import VehicleClock
from dslam_mav.legs.distance import Distance
from dslam_mav.legs.notes import mean_heading_rad, notes
from dslam_mav.legs.passed import Passed
from dslam_mav.legs.plan import PlanFacts
from dslam_mav.legs.standing import Standing, stand_before
from dslam_mav.legs.under_way import UnderWay, part_flown
from dslam_mav.observations import GroundSpeed, Observation, Odometry, Progress, Reading, ReadingSeries, Yaw
from dslam_mav.records import Flight, Leg

Array = NDArray[np.float64]

CORNER_SHARE = 1.0 / 100.0
"""Of a leg: how far from its end the next one may begin. Optical flow drifts that far over a leg, and more."""

BESIDE_SHARE = 0.25
"""Of how far beside its line a leg begins: how well that is understood. Corners are not flown round by one rule."""

LATE_READINGS_MS = 3_000
"""How far dead reckoning must be past a leg's end before a leg without later readings counts as complete."""


class LegCollector:
    """Takes observations as they come; gives the flight as far as it is known.

    With `plan` only flights between neighbouring vertices of it are legs; without, every straight way between
    two mission items that is long enough and has readings. `distance` None: the first of odometry, speed and
    plan that the vehicle offers. `counts` says what was taken and set aside: "readings", "duplicate", "not
    finite", "off the clock", "restarts"; `legs_counts` the same of the last flight: "readings used",
    "readings outside legs", "legs lost", "legs short".
    """

    def __init__(self, plan: PlanFacts | None = None, *, distance: Distance | None = None) -> None:
        self.plan = plan
        self.distance = distance
        self.counts: Counter[str] = Counter()
        self.legs_counts: Counter[str] = Counter()
        self.names: set[str] = set()
        self.clock = VehicleClock()
        self.legs_completed = 0
        self._samples = Samples()
        self._passed = Passed(plan)
        self._newest_reading_ms = self._newest_odometry_ms = -1
        self._checked = 0
        self._lock = threading.RLock()  # a thread that estimates may ask while another adds

    @property
    def last_event(self) -> tuple[int, int] | None:
        """(sequence number, vehicle time in ms) of the last item passed; None before the first."""
        last = self._passed.last
        return None if last is None else (last.seq, last.time_ms)

    @property
    def settled(self) -> bool:
        """Whether readings have gone past the last item: none of an earlier leg is still to come."""
        last = self._passed.last
        return last is not None and self._newest_reading_ms >= last.time_ms

    @property
    def silent(self) -> bool:
        """Whether nothing was heard yet that tells a distance."""
        return not (self._samples.odometry or self._samples.speed)

    def add(self, observation: Observation) -> bool:
        """Take one observation; True if a leg is now complete that was not before."""
        with self._lock:
            self._add(observation)
            return self._complete()

    def add_all(self, observations: Iterable[Observation]) -> None:
        """Take a whole recording, in its order."""
        with self._lock:
            for observation in observations:
                self._add(observation)
            self._complete()

    def add_recorded(self, others: Iterable[tuple[int, Observation]], readings: Sequence[ReadingSeries]) -> None:
        """Take a whole recording: what `add_all` takes, in a fraction of the time. `others` come with their place among
        all packets, in order. Once the autopilot's clock is heard, readings change nothing of what the others mean:
        they are placed all at once, each by the clock as it was then.
        """
        with self._lock:
            rest = iter(others)
            since = -1 if self.clock.autopilots else self._until_autopilot(rest, readings)
            orders, states = [since], [self.clock.state]
            for order, observation in rest:
                self._add(observation)
                orders.append(order)
                states.append(self.clock.state)
            newest_ms, wire_ms = np.array(states, dtype=np.int64).T
            for series in readings:
                late = series.order > since
                then = np.searchsorted(orders, series.order[late]) - 1
                time_ms = self.clock.place_many(series.time_boot_ms[late], newest_ms[then], wire_ms[then])
                self._series(series, series.value[late], *time_ms)
            self._complete()

    def _until_autopilot(self, others: Iterator[tuple[int, Observation]], readings: Sequence[ReadingSeries]) -> int:
        """Take all in order until the autopilot's clock is heard, where `others` stop; the place of that."""
        for order, observation in heapq.merge(others, *map(_one_by_one, readings), key=lambda item: item[0]):
            self._add(observation)
            if self.clock.autopilots:
                return order
        return int(np.iinfo(np.int64).max)

    def _add(self, observation: Observation) -> None:
        match observation:
            case Reading():
                self._reading(observation)
            case Progress():
                self._passed.news(observation, self.clock.newest_ms)
            case Odometry():
                self._odometry(observation)
            case GroundSpeed():
                self._speed(observation)
            case Yaw() if math.isfinite(observation.yaw_rad):
                self._samples.yaw.append((self._autopilot_ms(observation.time_boot_ms), observation.yaw_rad))
        if self.clock.newest_ms is not None:
            self._passed.clock_set(self.clock.newest_ms)

    def legs(self, *, final: bool = False) -> tuple[FlownLeg, ...]:
        """The chain of legs flown; `final`: do not wait for readings that might still come."""
        with self._lock:
            events = self._passed.events if final else self._passed.events[: self._checked]
            legs, self.legs_counts = assemble(events, self._samples, self.plan, self.distance)
            return legs

    def under_way(self) -> UnderWay | None:
        """The flight so far with the leg being flown, as far as it is read; None: none is, or it cannot be measured."""
        with self._lock:
            newest_ms = min(self._newest_reading_ms, self._newest_odometry_ms)
            return part_flown(self._passed.events, self._samples, self.plan, self.distance, newest_ms)

    def flight(self, final: bool = False) -> Flight:
        """The flight of `legs`: see `flight_of`."""
        return flight_of(self.legs(final=final))

    def readings(self) -> tuple[NDArray[np.int64], Array]:
        """Times (N,), unwrapped ms, and values (N,) of all readings taken, on legs or not."""
        with self._lock:
            return readings_of(self._samples)

    def notes(self, legs: tuple[FlownLeg, ...]) -> tuple[str, ...]:
        """What a person should know of these legs' readings, one line each."""
        return notes(self.counts, self.legs_counts, legs, self.plan, heard=bool(self.names))

    def headings_rad(self, legs: tuple[FlownLeg, ...]) -> Array:
        """(L,) the vehicle's mean yaw on each leg as a direction, counter-clockwise from east; NaN where
        unknown.

        The turns at a leg's ends do not count: only the middle three fifths of its time.
        """
        with self._lock:
            return np.array([mean_heading_rad(leg, self._samples.yaw) for leg in legs])

    def standing(self, legs: tuple[FlownLeg, ...]) -> Standing | None:
        """What was read at one place before the first of these legs; None: too little."""
        with self._lock:
            rows: Sequence[tuple[float, ...]] = self._samples.odometry or self._samples.speed
            if not legs or not rows:
                return None
            return stand_before(legs[0].start_ms, readings_of(self._samples), np.array(rows, dtype=np.float64))

    def _reading(self, reading: Reading) -> None:
        self.names.add(reading.name)
        if not math.isfinite(reading.value):
            self.counts["not finite"] += 1
            return
        time_ms = self.clock.place(reading.time_boot_ms)
        if time_ms is None:
            self.counts["off the clock"] += 1
            return
        taken = self._samples.readings.setdefault((reading.name, reading.component), {})
        if time_ms in taken:
            self.counts["duplicate"] += 1
            return
        taken[time_ms] = reading.value
        self.counts["readings"] += 1
        self._newest_reading_ms = max(self._newest_reading_ms, time_ms)

    def _series(self, series: ReadingSeries, value: Array, time_ms: NDArray[np.int64], near: NDArray[np.bool_]) -> None:
        """What `_reading` does, for many of one sender."""
        if not value.size:
            return
        self.names.add(series.name)
        finite = np.isfinite(value)
        kept = finite & near
        self.counts["not finite"] += int(np.count_nonzero(~finite))
        self.counts["off the clock"] += int(np.count_nonzero(finite & ~near))
        if not kept.any():
            return
        taken = self._samples.readings.setdefault((series.name, series.component), {})
        before = len(taken)
        first = dict(zip(time_ms[kept][::-1].tolist(), value[kept][::-1].tolist(), strict=True)) | taken
        taken.update(first)
        self.counts["readings"] += len(taken) - before
        self.counts["duplicate"] += int(np.count_nonzero(kept)) - (len(taken) - before)
        self._newest_reading_ms = max(self._newest_reading_ms, int(time_ms[kept].max()))

    def _odometry(self, odometry: Odometry) -> None:
        values = (odometry.x_m, odometry.y_m, odometry.vx_m_s, odometry.vy_m_s)
        if not all(map(math.isfinite, values)):
            self.counts["not finite"] += 1
            return
        time_ms = self._autopilot_ms(odometry.time_boot_ms)
        self._samples.odometry.append((len(self._passed.events), time_ms, *values))
        self._newest_odometry_ms = max(self._newest_odometry_ms, time_ms)

    def _autopilot_ms(self, time_boot_ms: int) -> int:
        first = not self.clock.autopilots
        time_ms, new = self.clock.take(time_boot_ms)
        if new and first:
            self._forget()
        elif new:
            self.counts["restarts"] += 1
            self._passed.restarted()
        else:
            self._passed.time_told(time_ms)
        return time_ms

    def _forget(self) -> None:
        """Only readings were heard until now, and they had another clock: nothing of it has a known time."""
        dropped = sum(map(len, self._samples.readings.values()))
        self.counts["off the clock"] += dropped
        self.counts["readings"] -= dropped
        self._passed.forget()
        self._samples = Samples()
        self._checked = self.legs_completed = 0
        self._newest_reading_ms = -1

    def _speed(self, speed: GroundSpeed) -> None:
        if self.clock.newest_ms is not None and math.isfinite(speed.speed_m_s):
            self._samples.speed.append((len(self._passed.events), self.clock.newest_ms, speed.speed_m_s))

    def _complete(self) -> bool:
        before = self.legs_completed
        events = self._passed.events
        while self._checked < len(events):
            event = events[self._checked]
            past = self._newest_odometry_ms >= event.time_ms + LATE_READINGS_MS
            if not (past or self._newest_reading_ms >= event.time_ms):
                break
            if self._checked and events[self._checked - 1].run == event.run:
                self.legs_completed += 1
            self._checked += 1
        return self.legs_completed > before


def _one_by_one(series: ReadingSeries) -> Iterator[tuple[int, Observation]]:
    columns = (series.order, series.time_boot_ms, series.value)
    for order, time_boot_ms, value in zip(*(column.tolist() for column in columns), strict=True):
        yield order, Reading(time_boot_ms, value, series.name, series.component)


def flight_of(legs: tuple[FlownLeg, ...]) -> Flight:
    """The flight of these legs, its time zero where the mission's first began, used or not (`FlownLeg.zero_ms`).

    A leg between others stays without readings where those beside it are too few for an estimate.
    """
    besides_m = [leg.beside_m for leg in legs]
    if legs:
        besides_m[0] = max(legs[0].beside_m, legs[0].end_beside_m)  # the answer's frame lies between its ends
    return Flight(tuple(map(_leg, legs, besides_m, [*besides_m[1:], 0.0])))


def _leg(leg: FlownLeg, beside_m: float, next_beside_m: float) -> Leg:
    time_s = (leg.time_ms - leg.zero_ms) / 1000.0
    corner_sd_m = math.hypot(CORNER_SHARE * leg.length_m, BESIDE_SHARE * next_beside_m)
    return Leg(
        leg.length_m, leg.distance_m, time_s, leg.value,
        corner_sd_m=corner_sd_m, beside_m=beside_m, overshot_m=leg.overshot_m,
    )  # fmt: skip
