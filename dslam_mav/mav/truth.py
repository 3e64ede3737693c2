"""Where a simulator says that its vehicle truly is: for readings computed there, never for an estimate. Pure.

SIM_STATE and SIMSTATE (ArduPilot) carry no time: it is that of the message before. SIM_STATE's float latitude is
degrees · 1e7 in ArduPilot, degrees in MAVLink's definition: its whole numbers are taken where they are filled.
"""

from __future__ import annotations

from typing import Any

from dslam_mav.mission import DEGREES_E7, Home

KINDS = ("SIM_STATE", "HIL_STATE_QUATERNION", "SIMSTATE")
"""The best first: SIMSTATE has no altitude."""


def true_place(message: Any) -> Home | None:
    """The place in a simulator's message, altitude above sea level (SIMSTATE: 0); None for every other message."""
    match message.get_type():
        case "SIM_STATE":
            latitude_e7, longitude_e7, altitude_m = message.lat_int, message.lon_int, message.alt
            if (latitude_e7, longitude_e7) == (0, 0):
                scale = 1.0 if abs(message.lat) > 90.0 or abs(message.lon) > 180.0 else DEGREES_E7
                latitude_e7, longitude_e7 = message.lat * scale, message.lon * scale
        case "SIMSTATE":
            latitude_e7, longitude_e7, altitude_m = message.lat, message.lng, 0.0
        case "HIL_STATE_QUATERNION":
            latitude_e7, longitude_e7, altitude_m = message.lat, message.lon, message.alt / 1000.0
        case _:
            return None
    if (latitude_e7, longitude_e7) == (0, 0):
        return None
    try:
        return Home(latitude_e7 / DEGREES_E7, longitude_e7 / DEGREES_E7, float(altitude_m))
    except ValueError:
        return None
