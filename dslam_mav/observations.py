"""All that the estimator is ever allowed to see of a flight: GPS-denied by construction.

MAVLink decoding (`mav/decode.py`) turns frames into these few records and drops everything else, so no
position, no heading and no map can leak into an estimate. Times are whole milliseconds of the vehicle's clock
(`time_boot_ms`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Reading:
    """One value of the scalar sensor (NAMED_VALUE_FLOAT `THERMAL`, `THERMAL2`, …).

    `component` is who sent it: an autopilot may repeat what it forwards, and a copy must not count twice.
    """

    time_boot_ms: int
    value: float
    name: str = "THERMAL"
    component: int = 158


@dataclass(frozen=True, slots=True)
class Progress:
    """A mission sequence number: reached (MISSION_ITEM_REACHED) or now flown to (MISSION_CURRENT)."""

    seq: int
    reached: bool


@dataclass(frozen=True, slots=True)
class Odometry:
    """The vehicle's own dead reckoning (LOCAL_POSITION_NED): used only as a distance along one leg."""

    time_boot_ms: int
    x_m: float
    y_m: float
    vx_m_s: float
    vy_m_s: float


@dataclass(frozen=True, slots=True)
class GroundSpeed:
    """VFR_HUD.groundspeed: unsigned, without a time of its own."""

    speed_m_s: float


@dataclass(frozen=True, slots=True)
class Yaw:
    """ATTITUDE.yaw in NED (clockwise from north): decoded only for `--heading vehicle`."""

    time_boot_ms: int
    yaw_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class ReadingSeries:
    """All readings of one sender in a recording, in its order: (N,) each. `order` is their place among all packets."""

    name: str
    component: int
    order: NDArray[np.int64]
    time_boot_ms: NDArray[np.int64]
    value: NDArray[np.float64]


Observation = Reading | Progress | Odometry | GroundSpeed | Yaw
