"""What the loopback vehicle knows of its place, and what it does not: origin, drift, a feed that stops. Pure.

Everything the vehicle does it does where it believes to be; where it truly is differs by the drift of its dead
reckoning: a slow creep, and a scale and a turn of the way flown. The size is as measured on ArduCopter's optical flow
(0.6 to 2.6 m over 200 to 280 m).
"""

from __future__ import annotations

import math

import numpy as np

from dslam_mav.mission import Home
from sim_bridge.loopback.flight import NEVER_MS
from sim_bridge.loopback.flight_model import Place
from sim_bridge.loopback.manners import Manners

FAILSAFE_MS = 8_000
JUMP_M = 5.0
JUMP_FAILSAFE_MS = 11_000
"""How long a vehicle flies on after its external navigation jumped without saying so."""

_FRESH_MS = 1_000
_CREEP_M_S = 0.006
_STRETCH = 0.012
_FRAMES = frozenset({(20, 12)})  # LOCAL_FRD, BODY_FRD: ArduPilot silently ignores all others
_EKF_READY_MS = 2_000


class Navigation:
    """Origin and feed of one vehicle; drift by `seed`."""

    def __init__(self, manners: Manners, seed: int) -> None:
        self._manners = manners
        self._origin: Home | None = None
        self._fed_ms = -NEVER_MS
        self._fed: tuple[Place, int] | None = None
        self._jumped_ms = NEVER_MS
        draw = np.random.default_rng((seed, 1))
        angle, size = draw.uniform(0.0, math.tau), draw.uniform(0.7, 1.3)
        self._creep_m_s = (size * _CREEP_M_S * math.cos(angle), size * _CREEP_M_S * math.sin(angle))
        self._stretch = draw.normal(0.0, _STRETCH, (2, 2)).tolist()

    def located(self, time_ms: int) -> bool:
        """Whether it can tell a latitude."""
        if not self._manners.needs_origin:
            return time_ms >= self._manners.ready_ms // 2
        return self._origin is not None

    def set_origin(self, origin: Home, time_ms: int) -> bool:
        """SET_GPS_GLOBAL_ORIGIN: taken once, and not before the EKF runs."""
        if self._origin is None and self._manners.needs_origin and time_ms >= _EKF_READY_MS:
            self._origin = origin
            return True
        return False

    def feed(self, frames: tuple[int, int], place_m: Place, resets: int, time_ms: int) -> None:
        """ODOMETRY in (frame, child frame), with its place and reset counter."""
        if self._manners.name == "ardupilot" and frames not in _FRAMES:
            return
        if self._fed is not None and math.dist(place_m, self._fed[0]) >= JUMP_M and resets == self._fed[1]:
            self._jumped_ms = min(self._jumped_ms, time_ms)
        self._fed_ms, self._fed = time_ms, (place_m, resets)

    def why_not(self, time_ms: int) -> str:
        """What keeps it from being armed; "" if nothing."""
        if time_ms < self._manners.ready_ms:
            return "AHRS: waiting for home" if self.located(time_ms) else "EKF3 still initialising"
        if not self.located(time_ms):
            return "Need Position Estimate"
        if self._manners.feed == "odometry" and time_ms - self._fed_ms > _FRESH_MS:
            return "VisOdom: not healthy"
        return ""

    def refusal(self, time_ms: int, *, guided: bool) -> str:
        """The answer to who wants to arm it; "" if it will be."""
        if self._manners.guided_first and not guided:
            return "Arm: mode not armable"
        why = self.why_not(time_ms)
        return f"PreArm: {why}" if why else ""

    @property
    def failsafe_ms(self) -> int:
        """When a vehicle in flight gives up, unless its feed goes on."""
        if self._manners.feed != "odometry":
            return NEVER_MS
        return min(self._fed_ms + FAILSAFE_MS, self._jumped_ms + JUMP_FAILSAFE_MS)

    def true_m(self, place_m: Place, time_ms: int) -> Place:
        """Where it is when it believes to be at `place_m` (NED)."""
        if not self._manners.drifts:
            return place_m
        north, east, down = place_m
        (nn, ne), (en, ee) = self._stretch
        seconds = time_ms / 1000.0
        return (
            north + self._creep_m_s[0] * seconds + nn * north + ne * east,
            east + self._creep_m_s[1] * seconds + en * north + ee * east,
            down,
        )
