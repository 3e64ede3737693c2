"""Observations of a flight -> its legs. Pure: no files, no sockets, no clock but the vehicle's.

A leg is flown between two mission items; the moment an item is reached is the newest vehicle time seen until
then. Readings find their leg by their own time, because a bridge or a second link delivers them late. Dead
reckoning finds it by order of arrival as well, so that a frame that changes between two legs is never mixed.
"""

from __future__ import annotations

import math
import threading
from collections import Counter

import numpy as np
from numpy.typing import NDArray

from dslam_mav.legs.assembly import Event, FlownLeg, Samples, assemble
from dslam_mav.legs.clock import VehicleClock
from dslam_mav.legs.distance import Distance
from dslam_mav.legs.plan import PlanFacts
from dslam_mav.legs.under_way import UnderWay, part_flown
from dslam_mav.observations import GroundSpeed, Observation, Odometry, Progress, Reading, Yaw
from dslam_mav.records import Flight, Leg

Array = NDArray[np.float64]

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
        self._events: list[Event] = []
        self._run = self._boot = 0
        self._current: int | None = None
        self._newest_reading_ms = self._newest_odometry_ms = -1
        self._checked = 0
        self._lock = threading.RLock()  # a thread that estimates may ask while another adds
        self._early: int | None = None  # an item passed before any vehicle time was heard: at the first one

    @property
    def last_event(self) -> tuple[int, int] | None:
        """(sequence number, vehicle time in ms) of the last item passed; None before the first."""
        return (self._events[-1].seq, self._events[-1].time_ms) if self._events else None

    @property
    def settled(self) -> bool:
        """Whether readings have gone past the last item: none of an earlier leg is still to come."""
        return bool(self._events) and self._newest_reading_ms >= self._events[-1].time_ms

    @property
    def silent(self) -> bool:
        """Whether nothing was heard yet that tells a distance."""
        return not (self._samples.odometry or self._samples.speed)

    def add(self, observation: Observation) -> bool:
        """Take one observation; True if a leg is now complete that was not before."""
        with self._lock:
            self._add(observation)
            return self._complete()

    def _add(self, observation: Observation) -> None:
        match observation:
            case Progress():
                self._progress(observation)
            case Reading():
                self._reading(observation)
            case Odometry():
                self._odometry(observation)
            case GroundSpeed():
                self._speed(observation)
            case Yaw() if math.isfinite(observation.yaw_rad):
                self._samples.yaw.append((self._autopilot_ms(observation.time_boot_ms), observation.yaw_rad))
        if self._early is not None and self.clock.newest_ms is not None:
            self._passed(self._early, reached=True)
            self._early = None

    def legs(self, *, final: bool = False) -> tuple[FlownLeg, ...]:
        """The chain of legs flown; `final`: do not wait for readings that might still come."""
        with self._lock:
            events = self._events if final else self._events[: self._checked]
            legs, self.legs_counts = assemble(events, self._samples, self.plan, self.distance)
            return legs

    def under_way(self) -> UnderWay | None:
        """The flight so far with the leg being flown, as far as it is read; None: none is, or it cannot be measured."""
        with self._lock:
            newest_ms = min(self._newest_reading_ms, self._newest_odometry_ms)
            return part_flown(self._events, self._samples, self.plan, self.distance, newest_ms)

    def flight(self, final: bool = False) -> Flight:
        """The flight of `legs`: see `flight_of`."""
        return flight_of(self.legs(final=final))

    def notes(self, legs: tuple[FlownLeg, ...]) -> tuple[str, ...]:
        """What a person should know of these legs' readings, one line each."""
        lines = [f"{n} readings were not finite and were dropped" for n in [self.counts["not finite"]] if n]
        if n := self.counts["off the clock"]:
            lines.append(f"{n} readings had times that are not of the vehicle's clock and were dropped")
        if n := self.counts["restarts"]:
            lines.append(f"the autopilot's clock started again {n} times; the longest unbroken part is used")
        if not self.names:
            lines.append("no readings were heard: is the bridge or the sensor running?")
        if missed := self._missed(legs):
            lines.append(f"legs 1 to {missed} of the mission are missing: leg 1 here is its leg {missed + 1}")
        for j, leg in enumerate(legs, 1):
            if leg.value.size == 0:
                lines.append(f"leg {j} of {len(legs)} has no readings")
            elif leg.value.size > 1 and np.ptp(leg.value) == 0.0:
                lines.append(f"leg {j} of {len(legs)}: all {leg.value.size} readings are {leg.value[0]:g}")
        if n := self.legs_counts["legs lost"]:
            lines.append(f"{n} legs could not be told apart or measured; the longest unbroken part is used")
        return tuple(lines)

    def _missed(self, legs: tuple[FlownLeg, ...]) -> int:
        """How many of the plan's legs lie before the first one here."""
        if self.plan is None or not legs or legs[0].start_seq not in self.plan.vertices:
            return 0
        return self.plan.vertices.index(legs[0].start_seq)

    def headings_rad(self, legs: tuple[FlownLeg, ...]) -> Array:
        """(L,) the vehicle's mean yaw on each leg as a direction, counter-clockwise from east; NaN where
        unknown.

        The turns at a leg's ends do not count: only the middle three fifths of its time.
        """
        with self._lock:
            return np.array([_mean_heading_rad(leg, self._samples.yaw) for leg in legs])

    def _progress(self, progress: Progress) -> None:
        if progress.reached:
            self._passed(progress.seq, reached=True)
            return
        before, self._current = self._current, progress.seq
        if before is not None and progress.seq > before:
            self._passed(before, reached=False)  # says the same should MISSION_ITEM_REACHED be lost
        elif before is not None and progress.seq < before:
            self._run += 1

    def _passed(self, seq: int, *, reached: bool) -> None:
        last = self._events[-1] if self._events and self._events[-1].run == self._run else None
        if last is not None and (seq == last.seq or (seq < last.seq and not reached)):
            return  # PX4 repeats MISSION_ITEM_REACHED up to ten times
        if self.clock.newest_ms is None:
            self._early = seq
            return
        if last is not None and seq < last.seq:
            self._run += 1
        self._events.append(Event(seq, self.clock.newest_ms, self._run, len(self._events), self._boot))

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

    def _odometry(self, odometry: Odometry) -> None:
        values = (odometry.x_m, odometry.y_m, odometry.vx_m_s, odometry.vy_m_s)
        if not all(math.isfinite(v) for v in values):
            self.counts["not finite"] += 1
            return
        time_ms = self._autopilot_ms(odometry.time_boot_ms)
        self._samples.odometry.append((len(self._events), time_ms, *values))
        self._newest_odometry_ms = max(self._newest_odometry_ms, time_ms)

    def _autopilot_ms(self, time_boot_ms: int) -> int:
        first = not self.clock.autopilots
        time_ms, new = self.clock.take(time_boot_ms)
        if new and first:
            self._forget()
        elif new:
            self.counts["restarts"] += 1
            self._run += 1
            self._boot += 1
            self._current = None
        return time_ms

    def _forget(self) -> None:
        """Only readings were heard until now, and they had another clock: nothing of it has a known time."""
        dropped = sum(map(len, self._samples.readings.values()))
        self.counts["off the clock"] += dropped
        self.counts["readings"] -= dropped
        self._early = self._events[-1].seq if self._events else None
        self._samples = Samples()
        self._events.clear()
        self._checked = self.legs_completed = 0
        self._newest_reading_ms = -1

    def _speed(self, speed: GroundSpeed) -> None:
        if self.clock.newest_ms is not None and math.isfinite(speed.speed_m_s):
            self._samples.speed.append((len(self._events), self.clock.newest_ms, speed.speed_m_s))

    def _complete(self) -> bool:
        before = self.legs_completed
        while self._checked < len(self._events):
            event = self._events[self._checked]
            past = self._newest_odometry_ms >= event.time_ms + LATE_READINGS_MS
            if not (past or self._newest_reading_ms >= event.time_ms):
                break
            if self._checked and self._events[self._checked - 1].run == event.run:
                self.legs_completed += 1
            self._checked += 1
        return self.legs_completed > before


def flight_of(legs: tuple[FlownLeg, ...]) -> Flight:
    """The flight of these legs, its time zero where the mission's first began, used or not (`FlownLeg.zero_ms`).

    A leg between others stays without readings.
    """
    return Flight(tuple(_leg(leg, leg.zero_ms) for leg in legs))


def _leg(leg: FlownLeg, zero_ms: int) -> Leg:
    return Leg(leg.length_m, leg.distance_m, (leg.time_ms - zero_ms) / 1000.0, leg.value)


def _mean_heading_rad(leg: FlownLeg, yaw: list[tuple[int, float]]) -> float:
    margin_ms = 0.2 * (leg.end_ms - leg.start_ms)
    inside = [r for t, r in yaw if leg.start_ms + margin_ms <= t <= leg.end_ms - margin_ms]
    if not inside:
        return math.nan
    mean_rad = math.atan2(math.fsum(map(math.sin, inside)), math.fsum(map(math.cos, inside)))
    return math.remainder(0.5 * math.pi - mean_rad, 2.0 * math.pi)
