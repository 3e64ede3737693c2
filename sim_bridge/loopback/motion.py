"""How a copter with inertia flies a mission: it speeds up and slows down, overshoots its stops and comes back, and cuts
the corners it is not told to stop at. Pure; laid out in advance as `flight_model` does, in steps of 20 ms.

A point runs along the legs with limited acceleration, as ArduPilot's navigation has it, and the vehicle follows that
point as a spring with too little damping does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sim_bridge.loopback.flight_model import Place, Segment, Timeline

STEP_MS = 20
ACCELERATION_M_S2 = 2.5
_STIFFNESS = 1.3**2  # 1/s²
_DAMPING = 2.0 * 0.35 * 1.3  # 1/s
_NEAR_M = 0.02
_REACH = 2.0 * math.sqrt(2.0)  # a parabola from so far before a right angle passes it at 1
STILL: Place = (0.0, 0.0, 0.0)
_SETTLE_S = 30.0


@dataclass(frozen=True, slots=True)
class _Bend:
    """A corner flown round: a parabola from `length_m` before it to as far behind it."""

    before_m: Place
    corner_m: Place
    after_m: Place

    def at(self, share: float, rate_per_s: float) -> tuple[Place, Place, Place]:
        """Place, velocity and acceleration at a share of the way, which grows by so much a second."""
        u, v = share, 1.0 - share
        rows = list(zip(self.before_m, self.corner_m, self.after_m, strict=True))
        place = _place([v * v * a + 2 * u * v * c + u * u * b for a, c, b in rows])
        velocity = _place([2 * rate_per_s * (v * (c - a) + u * (b - c)) for a, c, b in rows])
        return place, velocity, _place([2 * rate_per_s**2 * (a - 2 * c + b) for a, c, b in rows])


@dataclass(slots=True)
class _State:
    """Vehicle, NED, and the bend it is halfway through."""

    place_m: list[float]
    velocity_m_s: list[float]
    time_ms: int = 0
    bend: _Bend | None = None


def with_inertia(timeline: Timeline, accept_m: float, velocity_m_s: Place = STILL) -> Timeline:
    """The same flight as a vehicle with mass flies it; a right angle without a wait is cut by about `accept_m`.

    `velocity_m_s`: NED, at the flight's start.
    """
    if not timeline.segments:
        return timeline
    out: list[Segment] = []
    state = _State(list(timeline.segments[0].origin_m), list(velocity_m_s))
    segments = timeline.segments
    for index, segment in enumerate(segments):
        following = segments[index + 1] if index + 1 < len(segments) else None
        _fly(state, segment, _bend(segment, following, accept_m), out)
    return Timeline(tuple(out), timeline.lands, timeline.origin_m, timeline.yaw_rad)


def _bend(segment: Segment, following: Segment | None, accept_m: float) -> _Bend | None:
    """How the corner at the segment's end is flown round; None: the vehicle stops there."""
    if following is None or not segment.reached or segment.velocity_m_s[2] or following.velocity_m_s[2]:
        return None
    here_m, next_m = (math.dist(s.origin_m, s.target_m) for s in (segment, following))
    length_m = min(_REACH * accept_m, 0.45 * here_m, 0.45 * next_m)
    if length_m == 0.0:
        return None
    corner = segment.target_m
    before = _between(corner, segment.origin_m, length_m / here_m)
    return _Bend(before, corner, _between(corner, following.target_m, length_m / next_m))


def _fly(state: _State, segment: Segment, bend: _Bend | None, out: list[Segment]) -> None:
    origin, target = segment.origin_m, segment.target_m
    length_m, cruise_m_s = math.dist(origin, target), math.hypot(*segment.velocity_m_s)
    if length_m == 0.0:
        for _ in range(0, segment.end_ms - segment.start_ms, STEP_MS):
            _step(state, segment, (target, STILL, STILL), out)
        _close(state, segment, out)
        return
    begun_m = 0.0
    if state.bend is not None:
        _round(state, segment, state.bend, 0.5, out)
        begun_m = math.dist(state.bend.after_m, origin)
    end_m = length_m if bend is None else length_m - math.dist(bend.before_m, target)
    run = _Run(begun_m, end_m, cruise_m_s, stops=bend is None)
    latest_ms = state.time_ms + run.longest_ms
    while not (run.done and (bend is not None or math.dist(state.place_m, target) <= _arrival_m(segment))):
        if state.time_ms > latest_ms:
            break
        distance_m, speed_m_s = run.step()
        lead = _between(origin, target, distance_m / length_m)
        velocity = _place([v / cruise_m_s * speed_m_s for v in segment.velocity_m_s])
        _step(state, segment, (lead, velocity, STILL), out)
    if bend is not None:
        _round(state, segment, bend, 0.0, out)
    state.bend = bend
    _close(state, segment, out)


def _round(state: _State, segment: Segment, bend: _Bend, share: float, out: list[Segment]) -> None:
    """Half a bend, at about the leg's speed."""
    way_m = 0.5 * (math.dist(bend.before_m, bend.corner_m) + math.dist(bend.corner_m, bend.after_m))
    rate_per_s = 0.5 * math.hypot(*segment.velocity_m_s) / way_m
    end = share + 0.5
    while (share := share + rate_per_s * STEP_MS / 1000.0) < end:
        _step(state, segment, bend.at(share, rate_per_s), out)


def _arrival_m(segment: Segment) -> float:
    """How near the vehicle must be for the wait to begin, or to be on the ground."""
    return 0.1 if segment.target_m[2] == 0.0 and segment.velocity_m_s[2] > 0.0 else 2.0


class _Run:
    """The leading point's straight way along one leg, from `begun_m`, where it has cruising speed if not 0."""

    def __init__(self, begun_m: float, end_m: float, cruise_m_s: float, *, stops: bool) -> None:
        self._end_m = end_m
        self._cruise_m_s = cruise_m_s
        self._stops = stops
        self._distance_m = begun_m
        self._speed_m_s = cruise_m_s if begun_m else 0.0
        self.longest_ms = int(1000.0 * (end_m / cruise_m_s + 2.0 * cruise_m_s / ACCELERATION_M_S2 + _SETTLE_S))

    @property
    def done(self) -> bool:
        """Whether the point has arrived."""
        return self._distance_m >= self._end_m - _NEAR_M

    def step(self) -> tuple[float, float]:
        """Distance and speed a step later."""
        dt_s = STEP_MS / 1000.0
        left_m = max(0.0, self._end_m - self._distance_m)
        allowed_m_s = self._cruise_m_s
        if self._stops:
            allowed_m_s = min(allowed_m_s, math.sqrt(2.0 * ACCELERATION_M_S2 * left_m))
        self._speed_m_s = min(self._speed_m_s + ACCELERATION_M_S2 * dt_s, allowed_m_s)
        self._distance_m = min(self._distance_m + self._speed_m_s * dt_s, self._end_m)
        if self._stops and left_m < _NEAR_M:
            self._distance_m, self._speed_m_s = self._end_m, 0.0
        return self._distance_m, self._speed_m_s


def _step(state: _State, segment: Segment, lead: tuple[Place, Place, Place], out: list[Segment]) -> None:
    """The vehicle follows the leading point's place, velocity and acceleration."""
    dt_s = STEP_MS / 1000.0
    before = _place(state.place_m)
    place_m, velocity_m_s, acceleration_m_s2 = lead
    for j in range(3):
        pull = _STIFFNESS * (place_m[j] - state.place_m[j]) + _DAMPING * (velocity_m_s[j] - state.velocity_m_s[j])
        state.velocity_m_s[j] += (pull + acceleration_m_s2[j]) * dt_s
        state.place_m[j] += state.velocity_m_s[j] * dt_s
    if state.place_m[2] > 0.0:  # the ground is hard
        state.place_m[2], state.velocity_m_s[2] = 0.0, 0.0
    _add(state, segment, before, out)


def _add(state: _State, segment: Segment, before: Place, out: list[Segment]) -> None:
    begin_ms, state.time_ms = state.time_ms, state.time_ms + STEP_MS
    out.append(
        Segment(
            segment.seq, begin_ms, state.time_ms, before, _place(state.place_m), _place(state.velocity_m_s),
            segment.yaw_rad,
        )
    )  # fmt: skip


def _close(state: _State, segment: Segment, out: list[Segment]) -> None:
    """The last step of a segment completes its item, where the segment did."""
    here = _place(state.place_m)
    if segment.target_m[2] == 0.0 and segment.velocity_m_s[2] > 0.0:
        here = (here[0], here[1], 0.0)
        state.place_m, state.velocity_m_s = list(here), [0.0, 0.0, 0.0]
    out.append(
        Segment(
            segment.seq, state.time_ms, state.time_ms, here, here, _place(state.velocity_m_s), segment.yaw_rad,
            corner=False, reached=segment.reached,
        )
    )  # fmt: skip


def _between(one: Place, other: Place, share: float) -> Place:
    return _place([a + share * (b - a) for a, b in zip(one, other, strict=True)])


def _place(values: Sequence[float]) -> Place:
    return values[0], values[1], values[2]
