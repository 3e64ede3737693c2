"""Where a vehicle stands, before it flies: as it says itself, or told to it where it has no GPS.

An EKF without GPS gives no latitude until it is told its origin (SET_GPS_GLOBAL_ORIGIN), and neither ArduPilot nor PX4
flies a mission before.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from dslam_mav.errors import LinkError
from dslam_mav.mav.frames import messages
from dslam_mav.mav.mission.talk import Talk
from dslam_mav.mav.params import read_param
from dslam_mav.mav.ports import Port
from dslam_mav.mav.streams import StreamRequests
from dslam_mav.mav.truth import true_place
from dslam_mav.mission import DEGREES_E7, Home

_WANTED_US = {"GLOBAL_POSITION_INT": 200_000}
_OPTIONAL_US = {"SIM_STATE": 200_000, "HIL_STATE_QUATERNION": 200_000}
_AGAIN_S = 1.0
_LOOK_S = 2.0
_GPS = 3  # of EK3_SRC1_POSXY
_EKFS = ("ardupilot", "px4")

Waiting = Callable[[str], None]


def stands_at(
    link: Port, vehicle_system: int, otherwise: Home | None, patience_s: float, waiting: Waiting | None = None
) -> Home | None:
    """The vehicle's place. One without GPS is told it is where its simulator has it, or else at `otherwise`.

    LinkError when an ArduPilot or a PX4 knows no place within `patience_s`; None for others, which may not tell theirs.
    """
    talk = Talk(link, vehicle_system)
    began_s = time.monotonic()
    if (place := _look(talk, began_s + _LOOK_S)[0]) is not None:
        return place
    if talk.profile().name not in _EKFS:
        return None
    origin_wanted = None
    told_s = 0.0
    while time.monotonic() < began_s + patience_s:
        place, truth = _look(talk, time.monotonic() + _AGAIN_S)
        if place is not None:
            return place
        if origin_wanted is None:  # a vehicle that starts may not answer yet
            origin_wanted = without_gps(talk)
        origin = truth or otherwise
        if origin_wanted and origin is not None and time.monotonic() - told_s >= _AGAIN_S:
            told_s = time.monotonic()
            talk.send(_origin_message(vehicle_system, origin))
        if waiting is not None:
            waiting(
                f"vehicle {vehicle_system} has no position yet: "
                + ("told it where it stands" if origin_wanted else "waiting for its GPS")
                + talk.words()
            )
    raise LinkError(f"vehicle {vehicle_system} on {link.url} knows no position after {patience_s:g} s{talk.words()}")


def without_gps(talk: Talk) -> bool | None:
    """Whether the vehicle's navigation is set not to use GPS, so that nobody but us can tell it where it is; None: it
    does not say.
    """
    if talk.profile().name == "px4":
        control = read_param(talk, "EKF2_GPS_CTRL")
        return None if control is None else control.value == 0
    source = read_param(talk, "EK3_SRC1_POSXY")
    return None if source is None else source.value != _GPS


def _look(talk: Talk, until_s: float) -> tuple[Home | None, Home | None]:
    """What the vehicle says of its place until then, and what its simulator does."""
    now_s = time.monotonic()
    streams = StreamRequests(talk.system, _WANTED_US, now_s, optional_us=_OPTIONAL_US)
    truth: Home | None = None
    while (now_s := time.monotonic()) < until_s:
        for request in streams.due(now_s):
            talk.send(request)
        message = talk.receive(min(until_s, now_s + 0.1))
        if message is None:
            continue
        streams.see(message, now_s)
        truth = true_place(message) or truth
        if (place := _own_place(message)) is not None:
            return place, truth
    return None, truth


def _own_place(message: Any) -> Home | None:
    if message.get_type() != "GLOBAL_POSITION_INT" or (message.lat, message.lon) == (0, 0) or message.lat == 0:
        return None
    altitude_m = (message.alt - message.relative_alt) / 1000.0
    return Home(message.lat / DEGREES_E7, message.lon / DEGREES_E7, altitude_m)


def _origin_message(system: int, origin: Home) -> Any:
    return messages().MAVLink_set_gps_global_origin_message(
        system,
        round(origin.latitude_deg * DEGREES_E7),
        round(origin.longitude_deg * DEGREES_E7),
        round(origin.altitude_m * 1000.0),
        0,
    )
