"""Where a sensor on the vehicle is read: positions and mission progress in, times and places out. Pure.

Legs begin and end where MISSION_ITEM_REACHED says so: it is what the estimator goes by, too, and unlike a
turn in the track it is clear while hovering, overshooting or rounding a corner. The leg begins at the
last position heard before that message. Distance is displacement from that place; between positions the
vehicle is taken to move evenly. A reading is placed where the vehicle is at a *whole* millisecond of its
own clock, so that rounding the time costs no accuracy; those that come to lie on a leg's last millisecond
belong to the next leg (s < l_j).

Accuracy floor: positions (LOCAL_POSITION_NED) and readings (NAMED_VALUE_FLOAT) are float32 on the wire:
24 bits, 6e-8 of the value, 4 µm at 64 m from home. Fastest sampling: one reading a millisecond.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from dslam_mav.errors import BadInputError
from sim_bridge.fields.field import Array

TICK_S = 1e-3  # time_boot_ms
_SAME = 1e-9  # of a step: what rounding may take
_STEPS = 9  # whose median is the usual time between two positions
_GAP_STEPS = 5
_GAP_MS = 50
_STILL_M = 0.1


@dataclass(frozen=True, slots=True)
class Sampling:
    """Read every `spacing_m` from each leg's start or every `interval_s` from the first vertex."""

    spacing_m: float | None = None
    interval_s: float | None = None

    def __post_init__(self) -> None:
        if (self.spacing_m is None) == (self.interval_s is None):
            raise ValueError("spacing_m: expected exactly one of spacing_m and interval_s")
        for name, value in (("spacing_m", self.spacing_m), ("interval_s", self.interval_s)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name}: expected a positive number, got {value:g}")
        if self.interval_s is not None and self.interval_s < TICK_S:
            raise BadInputError(
                f"interval_s {self.interval_s:g}: expected {TICK_S:g} or more, times on the wire are whole ms"
            )

    def check(self, speed_m_s: float) -> None:
        """BadInputError if readings at `speed_m_s` would come faster than one a millisecond."""
        finest_m = speed_m_s * TICK_S
        if self.spacing_m is not None and self.spacing_m < finest_m * (1.0 - _SAME):
            raise BadInputError(
                f"spacing_m {self.spacing_m:g}: expected {finest_m:g} or more at {speed_m_s:g} m/s, "
                "times on the wire are whole ms"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """`time_boot_ms` (M,), `time_s` (M,) since the first vertex, `place_m` (M, 3) east, north, up."""

    time_boot_ms: NDArray[np.int64]
    time_s: Array
    place_m: Array


_NONE = Samples(np.empty(0, np.int64), np.empty(0), np.empty((0, 3)))


@dataclass(frozen=True, slots=True)
class _Position:
    time_ms: int
    place_m: Array


class Sampler:
    """Follows one flight of the mission whose vertices have the sequence numbers `vertex_seqs`.

    Nothing is read after the last vertex is reached nor, but every `before_s`, before the first, unless `always`. What
    is read before has the time 0: how long it is until then nobody knows. `skipped` counts
    readings left out because the vehicle flew faster than whole milliseconds allow, `unplaced` those due while its
    positions did not come: it may have turned meanwhile. `reached_m`: where it was when it said that it reached a
    vertex, [east, north, up] by the vertex's number.
    """

    def __init__(
        self, sampling: Sampling, vertex_seqs: Sequence[int], *, always: bool = False, before_s: float | None = None
    ) -> None:
        if len(vertex_seqs) < 2 and not always:
            raise BadInputError(f"mission: expected at least 2 waypoints, got {len(vertex_seqs)}")
        self.skipped = self.unplaced = 0
        self.finished = False
        self.reached_m: dict[int, Array] = {}
        self._sampling = sampling
        self._vertices = tuple(vertex_seqs)
        self._always = always
        self._before_ms = None if before_s is None else max(1, round(before_s / TICK_S))
        self._at = -1  # index of the vertex reached last
        self._last: _Position | None = None
        self._origin: _Position | None = None  # of the leg
        self._start_ms: int | None = None  # of the flight
        self._next = 0  # the reading that comes next, counted from the leg's or the flight's start
        self._read_ms = -1
        self._steps_ms: deque[int] = deque(maxlen=_STEPS)

    @property
    def started(self) -> bool:
        """Whether readings are being taken, or were."""
        return self._start_ms is not None

    def follow(self, vertex_seqs: Sequence[int]) -> None:
        """The mission's part to come is another; the vertices passed stay."""
        self._vertices = tuple(vertex_seqs)

    @property
    def last_seq(self) -> int:
        """The vertex at which it ends; 0: there is none."""
        return self._vertices[-1] if self._vertices else 0

    def end_at(self, last_seq: int, current_seq: int) -> None:
        """The last vertex is another: in flight to item `current_seq` the mission was changed behind it."""
        if self.started and not self.finished and last_seq != self.last_seq:
            self.follow((*(v for v in self._vertices if v <= current_seq), *range(current_seq + 1, last_seq + 1)))

    def reached(self, seq: int, *, told: bool = True) -> None:
        """MISSION_ITEM_REACHED: a vertex ends a leg and begins the next; others do nothing. Not `told`: it was lost,
        and nobody knows since when the vertex is passed.
        """
        if seq not in self._vertices or self._vertices.index(seq) <= self._at or self._last is None:
            return
        self._at = self._vertices.index(seq)
        if told:
            self.reached_m[seq] = self._last.place_m
        if self._at == len(self._vertices) - 1 and not self._always:
            self.finished = True
            return
        self._begin_leg(self._last)

    def passed(self, seq: int, current: int) -> None:
        """MISSION_CURRENT went from `seq` to `current`: the vertices from the one up to the other are passed."""
        for vertex in [v for v in self._vertices if seq <= v < current][-1:]:
            self.reached(vertex, told=False)

    def landed(self) -> None:
        """The mission is over; whoever was reading reads no more."""
        self.finished = self.finished or (self.started and not self._always)

    def interrupted(self) -> None:
        """Where the vehicle was before says nothing of where it is now."""
        self._last = None

    def position(self, time_boot_ms: int, place_m: Sequence[float]) -> Samples:
        """LOCAL_POSITION_NED as [east, north, up]: the readings due since the position before."""
        position = _Position(time_boot_ms, np.array(place_m, dtype=np.float64))
        if self._last is not None and time_boot_ms < self._last.time_ms:
            return _NONE  # overtaken by others
        before, self._last = self._last, position
        if self._always and self._start_ms is None:
            self._begin_leg(position)
        gap = before is not None and self._gap(before, position)
        if self._start_ms is None and before is not None and self._before_ms is not None and not gap:
            step_ms = self._before_ms
            first_ms = -(-before.time_ms // step_ms) * step_ms
            early_ms = list(range(max(first_ms, self._read_ms + 1), time_boot_ms, step_ms))
            return _at_places(early_ms, None, before, position) if early_ms else _NONE
        if before is None or self.finished or self._start_ms is None or time_boot_ms <= before.time_ms:
            return _NONE
        if self._sampling.spacing_m is not None:
            times = self._by_distance(before, position, self._sampling.spacing_m)
        else:
            times = self._by_time(position, self._sampling.interval_s or TICK_S)
        kept = [t for t in dict.fromkeys(times) if t > self._read_ms]
        self.skipped += len(times) - len(kept)
        if not kept:
            return _NONE
        self._read_ms = kept[-1]
        if gap:
            self.unplaced += len(kept)
            return _NONE
        return _at_places(kept, self._start_ms, before, position)

    def _gap(self, before: _Position, after: _Position) -> bool:
        """Whether positions are missing: none came for much longer than usual, and it flew meanwhile."""
        step_ms = after.time_ms - before.time_ms
        usual_ms = median(self._steps_ms) if len(self._steps_ms) == _STEPS else math.inf
        if step_ms > 0:
            self._steps_ms.append(step_ms)
        still = float(np.linalg.norm(after.place_m - before.place_m)) < _STILL_M
        return step_ms > max(_GAP_MS, _GAP_STEPS * usual_ms) and not still

    def _begin_leg(self, position: _Position) -> None:
        self._origin = position
        if self._start_ms is None:
            self._start_ms = position.time_ms
        if self._sampling.spacing_m is not None:
            self._next = 0

    def _by_distance(self, before: _Position, after: _Position, spacing_m: float) -> list[int]:
        """Milliseconds in [before, after) at which the next multiples of the spacing are reached."""
        origin = self._origin or before
        d0, d1 = (float(np.linalg.norm(p.place_m - origin.place_m)) for p in (before, after))
        times = []
        while self._next * spacing_m <= max(d0, d1):
            distance = self._next * spacing_m
            share = 0.0 if distance <= d0 else (distance - d0) / (d1 - d0)
            time_ms = before.time_ms + _rounded(share * (after.time_ms - before.time_ms))
            if time_ms >= after.time_ms:
                break
            times.append(time_ms)
            self._next += 1
        return times

    def _by_time(self, after: _Position, interval_s: float) -> list[int]:
        """Milliseconds before `after` at which the next multiples of the interval are due."""
        times = []
        while (time_ms := (self._start_ms or 0) + _rounded(self._next * interval_s / TICK_S)) < after.time_ms:
            times.append(time_ms)
            self._next += 1
        return times


def _rounded(milliseconds: float) -> int:
    """To the nearest, halves always up: a millisecond apart stays a millisecond apart."""
    return math.floor(milliseconds + 0.5)


def _at_places(times_ms: list[int], start_ms: int | None, before: _Position, after: _Position) -> Samples:
    times = np.array(times_ms, dtype=np.int64)
    share = (times - before.time_ms) / max(after.time_ms - before.time_ms, 1)
    place_m = before.place_m + share[:, None] * (after.place_m - before.place_m)
    time_s = np.zeros(times.size) if start_ms is None else np.asarray((times - start_ms) * TICK_S, np.float64)
    return Samples(times, time_s, place_m)
