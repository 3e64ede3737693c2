"""The streams that the loop on board asks an autopilot for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, messages

_STREAM_US = {"LOCAL_POSITION_NED": 50_000, "VFR_HUD": 100_000, "MISSION_CURRENT": 200_000}


def stream_requests(vehicle_system: int, *, yaw: bool) -> Iterator[Any]:
    """COMMAND_LONG for every message needed: ArduPilot sends nothing but HEARTBEAT to a serial port until asked,
    message by message and per link.
    """
    dialect = messages()
    for name, interval_us in (_STREAM_US | ({"ATTITUDE": 50_000} if yaw else {})).items():
        yield dialect.MAVLink_command_long_message(
            vehicle_system, COMPONENT_AUTOPILOT, dialect.MAV_CMD_SET_MESSAGE_INTERVAL,
            0, getattr(dialect, f"MAVLINK_MSG_ID_{name}"), interval_us, 0, 0, 0, 0, 0,
        )  # fmt: skip
