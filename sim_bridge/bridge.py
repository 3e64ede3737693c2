"""The bridge: injects readings into a flight, as a sensor on the vehicle would (MAVLink component 158).

It hears where the vehicle truly is and how far the mission is, reads the field there and sends
NAMED_VALUE_FLOAT through the vehicle, which forwards it to everybody else. Readings of a stretch are sent
when its end is heard: the last ones of a leg therefore follow its MISSION_ITEM_REACHED, and only their own
`time_boot_ms` says where they belong.
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
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, Frame, messages
from dslam_mav.mav.ports import Port
from dslam_mav.mav.streams import TRUTH_US, StreamRequests
from dslam_mav.observations import Reading
from sim_bridge.fields.field import Field
from sim_bridge.sampling import Sampler, Samples, Sampling
from sim_bridge.whereabouts import Whereabouts
from sim_bridge.wire_clock import WireClock

_HEARTBEAT_S = 1.0
_POLL_S = 0.05
SILENCE_S = 10.0
_WANTED_US = {"LOCAL_POSITION_NED": 50_000, "ATTITUDE": 50_000}  # ATTITUDE: for its time, just before SIM_STATE


class Bridge:
    """Readings of `field` for one flight of vehicle `system` along the vertices numbered `vertex_seqs`.

    `noise_sd` times normal numbers from `rng` is added, drawn in the order of the readings: the same flight
    gives the same readings. `before_s`: how often it is read before the first leg, too, with noise drawn apart. `link`
    must be component 158 of the vehicle's system. `where` tells the vehicle's true
    place (default: what the vehicle itself believes); `ask_after_s`: how long a stream may be missing before the
    vehicle is asked for it. BadInputError: no legs.
    """

    def __init__(
        self,
        link: Port,
        system: int,
        field: Field,
        sampling: Sampling,
        vertex_seqs: Sequence[int],
        *,
        noise_sd: float = 0.0,
        rng: np.random.Generator | None = None,
        name: str = "THERMAL",
        always: bool = False,
        before_s: float | None = None,
        where: Whereabouts | None = None,
        ask_after_s: float = 2.0,
    ) -> None:
        if not (math.isfinite(noise_sd) and noise_sd >= 0.0):
            raise ValueError(f"noise_sd: expected 0 or more, got {noise_sd}")
        if noise_sd > 0.0 and rng is None:
            raise ValueError("rng: expected a generator to draw noise from, got None")
        self.sent = 0
        self.missing = 0  # readings on legs that the field had no value for
        self.sampler = Sampler(sampling, vertex_seqs, always=always, before_s=before_s)
        self._link = link
        self._system = system
        self._field = field
        self._noise_sd = noise_sd
        self._rng = rng
        self._rng_before = None if rng is None or before_s is None else rng.spawn(1)[0]
        self._name = name
        self.where = where or Whereabouts("vehicle")
        self._ask_after_s = ask_after_s
        self._streams: StreamRequests | None = None
        self._clock = WireClock()
        self._current: int | None = None
        self._armed = False
        self._behind: int | None = None  # items of the mission behind its last vertex

    def run(self, stop: threading.Event, *, silence_s: float = SILENCE_S) -> None:
        """Serve until the last vertex is reached or `stop` is set.

        LinkError: the link broke, or the vehicle, once heard, was silent for `silence_s` (host time).
        """
        next_heartbeat_s = heard_s = -math.inf
        optional_us = TRUTH_US if self.where.may_be_simulated else {}
        self._streams = StreamRequests(
            self._system, _WANTED_US, time.monotonic(), ask_after_s=self._ask_after_s, optional_us=optional_us
        )
        while not stop.is_set() and not self.sampler.finished:
            now_s = time.monotonic()
            if now_s >= next_heartbeat_s:
                self._link.send_heartbeat()
                next_heartbeat_s = now_s + _HEARTBEAT_S
            for request in self._streams.due(now_s) if math.isfinite(heard_s) else ():
                self._link.send(request)
            frame = self._link.receive(_POLL_S)
            if frame is not None and self._is_vehicle(frame):
                heard_s = now_s
                self._streams.see(frame.message, now_s)
                self.hear(frame.message)
            elif math.isfinite(heard_s) and now_s - heard_s > silence_s:
                raise LinkError(f"{self._link.url}: vehicle {self._system} has been silent for {silence_s:g} s")

    def hear(self, message: Any) -> None:
        """One message of the vehicle: sends the readings that are due by it."""
        placed = self.where.hear(message, settled=self.sampler.started)
        kind = message.get_type()
        if placed is not None:
            time_ms, restarted = self._clock.take(placed[0])
            if restarted:
                self.sampler.interrupted()
            self._send(self.sampler.position(time_ms, placed[1]))
        elif kind == "MISSION_ITEM_REACHED":
            self.sampler.reached(message.seq)
            if self.sampler.started:
                self.where.check()
        elif kind == "MISSION_CURRENT":
            self._heading_for(message)
        elif kind == "HEARTBEAT":
            armed = bool(message.base_mode & messages().MAV_MODE_FLAG_SAFETY_ARMED)
            if self._armed and not armed:
                self.sampler.landed()
            self._armed = armed

    def _heading_for(self, message: Any) -> None:
        """MISSION_CURRENT says the same as MISSION_ITEM_REACHED, should that be lost, and that the mission is over."""
        before, self._current = self._current, int(message.seq)
        if (total := int(getattr(message, "total", 0))) > 0:
            if self._behind is None or not self.sampler.started:
                self._behind = total - self.sampler.last_seq
            self.sampler.end_at(total - self._behind, self._current)
        if before is not None and self._current > before:
            self.sampler.passed(before, self._current)
        if message.mission_state == messages().MISSION_STATE_COMPLETE:
            self.sampler.landed()

    def _is_vehicle(self, frame: Frame) -> bool:
        message = frame.message
        return (message.get_srcSystem(), message.get_srcComponent()) == (self._system, COMPONENT_AUTOPILOT)

    def _send(self, samples: Samples) -> None:
        if not len(samples.time_boot_ms):
            return
        values = self._field.read(samples.time_s, samples.place_m)
        started = self.sampler.started
        rng = self._rng if started else self._rng_before
        if rng is not None:
            values = values + self._noise_sd * rng.standard_normal(len(values))
        for time_ms, value in zip(samples.time_boot_ms, values, strict=True):
            if math.isnan(value):
                self.missing += started
                continue
            on_wire_ms = self._clock.on_wire(int(time_ms))
            self._link.send(readings.to_message(Reading(on_wire_ms, float(value), self._name)))
            self.sent += 1
