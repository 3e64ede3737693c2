"""ODOMETRY for a vehicle whose pilot asked for it: where an anchored answer has it now. Pure.

The answer says where the last leg that it knows ended; from there on the vehicle's own dead reckoning counts as it does
for the estimate, as metres along each leg, and the leg's direction is the plan's or the compass's. Height, attitude and
climb rate are handed back as the vehicle has them. Nothing of this reaches an estimate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dslam_mav.legs import FlownLeg
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, messages
from dslam_mav.records import Estimate, Verdict

LOCAL_NED, BODY_FRD, LOCAL_FRD = 1, 12, 20
OTHERS_S = 5.0
"""For so long after somebody else's external navigation none of ours is sent."""

QUALITY = {Verdict.IDENTIFIED: 100, Verdict.AMBIGUOUS: 50, Verdict.MODEL_MISFIT: 25}
FAILED = -1
"""The quality where the newest answer gives no positions: the last one that did is flown on from."""

_EXTERNAL = ("ODOMETRY", "VISION_POSITION_ESTIMATE")
_UNKNOWN = [math.nan] * 21

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # w, x, y, z


@dataclass(slots=True)
class _Way:
    """What was flown since an item was passed: `begun` by dead reckoning, `east_m`, `north_m` by heading."""

    event: tuple[int, int]
    begun: tuple[float, float]
    east_m: float = 0.0
    north_m: float = 0.0


class OdometryOut:
    """What component `component` of vehicle `system` is to send; `planned_rad`: the plan's directions by the item each
    leg begins at, None: the compass's. `frame` as the autopilot takes it. `muted` says that somebody else sends some.
    """

    def __init__(self, system: int, component: int, planned_rad: Mapping[int, float] | None, frame: int) -> None:
        self.muted = False
        self._system = system
        self._component = component
        self._planned_rad = planned_rad
        self._frame = frame
        self._attitude: Vector | None = None
        self._ways: list[_Way] = []
        self._last: tuple[float, float] | None = None
        self._corner_m: tuple[float, float] | None = None
        self._quality = FAILED
        self._resets = 0
        self._others_s = -math.inf

    def answered(self, estimate: Estimate, legs: tuple[FlownLeg, ...]) -> None:
        """Another estimate, of these legs."""
        end_m = estimate.path.vertices_m[-1]
        known = estimate.gauge == "anchored" and estimate.verdict in QUALITY and bool(np.isfinite(end_m).all())
        self._quality = QUALITY[estimate.verdict] if known else FAILED
        if not known or not legs:
            return
        self._corner_m = float(end_m[0]), float(end_m[1])
        self._resets = (self._resets + 1) % 256  # the place jumps: an autopilot that is not told so gives up
        ended = [k for k, way in enumerate(self._ways) if way.event[0] == legs[-1].end_seq]
        self._ways = self._ways[ended[-1] :] if ended else []

    def hear(self, message: Any, passed: tuple[int, int] | None, now_s: float) -> Any | None:
        """The ODOMETRY due by one message of the vehicle's system, or None; `passed`: the last item, and when."""
        kind = message.get_type()
        source = message.get_srcSystem(), message.get_srcComponent()
        if kind in _EXTERNAL and source[0] == self._system and source[1] not in (COMPONENT_AUTOPILOT, self._component):
            self._others_s = now_s
        self.muted = now_s - self._others_s < OTHERS_S
        if source != (self._system, COMPONENT_AUTOPILOT):
            return None
        if kind == "ATTITUDE":
            self._attitude = message.roll, message.pitch, message.yaw
        if kind != "LOCAL_POSITION_NED" or passed is None or self._attitude is None:
            return None
        heading_rad = self._heading_rad(passed[0], self._attitude[2])
        if heading_rad is None:
            return None
        speed_m_s = self._follow(message, passed, heading_rad)
        if self._corner_m is None or self.muted:
            return None
        east_m, north_m = self._corner_m
        place = (north_m + sum(w.north_m for w in self._ways), east_m + sum(w.east_m for w in self._ways), message.z)
        velocity = (speed_m_s * math.sin(heading_rad), speed_m_s * math.cos(heading_rad), message.vz)
        return odometry_message(
            int(message.time_boot_ms), self._frame, place, velocity, quaternion(self._attitude),
            quality=self._quality, resets=self._resets,
        )  # fmt: skip

    def _heading_rad(self, seq: int, yaw_rad: float) -> float | None:
        """Of the leg that begins at this item, counter-clockwise from east; None: it is none of the plan's."""
        return 0.5 * math.pi - yaw_rad if self._planned_rad is None else self._planned_rad.get(seq)

    def _follow(self, message: Any, passed: tuple[int, int], heading_rad: float) -> float:
        """Count the way flown; the speed along it."""
        here = message.x, message.y
        if not self._ways or self._ways[-1].event != passed:
            self._ways.append(_Way(passed, self._last or here))
        self._last, way = here, self._ways[-1]
        x, y = message.x - way.begun[0], message.y - way.begun[1]
        moved_m = math.hypot(x, y)
        way.east_m, way.north_m = moved_m * math.cos(heading_rad), moved_m * math.sin(heading_rad)
        return (x * message.vx + y * message.vy) / moved_m if moved_m > 0.0 else math.hypot(message.vx, message.vy)


def odometry_message(
    time_ms: int, frame: int, place: Vector, velocity: Vector, attitude: Quaternion, *, quality: int, resets: int = 0
) -> Any:
    """ODOMETRY of a place and a velocity in north, east, down; the velocity goes out as the body has it."""
    return messages().MAVLink_odometry_message(
        time_ms * 1000, frame, BODY_FRD, *place, list(attitude), *to_body(velocity, attitude), 0.0, 0.0, 0.0,
        _UNKNOWN, _UNKNOWN, resets, messages().MAV_ESTIMATOR_TYPE_VISION, quality,
    )  # fmt: skip


def to_body(vector: Vector, attitude: Quaternion) -> Vector:
    """A vector in north, east, down as the vehicle turned by `attitude` (body to NED) has it: forward, right, down."""
    w, x, y, z = attitude
    n, e, d = vector
    return (
        (1 - 2 * (y * y + z * z)) * n + 2 * (x * y + w * z) * e + 2 * (x * z - w * y) * d,
        2 * (x * y - w * z) * n + (1 - 2 * (x * x + z * z)) * e + 2 * (y * z + w * x) * d,
        2 * (x * z + w * y) * n + 2 * (y * z - w * x) * e + (1 - 2 * (x * x + y * y)) * d,
    )


def quaternion(roll_pitch_yaw_rad: Vector) -> Quaternion:
    """The turn from body to NED."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(0.5 * a), math.cos(0.5 * a)) for a in roll_pitch_yaw_rad)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
