"""How the loopback vehicle flies a mission: straight segments between exact corners. Pure kinematics.

A flight is laid out in advance, in whole milliseconds from its start, so that it repeats bit for bit whatever
the host does. Places are NED metres from home. A segment's end is the first whole millisecond at which its
target is reached; the vehicle is then exactly on it. Accelerations are not modelled: a corner is a corner.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from dslam_mav.mission import (
    CMD_CHANGE_SPEED,
    CMD_LAND,
    CMD_RETURN_TO_LAUNCH,
    CMD_TAKEOFF,
    CMD_WAYPOINT,
    Home,
    MissionItem,
    e7_to_enu,
)

CMD_LOITER_TIME = 19
CMD_DELAY = 93

CLIMB_M_S = 2.5
DESCEND_M_S = 1.5

_ABSOLUTE_FRAMES = frozenset({0, 5})

Place = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Segment:
    """One straight piece, or a wait, from `start_ms` to `end_ms` after the flight's start.

    `seq` is the mission item flown to. `reached`: its end completes the item; `corner`: its end is a place to
    report.
    """

    seq: int
    start_ms: int
    end_ms: int
    origin_m: Place
    target_m: Place
    velocity_m_s: Place
    yaw_rad: float
    corner: bool = False
    reached: bool = False

    def place_m(self, time_ms: int) -> Place:
        """NED place at `time_ms`; exactly the target from the end on."""
        if time_ms >= self.end_ms:
            return self.target_m
        elapsed_s = (time_ms - self.start_ms) / 1000.0
        north, east, down = (o + v * elapsed_s for o, v in zip(self.origin_m, self.velocity_m_s, strict=True))
        return north, east, down


@dataclass(frozen=True, slots=True)
class Timeline:
    """A whole flight, laid out from `origin_m` and `yaw_rad`; `lands` says that it ends on the ground."""

    segments: tuple[Segment, ...]
    lands: bool
    origin_m: Place = (0.0, 0.0, 0.0)
    yaw_rad: float = 0.0

    def at(self, time_ms: int) -> Segment:
        """The segment under way at `time_ms` (at a boundary: the one that begins)."""
        index = bisect_right(self.segments, time_ms, key=lambda segment: segment.start_ms) - 1
        return self.segments[max(index, 0)]


class _Layout:
    """Segments put one after the other."""

    def __init__(self, place_m: Place, yaw_rad: float, speed_m_s: float) -> None:
        self.segments: list[Segment] = []
        self.place_m = place_m
        self.yaw_rad = yaw_rad
        self.speed_m_s = speed_m_s
        self.time_ms = 0

    def fly(self, seq: int, target_m: Place, speed_m_s: float, *, corner: bool, reached: bool) -> None:
        """A straight line at `speed_m_s`."""
        step = tuple(t - p for t, p in zip(target_m, self.place_m, strict=True))
        length_m = math.hypot(*step)
        duration_ms = math.ceil(length_m / speed_m_s * 1000.0 - 1e-6)
        north, east, down = (d / length_m * speed_m_s if length_m > 0.0 else 0.0 for d in step)
        if math.hypot(step[0], step[1]) > 0.01:
            self.yaw_rad = math.atan2(step[1], step[0])
        self._add(seq, duration_ms, target_m, (north, east, down), corner=corner, reached=reached)

    def wait(self, seq: int, duration_s: float) -> None:
        """Stay in place; its end completes the item."""
        duration_ms = max(0, round(duration_s * 1000.0))
        self._add(seq, duration_ms, self.place_m, (0.0, 0.0, 0.0), corner=True, reached=True)

    def _add(
        self, seq: int, duration_ms: int, target_m: Place, velocity_m_s: Place, *, corner: bool, reached: bool
    ) -> None:
        end_ms = self.time_ms + duration_ms
        self.segments.append(
            Segment(
                seq,
                self.time_ms,
                end_ms,
                self.place_m,
                target_m,
                velocity_m_s,
                self.yaw_rad,
                corner=corner,
                reached=reached,
            )
        )
        self.place_m, self.time_ms = target_m, end_ms


def lay_out(
    items: Sequence[MissionItem],
    home: Home,
    place_m: Place,
    *,
    speed_m_s: float,
    yaw_rad: float = 0.0,
    first: int = 0,
) -> Timeline:
    """The flight of `items` from item `first` on, begun at `place_m` with cruise speed `speed_m_s`.

    A take-off climbs in place. Without one the vehicle climbs in place to the first waypoint's altitude.
    """
    layout = _Layout(place_m, yaw_rad, speed_m_s)
    lands = False
    for seq, item in list(enumerate(items))[first:]:
        if lands:
            break
        lands = _add_item(layout, seq, item, home, speed_m_s)
    return Timeline(tuple(layout.segments), lands, place_m, yaw_rad)


def speed_before(items: Sequence[MissionItem], seq: int, default_m_s: float) -> float:
    """The cruise speed that the items before item `seq` ask for."""
    layout = _Layout((0.0, 0.0, 0.0), 0.0, default_m_s)
    for item in items[:seq]:
        _change_speed(layout, item, default_m_s)
    return layout.speed_m_s


def _change_speed(layout: _Layout, item: MissionItem, default_m_s: float) -> None:
    if item.command != CMD_CHANGE_SPEED:
        return
    if (wanted := item.params[1]) > 0.0:
        layout.speed_m_s = wanted
    elif wanted == -2.0:  # "back to the default"
        layout.speed_m_s = default_m_s


def _add_item(layout: _Layout, seq: int, item: MissionItem, home: Home, default_m_s: float) -> bool:
    """Lay out one item; True if it ends on the ground."""
    if item.command == CMD_CHANGE_SPEED:
        _change_speed(layout, item, default_m_s)
    elif item.command == CMD_TAKEOFF:
        north, east, _ = layout.place_m
        layout.fly(seq, (north, east, _down_m(item, home)), CLIMB_M_S, corner=True, reached=True)
    elif item.command in (CMD_WAYPOINT, CMD_LOITER_TIME):
        _waypoint(layout, seq, item, home)
    elif item.command == CMD_DELAY:
        layout.wait(seq, _seconds(item.params[0]))
    elif item.command in (CMD_RETURN_TO_LAUNCH, CMD_LAND):
        target = (0.0, 0.0) if item.command == CMD_RETURN_TO_LAUNCH else _ground(layout, item, home)
        layout.fly(seq, (*target, layout.place_m[2]), layout.speed_m_s, corner=True, reached=False)
        layout.fly(seq, (*target, 0.0), DESCEND_M_S, corner=True, reached=False)
        return True
    return False


def _waypoint(layout: _Layout, seq: int, item: MissionItem, home: Home) -> None:
    target_m = (*_ground(layout, item, home), _down_m(item, home))
    on_ground = layout.place_m[2] > -0.1
    if on_ground and target_m[2] < -0.1:
        north, east, _ = layout.place_m
        layout.fly(seq, (north, east, target_m[2]), CLIMB_M_S, corner=False, reached=False)
    hold_s = _seconds(item.params[0])
    layout.fly(seq, target_m, layout.speed_m_s, corner=True, reached=hold_s == 0.0)
    if hold_s > 0.0:
        layout.wait(seq, hold_s)


def _ground(layout: _Layout, item: MissionItem, home: Home) -> tuple[float, float]:
    if not item.has_position:
        return layout.place_m[0], layout.place_m[1]
    east_m, north_m = e7_to_enu(item.x, item.y, home)
    return north_m, east_m


def _down_m(item: MissionItem, home: Home) -> float:
    return -(item.z - home.altitude_m if item.frame in _ABSOLUTE_FRAMES else item.z)


def _seconds(value: float) -> float:
    return value if math.isfinite(value) and value > 0.0 else 0.0
