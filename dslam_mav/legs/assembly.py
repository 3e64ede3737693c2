"""What was collected on a flight -> the chain of its legs (pure).

Readings of a hover or an overshoot on the leg's line stay; those beside it, where a corner is flown round, do not.
The path is a chain: where a leg cannot be measured or was hardly read the chain breaks, and the part with most legs is
the flight.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray

from dslam_mav.legs.distance import Distance, Motion, Placed, place
from dslam_mav.legs.passing import Event, settle
from dslam_mav.legs.plan import PlanFacts

Array = NDArray[np.float64]

MIN_READINGS = 8
"""A leg with fewer readings at either end of the flight says nothing and is left out."""

LEAST_READINGS = 4
LEAST_REACH = 1e-3  # of the leg's length
"""A leg between others with fewer readings, or all of them nearer to each other, says nothing: no estimate is made with
it.
"""

LEAST_LEGS = 2
"""With fewer nothing can be estimated; a chain in which a leg that says nothing leaves fewer stays as it is."""

MIN_LENGTH_SHARE = 0.02
MIN_LENGTH_M = 0.1
"""Shorter legs (of the longest; or altogether) are take-offs and hovers: no legs, and no gap in the chain."""

STRAIGHT_SHARE = 0.6
"""A way over items nobody reported is a leg only if its ends are so far apart, as a share of the way."""

AUTOPILOT = 1
COPIED_BYTES = 9
"""Of a reading's name PX4 keeps so many when it sends it on."""


@dataclass(slots=True)
class Samples:
    """What was heard, on the unwrapped clock in ms.

    `readings` by (name, component), `odometry` as (events before it, ms, x, y, vx, vy), `speed` as (events
    before it, ms, m/s), `yaw` as (ms, rad).
    """

    readings: dict[tuple[str, int], dict[int, float]] = field(default_factory=dict)
    odometry: list[tuple[int, int, float, float, float, float]] = field(default_factory=list)
    speed: list[tuple[int, int, float]] = field(default_factory=list)
    yaw: list[tuple[int, float]] = field(default_factory=list)


@dataclass(frozen=True, slots=True, eq=False)
class FlownLeg:
    """One leg as flown: readings `value` (N,) at `time_ms` (N,) int64, `distance_m` (N,) along it.

    It was flown on a line that passes `beside_m` from where it began, `end_beside_m` from where it ended, and up to
    `overshot_m` past its end. Times are the vehicle's, unwrapped; `zero_ms` is when the flight began: its first way
    between two vertices of the plan, flown with the same clock, or without a plan its first leg; used or not. It is leg
    `number` of the plan, or without one of those flown; `few` are the legs of its chain left out because they have too
    few readings: (number, readings).
    """

    start_seq: int
    end_seq: int
    start_ms: int
    end_ms: int
    length_m: float
    distance_m: Array
    time_ms: NDArray[np.int64]
    value: Array
    mode: Distance
    zero_ms: int = 0
    beside_m: float = 0.0
    end_beside_m: float = 0.0
    overshot_m: float = 0.0
    number: int = 1
    few: tuple[tuple[int, int], ...] = ()


def assemble(
    events: Sequence[Event], samples: Samples, plan: PlanFacts | None, mode: Distance | None
) -> tuple[tuple[FlownLeg, ...], Counter[str]]:
    """The longest unbroken chain of legs, and what was set aside on the way to it."""
    counts: Counter[str] = Counter()
    time_ms, value = readings_of(samples)
    odometry = np.array(samples.odometry, dtype=np.float64).reshape(-1, 6)
    speed = np.array(samples.speed, dtype=np.float64).reshape(-1, 3)
    chains: list[list[FlownLeg]] = [[]]
    if plan is not None:
        events = settle(events, plan, _speeds(odometry, speed))
    ways = list(_ways(events, plan))
    for start, end in ways:
        inside = slice(*np.searchsorted(time_ms, [start.time_ms, end.time_ms]))
        planned_m = plan.length_m(start.seq, end.seq) if plan else None
        if plan and planned_m is None:
            placed = None
        else:
            motion = _motion(odometry, speed, start, end)
            at_s = (time_ms[inside] - start.time_ms) / 1000.0
            duration_s = (end.time_ms - start.time_ms) / 1000.0
            placed = place(motion, duration_s, at_s, mode=mode, planned_m=planned_m)
        if placed is None or (plan is None and not _straight(placed, start, end)):
            counts["legs lost"] += 1
            chains.append([])
            continue
        if chains[-1] and chains[-1][-1].end_ms != start.time_ms:
            chains.append([])
        on_line = slice(None) if placed.straight is None else placed.straight
        chains[-1].append(
            FlownLeg(start.seq, end.seq, start.time_ms, end.time_ms, placed.length_m, placed.distance_m[on_line],
                     time_ms[inside][on_line], value[inside][on_line], placed.mode,
                     beside_m=placed.beside_m, end_beside_m=placed.end_beside_m, overshot_m=placed.overshot_m)
        )  # fmt: skip
    legs = _choose(chains, ways, counts, plan)
    counts["readings used"] = sum(leg.value.size for leg in legs)
    counts["readings outside legs"] = int(value.size) - counts["readings used"]
    return legs, counts


def _ways(events: Sequence[Event], plan: PlanFacts | None) -> Iterator[tuple[Event, Event]]:
    """Every pair of items passed one after the other, vertices of the plan only if there is one."""
    corners = [e for e in events if plan is None or e.seq in plan.vertices]
    for start, end in pairwise(corners):
        if start.run == end.run and end.time_ms > start.time_ms:
            yield start, end


def _speeds(odometry: Array, speed: Array) -> Array:
    """(N, 2) times and speeds over ground, by dead reckoning or else as told; times rise."""
    squares = odometry[:, 4] * odometry[:, 4] + odometry[:, 5] * odometry[:, 5]
    told = np.column_stack([odometry[:, 1], np.sqrt(squares)]) if squares.any() else speed[:, 1:]
    _, first = np.unique(told[:, 0], return_index=True)
    return np.asarray(told[first])


def _motion(odometry: Array, speed: Array, start: Event, end: Event) -> Motion:
    """The samples of one way: they came between its two events, and their own times say so too."""
    o, s = (_between(samples, start, end) for samples in (odometry, speed))
    o_s, s_s = (o[:, 1] - start.time_ms) / 1000.0, (s[:, 1] - start.time_ms) / 1000.0
    return Motion(o_s, o[:, 2:4], o[:, 4:6], s_s, s[:, 2])


def _between(samples: Array, start: Event, end: Event) -> Array:
    arrived = (samples[:, 0] > start.opened_at) & (samples[:, 0] <= end.index)
    timely = (samples[:, 1] >= start.time_ms) & (samples[:, 1] <= end.time_ms)
    own = samples[arrived & timely]
    _, first = np.unique(own[:, 1], return_index=True)
    return np.asarray(own[first])


def _straight(placed: Placed, start: Event, end: Event) -> bool:
    """Whether a way may be one leg: if no item lies between its ends, or else if it was flown straight."""
    if end.seq == start.seq + 1 or placed.travelled_m is None:
        return True
    return placed.length_m >= STRAIGHT_SHARE * placed.travelled_m


def readings_of(samples: Samples) -> tuple[NDArray[np.int64], Array]:
    """Times (N,) and values (N,) of all sensors, the mean where two have the same millisecond.

    What an autopilot repeats of another component's readings is left out: PX4 stamps the copies anew, and cuts their
    names.
    """
    senders: defaultdict[str, set[int]] = defaultdict(set)
    for name, component in samples.readings:
        senders[name[:COPIED_BYTES]].add(component)
    chosen = [
        taken
        for (name, component), taken in sorted(samples.readings.items())
        if component != AUTOPILOT or senders[name[:COPIED_BYTES]] == {AUTOPILOT}
    ]
    if not chosen:
        return np.empty(0, np.int64), np.empty(0)
    times = np.concatenate([np.fromiter(taken.keys(), np.int64, len(taken)) for taken in chosen])
    values = np.concatenate([np.fromiter(taken.values(), np.float64, len(taken)) for taken in chosen])
    order = np.argsort(times, kind="stable")
    time_ms, first, counts = np.unique(times[order], return_index=True, return_counts=True)
    return time_ms, np.add.reduceat(values[order], first) / counts


def _choose(
    chains: list[list[FlownLeg]], ways: Sequence[tuple[Event, Event]], counts: Counter[str], plan: PlanFacts | None
) -> tuple[FlownLeg, ...]:
    longest_m = max((leg.length_m for chain in chains for leg in chain), default=0.0)
    least_m = max(MIN_LENGTH_M, MIN_LENGTH_SHARE * longest_m)
    kept = [[leg for leg in chain if leg.length_m > least_m] for chain in chains]
    counts["legs short"] = sum(map(len, chains)) - sum(map(len, kept))
    chain, run = max(((chain, run) for chain in kept for run in _runs(chain)), key=lambda each: _worth(each[1]))
    if not run:
        return ()
    counts["legs with few readings"] = sum(leg.value.size < MIN_READINGS for leg in chain)
    boots = {start.time_ms: start.boot for start, _ in ways}  # a start's time is its own: clocks never fall
    starts_ms = boots if plan is not None else [leg.start_ms for legs in kept for leg in legs]
    zero_ms = min(t for t in starts_ms if boots[t] == boots[chain[0].start_ms])
    numbers, few = _numbered(chain, run, plan)
    return tuple(replace(leg, zero_ms=zero_ms, number=numbers[leg.start_ms], few=few) for leg in run)


def _runs(chain: list[FlownLeg]) -> list[list[FlownLeg]]:
    """Its unbroken runs of legs that say something; itself where none is long enough to estimate with."""
    runs = [_trimmed(list(legs)) for says, legs in groupby(chain, key=_says) if says]
    return runs if any(len(run) >= LEAST_LEGS for run in runs) else [_trimmed(chain)]


def _says(leg: FlownLeg) -> bool:
    """Whether an estimate can be made with it."""
    return leg.value.size >= LEAST_READINGS and float(np.ptp(leg.distance_m)) >= LEAST_REACH * leg.length_m


def _trimmed(legs: list[FlownLeg]) -> list[FlownLeg]:
    """From the first leg with enough readings to the last."""
    enough = [j for j, leg in enumerate(legs) if leg.value.size >= MIN_READINGS]
    return legs[enough[0] : enough[-1] + 1] if enough else []


def _worth(run: list[FlownLeg]) -> tuple[bool, int]:
    """Whether it can be estimated with, and how many of its legs were read well."""
    usable = len(run) >= LEAST_LEGS and all(map(_says, run))
    return usable, sum(leg.value.size >= MIN_READINGS for leg in run)


def _numbered(
    chain: list[FlownLeg], run: list[FlownLeg], plan: PlanFacts | None
) -> tuple[dict[int, int], tuple[tuple[int, int], ...]]:
    """The number of every leg of a chain by its start, and those left out for want of readings: (number, readings).

    Without a plan what was flown before the first reading and after the last is no part of the path.
    """
    flown = chain if plan is not None else _trimmed(chain)
    numbers = {
        leg.start_ms: j if plan is None else plan.vertices.index(leg.start_seq) + 1 for j, leg in enumerate(flown, 1)
    }
    used = {leg.start_ms for leg in run}
    few = ((numbers[leg.start_ms], leg.value.size) for leg in flown if leg.start_ms not in used and not _enough(leg))
    return numbers, tuple(few)


def _enough(leg: FlownLeg) -> bool:
    return _says(leg) and leg.value.size >= MIN_READINGS
