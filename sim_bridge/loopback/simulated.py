"""What the simulator behind a loopback vehicle tells of its true place, drift and all. Pure."""

from __future__ import annotations

from typing import Any, Protocol

from dslam_mav.mav.frames import messages
from dslam_mav.mission import Home, enu_to_e7
from sim_bridge.loopback.flight_model import Place


class Simulated(Protocol):
    """What is needed of a snapshot."""

    @property
    def time_ms(self) -> int: ...  # noqa: D102
    @property
    def true_m(self) -> Place: ...  # noqa: D102
    @property
    def velocity_m_s(self) -> Place: ...  # noqa: D102
    @property
    def attitude_rad(self) -> Place: ...  # noqa: D102
    @property
    def home(self) -> Home: ...  # noqa: D102


def sim_state(now: Simulated) -> Any:
    """ArduPilot's simulator: it has no time of its own."""
    x, y = enu_to_e7(now.true_m[1], now.true_m[0], now.home)
    roll_pitch_yaw, nothing = now.attitude_rad, (0.0,) * 6
    return messages().MAVLink_sim_state_message(
        1.0, 0.0, 0.0, 0.0, *roll_pitch_yaw, *nothing, float(x), float(y), now.home.altitude_m - now.true_m[2],
        0.0, 0.0, *now.velocity_m_s, x, y,
    )  # fmt: skip


def hil_state_quaternion(now: Simulated) -> Any:
    """PX4's simulator in hardware."""
    x, y = enu_to_e7(now.true_m[1], now.true_m[0], now.home)
    velocity_cm_s = [round(v * 100) for v in now.velocity_m_s]
    return messages().MAVLink_hil_state_quaternion_message(
        now.time_ms * 1000, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, x, y,
        round((now.home.altitude_m - now.true_m[2]) * 1000), *velocity_cm_s, 0, 0, 0, 0, 0,
    )  # fmt: skip
