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
from dslam_mav.legs.distance import Distance
from dslam_mav.legs.plan import PlanFacts
from dslam_mav.observations import GroundSpeed, Observation, Odometry, Progress, Reading, Yaw
from dslam_mav.records import Flight, Leg

Array = NDArray[np.float64]

CLOCK_MS = 2**32
"""Where time_boot_ms starts again."""

REBOOT_MS = 10_000
"""An autopilot's clock that falls back by more was restarted."""

LATE_READINGS_MS = 3_000
"""How far dead reckoning must be past a leg's end before a leg without later readings counts as complete."""

_PAUSE_MS = 60_000  # put between two runs of an autopilot's clock


class VehicleClock:
    """time_boot_ms made to rise for ever: it wraps at 2^32 and starts again with the autopilot."""

    def __init__(self) -> None:
        self.newest_ms: int | None = None
        self._wire_ms = 0

    def take(self, time_boot_ms: int, *, autopilot: bool) -> tuple[int, bool]:
        """The unwrapped time, and whether the autopilot was restarted (only its own messages can tell)."""
        if self.newest_ms is None:
            self.newest_ms = self._wire_ms = time_boot_ms
            return time_boot_ms, False
        step_ms = (time_boot_ms - self._wire_ms + CLOCK_MS // 2) % CLOCK_MS - CLOCK_MS // 2
        restarted = autopilot and step_ms < -REBOOT_MS
        if restarted:
            step_ms = _PAUSE_MS
        time_ms = self.newest_ms + step_ms
        if step_ms > 0:
            self.newest_ms, self._wire_ms = time_ms, time_boot_ms
        return time_ms, restarted


class LegCollector:
    """Takes observations as they come; gives the flight as far as it is known.

    With `plan` only flights between neighbouring vertices of it are legs; without, every straight way between
    two mission items that is long enough and has readings. `distance` None: the first of odometry, speed and
    plan that the vehicle offers. `counts` says what was taken and set aside: "readings", "duplicate", "not
    finite", "restarts"; `legs_counts` the same of the last flight: "readings used",
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
        self._run = 0
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
                time_ms, _ = self.clock.take(observation.time_boot_ms, autopilot=False)
                self._samples.yaw.append((time_ms, observation.yaw_rad))
        if self._early is not None and self.clock.newest_ms is not None:
            self._passed(self._early, reached=True)
            self._early = None

    def legs(self, *, final: bool = False) -> tuple[FlownLeg, ...]:
        """The chain of legs flown; `final`: do not wait for readings that might still come."""
        with self._lock:
            events = self._events if final else self._events[: self._checked]
            legs, self.legs_counts = assemble(events, self._samples, self.plan, self.distance)
            return legs

    def flight(self, final: bool = False) -> Flight:
        """The flight, its time zero at the start of its first leg. A leg between others stays without
        readings.
        """
        legs = self.legs(final=final)
        return Flight(tuple(_leg(leg, legs[0].zero_ms) for leg in legs))

    def notes(self, legs: tuple[FlownLeg, ...]) -> tuple[str, ...]:
        """What a person should know of these legs' readings, one line each."""
        lines = [f"{n} readings were not finite and were dropped" for n in [self.counts["not finite"]] if n]
        for j, leg in enumerate(legs, 1):
            if leg.value.size == 0:
                lines.append(f"leg {j} of {len(legs)} has no readings")
            elif leg.value.size > 1 and np.ptp(leg.value) == 0.0:
                lines.append(f"leg {j} of {len(legs)}: all {leg.value.size} readings are {leg.value[0]:g}")
        if n := self.legs_counts["legs lost"]:
            lines.append(f"{n} legs could not be told apart or measured; the longest unbroken part is used")
        return tuple(lines)

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
        self._events.append(Event(seq, self.clock.newest_ms, self._run, len(self._events)))

    def _reading(self, reading: Reading) -> None:
        self.names.add(reading.name)
        if not math.isfinite(reading.value):
            self.counts["not finite"] += 1
            return
        time_ms, _ = self.clock.take(reading.time_boot_ms, autopilot=False)
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
        time_ms, restarted = self.clock.take(odometry.time_boot_ms, autopilot=True)
        if restarted:
            self.counts["restarts"] += 1
            self._run += 1
            self._current = None
        self._samples.odometry.append((len(self._events), time_ms, *values))
        self._newest_odometry_ms = max(self._newest_odometry_ms, time_ms)

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


def _leg(leg: FlownLeg, zero_ms: int) -> Leg:
    return Leg(leg.length_m, leg.distance_m, (leg.time_ms - zero_ms) / 1000.0, leg.value)


def _mean_heading_rad(leg: FlownLeg, yaw: list[tuple[int, float]]) -> float:
    margin_ms = 0.2 * (leg.end_ms - leg.start_ms)
    inside = [r for t, r in yaw if leg.start_ms + margin_ms <= t <= leg.end_ms - margin_ms]
    if not inside:
        return math.nan
    mean_rad = math.atan2(math.fsum(map(math.sin, inside)), math.fsum(map(math.cos, inside)))
    return math.remainder(0.5 * math.pi - mean_rad, 2.0 * math.pi)
