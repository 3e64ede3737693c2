"""The streams asked of an autopilot: ArduPilot sends nothing but HEARTBEAT, STATUSTEXT and PARAM_VALUE until asked,
message by message and per link. Pure.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, messages

ONBOARD_US = {"LOCAL_POSITION_NED": 50_000, "VFR_HUD": 100_000, "MISSION_CURRENT": 200_000}
YAW_US = {"ATTITUDE": 50_000}
TRUTH_US = {"SIM_STATE": 50_000, "HIL_STATE_QUATERNION": 50_000}
"""Where a simulator says that the vehicle truly is; real vehicles refuse."""

_AGAIN_S = 2.0
_MISSED_S = 4.0
_TRIES = 5


class StreamRequests:
    """What to ask, and when: what was not heard for `ask_after_s`, every two seconds; again what falls silent, as after
    a restart. `optional` streams are asked for five times, for not every vehicle has them.
    """

    def __init__(
        self,
        system: int,
        wanted_us: Mapping[str, int],
        now_s: float,
        *,
        ask_after_s: float = 0.0,
        optional_us: Mapping[str, int] | None = None,
    ) -> None:
        self._system = system
        self._wanted_us = {**wanted_us, **(optional_us or {})}
        self._due_s = dict.fromkeys(self._wanted_us, now_s + ask_after_s)
        self._tries = dict.fromkeys(optional_us or {}, _TRIES)

    def see(self, message: Any, now_s: float) -> None:
        """A message of the autopilot's."""
        kind = message.get_type()
        if kind in self._due_s:
            self._due_s[kind] = now_s + _MISSED_S

    def due(self, now_s: float) -> list[Any]:
        """The requests to send now."""
        names = [name for name, due_s in self._due_s.items() if now_s >= due_s and self._tries.get(name, 1) > 0]
        for name in names:
            self._due_s[name] = now_s + _AGAIN_S
            if name in self._tries:
                self._tries[name] -= 1
        return [stream_request(self._system, name, self._wanted_us[name]) for name in names]


def stream_request(system: int, name: str, interval_us: int) -> Any:
    """COMMAND_LONG that asks for one message every so often; 0: at the vehicle's own rate."""
    dialect = messages()
    return dialect.MAVLink_command_long_message(
        system, COMPONENT_AUTOPILOT, dialect.MAV_CMD_SET_MESSAGE_INTERVAL,
        0, getattr(dialect, f"MAVLINK_MSG_ID_{name}"), interval_us, 0, 0, 0, 0, 0,
    )  # fmt: skip
