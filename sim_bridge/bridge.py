"""The bridge: injects readings into a flight, as a sensor on the vehicle would (MAVLink component 158).

It hears where the vehicle truly is (LOCAL_POSITION_NED of the loopback vehicle) and how far the mission
is, reads the field there and sends NAMED_VALUE_FLOAT through the vehicle, which forwards it to everybody
else. Readings of a stretch are sent when its end is heard: the last ones of a leg therefore follow its
MISSION_ITEM_REACHED, and only their own `time_boot_ms` says where they belong.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from dslam_mav.errors import LinkError
from dslam_mav.mav import readings
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, Frame
from dslam_mav.mav.link import Link
from dslam_mav.observations import Reading
from sim_bridge.fields.field import Field
from sim_bridge.sampling import Sampler, Samples, Sampling

_HEARTBEAT_S = 1.0
_POLL_S = 0.05
SILENCE_S = 10.0


class Bridge:
    """Readings of `field` for one flight of vehicle `system` along the vertices numbered `vertex_seqs`.

    `noise_sd` times normal numbers from `rng` is added, drawn in the order of the readings: the same flight
    gives the same readings. `link` must be component 158 of the vehicle's system. BadInputError: no legs.
    """

    def __init__(
        self,
        link: Link,
        system: int,
        field: Field,
        sampling: Sampling,
        vertex_seqs: Sequence[int],
        *,
        noise_sd: float = 0.0,
        rng: np.random.Generator | None = None,
        name: str = "THERMAL",
        always: bool = False,
    ) -> None:
        if not (math.isfinite(noise_sd) and noise_sd >= 0.0):
            raise ValueError(f"noise_sd: expected 0 or more, got {noise_sd}")
        if noise_sd > 0.0 and rng is None:
            raise ValueError("rng: expected a generator to draw noise from, got None")
        self.sent = 0
        self.missing = 0  # readings the field had no value for
        self.sampler = Sampler(sampling, vertex_seqs, always=always)
        self._link = link
        self._system = system
        self._field = field
        self._noise_sd = noise_sd
        self._rng = rng
        self._name = name
        self._total = 0  # items of the mission, as the vehicle says with the one it flies to

    def run(self, stop: threading.Event, *, silence_s: float = SILENCE_S) -> None:
        """Serve until the last vertex is reached or `stop` is set.

        LinkError: the link broke, or the vehicle, once heard, was silent for `silence_s` (host time).
        """
        next_heartbeat_s = heard_s = -math.inf
        while not stop.is_set() and not self.sampler.finished:
            now_s = time.monotonic()
            if now_s >= next_heartbeat_s:
                self._link.send_heartbeat()
                next_heartbeat_s = now_s + _HEARTBEAT_S
            frame = self._link.receive(_POLL_S)
            if frame is not None and self._is_vehicle(frame):
                heard_s = now_s
                self.hear(frame.message)
            elif math.isfinite(heard_s) and now_s - heard_s > silence_s:
                raise LinkError(f"{self._link.url}: vehicle {self._system} has been silent for {silence_s:g} s")

    def hear(self, message: Any) -> None:
        """One message of the vehicle: sends the readings that are due by it."""
        kind = message.get_type()
        if kind == "LOCAL_POSITION_NED":
            # NED -> [east, north, up]
            place_m = (message.y, message.x, -message.z)
            self._send(self.sampler.position(message.time_boot_ms, place_m))
        elif kind == "MISSION_ITEM_REACHED":
            self.sampler.reached(message.seq)
        elif kind == "MISSION_CURRENT":
            before, self._total = self._total, int(getattr(message, "total", 0))
            if 0 < before != self._total > 0:
                self.sampler.grow(message.seq, self._total - before)

    def _is_vehicle(self, frame: Frame) -> bool:
        message = frame.message
        return (message.get_srcSystem(), message.get_srcComponent()) == (self._system, COMPONENT_AUTOPILOT)

    def _send(self, samples: Samples) -> None:
        if not len(samples.time_boot_ms):
            return
        values = self._field.read(samples.time_s, samples.place_m)
        if self._rng is not None:
            values = values + self._noise_sd * self._rng.standard_normal(len(values))
        for time_ms, value in zip(samples.time_boot_ms, values, strict=True):
            if math.isnan(value):
                self.missing += 1
                continue
            self._link.send(readings.to_message(Reading(int(time_ms), float(value), self._name)))
            self.sent += 1
