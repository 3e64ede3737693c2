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
_STILL_M = 0.02
_SETTLE_S = 30.0


@dataclass(slots=True)
class _State:
    """Vehicle and leading point, NED."""

    place_m: list[float]
    velocity_m_s: list[float]
    time_ms: int = 0


def with_inertia(timeline: Timeline, accept_m: float) -> Timeline:
    """The same flight as a vehicle with mass flies it; a corner without a wait is passed within `accept_m` of it."""
    if not timeline.segments:
        return timeline
    out: list[Segment] = []
    state = _State(list(timeline.segments[0].origin_m), [0.0, 0.0, 0.0])
    segments = timeline.segments
    for index, segment in enumerate(segments):
        following = segments[index + 1] if index + 1 < len(segments) else None
        _fly(state, segment, following, accept_m, out)
    return Timeline(tuple(out), timeline.lands)


def _fly(state: _State, segment: Segment, following: Segment | None, accept_m: float, out: list[Segment]) -> None:
    origin, target = segment.origin_m, segment.target_m
    length_m = math.dist(origin, target)
    begin_ms = state.time_ms
    if length_m == 0.0:
        while state.time_ms - begin_ms < segment.end_ms - segment.start_ms:
            _step(state, segment, target, (0.0, 0.0, 0.0), out)
    else:
        along = tuple((t - o) / length_m for t, o in zip(target, origin, strict=True))
        cruise_m_s = math.hypot(*segment.velocity_m_s)
        run = _Run(length_m, cruise_m_s)
        passes = following is not None and segment.reached and math.dist(following.origin_m, following.target_m) > 0.0
        reach_m = accept_m if passes else _arrival_m(segment)
        while not (run.done(passes) and math.dist(state.place_m, target) <= reach_m):
            if state.time_ms - begin_ms > run.longest_ms:
                break
            distance_m, speed_m_s = run.step(passes)
            lead = tuple(o + a * distance_m for o, a in zip(origin, along, strict=True))
            _step(state, segment, lead, tuple(a * speed_m_s for a in along), out)
    _close(state, segment, out)


def _arrival_m(segment: Segment) -> float:
    """How near the vehicle must be for the wait to begin, or to be on the ground."""
    return 0.1 if segment.target_m[2] == 0.0 and segment.velocity_m_s[2] > 0.0 else 2.0


class _Run:
    """The leading point's way along one leg."""

    def __init__(self, length_m: float, cruise_m_s: float) -> None:
        self._length_m = length_m
        self._cruise_m_s = cruise_m_s
        self._distance_m = self._speed_m_s = 0.0
        self.longest_ms = int(1000.0 * (length_m / cruise_m_s + 2.0 * cruise_m_s / ACCELERATION_M_S2 + _SETTLE_S))

    def done(self, passes: bool) -> bool:
        """Whether the point has arrived; one that passes by counts as soon as the vehicle is near."""
        return passes or self._distance_m >= self._length_m - _STILL_M

    def step(self, passes: bool) -> tuple[float, float]:
        """Distance and speed a step later."""
        dt_s = STEP_MS / 1000.0
        left_m = max(0.0, self._length_m - self._distance_m)
        allowed_m_s = self._cruise_m_s if passes else min(self._cruise_m_s, math.sqrt(2.0 * ACCELERATION_M_S2 * left_m))
        self._speed_m_s = min(self._speed_m_s + ACCELERATION_M_S2 * dt_s, allowed_m_s)
        self._distance_m = min(self._distance_m + self._speed_m_s * dt_s, self._length_m)
        if left_m < _STILL_M:
            self._distance_m, self._speed_m_s = self._length_m, 0.0
        return self._distance_m, self._speed_m_s


def _step(
    state: _State, segment: Segment, lead: Sequence[float], lead_m_s: Sequence[float], out: list[Segment]
) -> None:
    dt_s = STEP_MS / 1000.0
    before = _place(state.place_m)
    for j in range(3):
        pull = _STIFFNESS * (lead[j] - state.place_m[j]) + _DAMPING * (lead_m_s[j] - state.velocity_m_s[j])
        state.velocity_m_s[j] += pull * dt_s
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


def _place(values: Sequence[float]) -> Place:
    return values[0], values[1], values[2]
