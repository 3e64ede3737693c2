"""Where the loopback vehicle is and how it is turned: NED metres from home, and a little trembling. Pure."""

from __future__ import annotations

import math

import numpy as np

from sim_bridge.loopback.flight_model import Place, Segment

ATTITUDE_JITTER_RAD = 0.002
_JITTERS = 1009
_STILL = (0.0, 0.0, 0.0)


class Body:
    """Place, velocity and yaw now; the attitude trembles by `seed`, alike after every `anchor`."""

    def __init__(self, seed: int) -> None:
        self.place_m: Place = _STILL
        self.velocity_m_s: Place = _STILL
        self.yaw_rad = 0.0
        self._jitter_rad = np.random.default_rng(seed).normal(0.0, ATTITUDE_JITTER_RAD, (_JITTERS, 3)).tolist()
        self._zero_ms = 0

    def anchor(self, time_ms: int) -> None:
        """The trembling begins anew: a flight's start."""
        self._zero_ms = time_ms

    def attitude_rad(self, time_ms: int) -> tuple[float, float, float]:
        """Roll, pitch and yaw at that moment."""
        roll, pitch, yaw = self._jitter_rad[(time_ms - self._zero_ms) // 10 % _JITTERS]
        return roll, pitch, math.remainder(self.yaw_rad + yaw, math.tau)

    def follow(self, segment: Segment) -> None:
        """Turn and move as on that segment."""
        self.velocity_m_s, self.yaw_rad = segment.velocity_m_s, segment.yaw_rad

    def stop(self) -> None:
        """No longer move."""
        self.velocity_m_s = _STILL

    def drop(self) -> None:
        """Lie on the ground below."""
        self.place_m = (self.place_m[0], self.place_m[1], 0.0)
