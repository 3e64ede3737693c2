"""The loopback vehicle: a MAVLink 2 autopilot stand-in on real sockets, for tests and demonstrations.

It takes a mission, flies it in straight lines in simulated time (`speedup` × the host's), tells what it does,
and passes messages on between its peers as ArduPilot does. Its true place is LOCAL_POSITION_NED.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

from dslam_mav.errors import BadInputError
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, Encoder, Frame
from dslam_mav.mav.signing import Signing, Verifier
from dslam_mav.mission import Home
from sim_bridge.loopback import commands
from sim_bridge.loopback.autopilot import Autopilot
from sim_bridge.loopback.endpoints import Endpoints, Peer
from sim_bridge.loopback.flight import Outgoing
from sim_bridge.loopback.habit_service import HabitService
from sim_bridge.loopback.link_faults import Air, LinkFaults, parse_link_faults
from sim_bridge.loopback.manners import manners
from sim_bridge.loopback.mission_service import MissionService
from sim_bridge.loopback.router import Router
from sim_bridge.loopback.telemetry import HEARTBEAT, build

__all__ = ["DEFAULT_HOME", "Vehicle", "parse_link_faults"]

DEFAULT_HOME = Home(47.397742, 8.545594, 488.0)

_HEARTBEAT_S = 1.0  # of the host's time, whatever the speed-up
_POLL_S = (0.001, 0.02)
_MAX_LAG_S = 0.1  # a host that was busy longer is not caught up with: simulated time just waits


class Vehicle:
    """Listens on construction (`urls` has the ports really bound), lives while `run` runs.

    `listen`: "udpin:HOST:PORT" or "tcpin:HOST:PORT", port 0 for any free one. BadInputError on a malformed
    URL or option, LinkError on a port in use. With `signing` it heeds and passes on only what is signed with that key.
    `link_faults` befall all it sends and receives. `profile`: "strict", or "ardupilot" or "px4" with their ways;
    `feed`: what such a one navigates by, "gps", "flow" or "odometry".
    """

    def __init__(
        self,
        listen: Sequence[str],
        *,
        system: int = 1,
        speedup: float = 1.0,
        seed: int = 0,
        home: Home = DEFAULT_HOME,
        cruise_speed_m_s: float = 5.0,
        position_rate_hz: float = 50.0,
        signing: Signing | None = None,
        link_faults: LinkFaults | None = None,
        profile: str = "strict",
        feed: str = "gps",
    ) -> None:
        _expect("system", system, 1, 255)
        _expect("speedup", speedup, 0.01, 1000.0)
        _expect("cruise speed", cruise_speed_m_s, 0.01, 100.0)
        _expect("position rate", position_rate_hz, 0.1, 1000.0)
        self._speedup = speedup
        self._autopilot = Autopilot(
            home,
            cruise_speed_m_s=cruise_speed_m_s,
            position_rate_hz=position_rate_hz,
            seed=seed,
            manners=manners(profile, feed),
        )
        standard = self._autopilot.manners.missions == "standard"
        self._missions = MissionService(self._autopilot) if standard else HabitService(self._autopilot)
        self._router = Router(system, COMPONENT_AUTOPILOT)
        self._encoder = Encoder(system, COMPONENT_AUTOPILOT, signing)
        self._faults = link_faults or LinkFaults()
        self._endpoints = Endpoints(
            listen,
            None if signing is None else Verifier(signing),
            None if link_faults is None else Air(link_faults, seed),
            alone=self._autopilot.manners.one_client,
        )
        self._clock_s = 0.0
        self._clock_ms = 0

    @property
    def urls(self) -> tuple[str, ...]:
        """What it listens on, with the real ports."""
        return self._endpoints.urls

    def run(self, stop: threading.Event) -> None:
        """Live until `stop` is set; then close."""
        self._clock_s, self._clock_ms = time.monotonic(), self._autopilot.time_ms
        beat_s, n_peers = -math.inf, 0
        try:
            while not stop.is_set():
                now_s = time.monotonic()
                self._send_all(self._autopilot.advance(self._simulated_ms(now_s)))
                if now_s - beat_s >= _HEARTBEAT_S or len(self._endpoints.peers) > n_peers:
                    beat_s = now_s  # whoever is new hears at once that we are here
                    self._broadcast(build(HEARTBEAT, self._autopilot.snapshot()))
                n_peers = len(self._endpoints.peers)
                if now_s >= self._missions.deadline_s:
                    self._answer(self._missions.tick(now_s))
                for peer, frame in self._endpoints.poll(self._pause_s()):
                    self._take(peer, frame)
                self._forget_lost()
        finally:
            self.close()

    def close(self) -> None:
        """Close the sockets; a second call does nothing."""
        self._endpoints.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _simulated_ms(self, now_s: float) -> int:
        target_ms = self._clock_ms + int((now_s - self._clock_s) * 1000.0 * self._speedup)
        latest_ms = self._autopilot.time_ms + max(1, int(_MAX_LAG_S * 1000.0 * self._speedup))
        if target_ms > latest_ms:
            target_ms = latest_ms
            self._clock_s, self._clock_ms = now_s, latest_ms
        return target_ms

    def _pause_s(self) -> float:
        ahead_s = (self._autopilot.next_event_ms - self._autopilot.time_ms) / 1000.0 / self._speedup
        return min(max(ahead_s, _POLL_S[0]), _POLL_S[1])

    def _take(self, peer: Peer, frame: Frame) -> None:
        message = frame.message
        ours, others = self._router.route(peer, message)
        for other in others:
            assert isinstance(other, Peer)
            self._endpoints.send(other, frame.raw)
        if not ours:
            return
        self._autopilot.overhear(message)
        answers = self._missions.handle(peer, message, time.monotonic())
        if answers is None:
            answers = [(peer, answer) for answer in commands.handle(self._autopilot, peer, message)]
        self._answer(answers)

    def _answer(self, answers: Sequence[tuple[Any, Any]]) -> None:
        for peer, message in answers:
            self._endpoints.send(peer, self._encoder.pack(self._faults.stamped(message)))

    def _send_all(self, outgoing: Sequence[Outgoing]) -> None:
        peers = self._endpoints.peers
        for out in outgoing:
            raw = self._encoder.pack(self._faults.stamped(out.message))
            for peer in peers:
                if peer is out.only or (out.only is None and peer not in out.without):
                    self._endpoints.send(peer, raw)

    def _broadcast(self, message: Any) -> None:
        self._send_all([Outgoing(message)])

    def _forget_lost(self) -> None:
        for peer in self._endpoints.lost:
            self._router.forget(peer)
            self._autopilot.streams.forget(peer)
        self._endpoints.lost.clear()


def _expect(name: str, value: float, least: float, most: float) -> None:
    if not (math.isfinite(value) and least <= value <= most):
        raise BadInputError(f"vehicle {name} {value}: expected {least:g} to {most:g}")
