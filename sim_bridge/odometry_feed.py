"""The vehicle's external navigation in a simulator: ODOMETRY from where the simulator has it (MAVLink component 197).

A copter set to fly by ODOMETRY is armed only while it comes, and lands when it stops. A camera on board would send it;
here the simulator's truth stands in. ArduPilot takes frames LOCAL_FRD and BODY_FRD only, and reads LOCAL_FRD as north,
east, down.
"""

from __future__ import annotations

import math
import threading
import time
from typing import Any

from dslam_mav.mav.frames import COMPONENT_AUTOPILOT
from dslam_mav.mav.odometry import LOCAL_FRD, Quaternion, Vector, odometry_message
from dslam_mav.mav.ports import Port
from dslam_mav.mav.streams import TRUTH_US, StreamRequests
from dslam_mav.mav.truth import true_place
from dslam_mav.mission import DEGREES_E7, Home, e7_to_enu

COMPONENT_ODOMETRY = 197
_BEAT_S = 1.0
_POLL_S = 0.05
_GOOD = 100


class OdometryFeed:
    """Feeds vehicle `system` over `link`; `run` until stopped. Places are measured from where it was first heard."""

    def __init__(self, link: Port, system: int) -> None:
        self.sent = 0
        self._link = link
        self._system = system
        self._origin: Home | None = None
        self._time_ms = 0

    def run(self, stop: threading.Event) -> None:
        """Serve until `stop` is set; LinkError when the link breaks."""
        streams = StreamRequests(self._system, {"ATTITUDE": 50_000}, time.monotonic(), optional_us=TRUTH_US)
        beat_s = -math.inf
        while not stop.is_set():
            now_s = time.monotonic()
            if now_s - beat_s >= _BEAT_S:
                beat_s = now_s
                self._link.send_heartbeat()
            for request in streams.due(now_s):
                self._link.send(request)
            frame = self._link.receive(_POLL_S)
            if frame is None or (frame.message.get_srcSystem(), frame.message.get_srcComponent()) != (
                self._system,
                COMPONENT_AUTOPILOT,
            ):
                continue
            streams.see(frame.message, now_s)
            odometry = self.hear(frame.message)
            if odometry is not None:
                self._link.send(odometry)
                self.sent += 1

    def hear(self, message: Any) -> Any | None:
        """The ODOMETRY due by one message of the vehicle's, or None."""
        self._time_ms = int(getattr(message, "time_boot_ms", self._time_ms))
        true = true_place(message)
        if true is None or message.get_type() == "SIMSTATE":
            return None
        if message.get_type() == "SIM_STATE":
            attitude: Quaternion = (message.q1, message.q2, message.q3, message.q4)
            velocity: Vector = (message.vn, message.ve, message.vd)
        else:
            w, x, y, z = message.attitude_quaternion
            attitude, velocity = (w, x, y, z), (message.vx / 100.0, message.vy / 100.0, message.vz / 100.0)
            self._time_ms = int(message.time_usec // 1000)
        self._origin = self._origin or true
        east_m, north_m = e7_to_enu(
            round(true.latitude_deg * DEGREES_E7), round(true.longitude_deg * DEGREES_E7), self._origin
        )
        place = (north_m, east_m, self._origin.altitude_m - true.altitude_m)
        return odometry_message(self._time_ms, LOCAL_FRD, place, velocity, attitude, quality=_GOOD)
