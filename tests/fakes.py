"""Stand-ins for the other end of a link: a scripted vehicle, a lossy radio, a vehicle in a thread."""

from __future__ import annotations

import contextlib
import math
import random
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from dslam_mav.mav.frames import Encoder, Parser, messages
from dslam_mav.mission import (
    CMD_CHANGE_SPEED,
    CMD_RETURN_TO_LAUNCH,
    CMD_TAKEOFF,
    CMD_WAYPOINT,
    Home,
    Mission,
    MissionItem,
    enu_to_e7,
)
from sim_bridge.vehicle import DEFAULT_HOME, Vehicle

NAN = math.nan


def star_corners(radius_m: float = 20.0) -> list[tuple[float, float]]:
    """The closed star {7/3}: 8 corners, 7 legs, metres [east, north]."""
    angles = [2.0 * math.pi * 3 * k / 7 for k in range(8)]
    return [(radius_m * math.cos(a), radius_m * math.sin(a)) for a in angles]


def mission(
    corners: list[tuple[float, float]] | None = None,
    *,
    hold_s: float = 0.0,
    speed_m_s: float = 8.0,
    home: Home = DEFAULT_HOME,
) -> Mission:
    """Take-off to 10 m, speed, the corners, return to launch."""
    corners = star_corners() if corners is None else corners
    items = [
        MissionItem(CMD_TAKEOFF, 6, (0.0, NAN, NAN, NAN), 0, 0, 10.0),
        MissionItem(CMD_CHANGE_SPEED, 2, (1.0, speed_m_s, -1.0, 0.0), 0, 0, 0.0),
        *(MissionItem(CMD_WAYPOINT, 6, (hold_s, 0, 0, NAN), *enu_to_e7(e, n, home), 10.0) for e, n in corners),
        MissionItem(CMD_RETURN_TO_LAUNCH, 2, (0.0,) * 4, 0, 0, 0.0),
    ]
    return Mission(tuple(items), home)


@contextlib.contextmanager
def flying(*listen: str, **options: Any) -> Iterator[tuple[str, ...]]:
    """A loopback vehicle alive in a thread: the URLs to connect to."""
    vehicle = Vehicle(listen or ("udpin:127.0.0.1:0",), **options)
    urls = tuple(u.replace("udpin", "udpout").replace("tcpin", "tcp") for u in vehicle.urls)
    stop = threading.Event()
    thread = threading.Thread(target=vehicle.run, args=(stop,), daemon=True)
    thread.start()
    try:
        yield urls
    finally:
        stop.set()
        thread.join(5.0)


class ScriptedVehicle:
    """A vehicle whose every answer is written down: `answer(message)` gives the messages to send back. Of itself it
    sends so many HEARTBEATs, `beats`.
    """

    def __init__(self, answer: Callable[[Any], list[Any]], *, autopilot: int = 0, beats: float = math.inf) -> None:
        self._answer = answer
        self._autopilot = autopilot
        self._beats = beats
        self.silent_from_s = math.inf  # monotonic time from which on it is gone
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sock.bind(("127.0.0.1", 0))
        self._sock.settimeout(0.02)
        self.url = f"udpout:127.0.0.1:{self._sock.getsockname()[1]}"
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def vanish(self) -> None:
        """Say nothing from now on."""
        self.silent_from_s = time.monotonic()

    def __enter__(self) -> ScriptedVehicle:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(5.0)
        self._sock.close()

    def _run(self) -> None:
        encoder, parser, peer, beat_s = Encoder(1, 1), Parser(), None, -math.inf
        dialect = messages()
        while not self._stop.is_set():
            with contextlib.suppress(TimeoutError):
                data, peer = self._sock.recvfrom(65536)
                for frame in parser.feed(data, 0):
                    for message in self._answer(frame.message):
                        if time.monotonic() < self.silent_from_s:
                            self._sock.sendto(encoder.pack(message), peer)
            due = time.monotonic() - beat_s > 0.3 and time.monotonic() < self.silent_from_s
            if peer and due and self._beats > 0:
                beat_s, self._beats = time.monotonic(), self._beats - 1
                beat = dialect.MAVLink_heartbeat_message(2, self._autopilot, 0, 0, 3, 3)
                self._sock.sendto(encoder.pack(beat), peer)


MISSION_MESSAGES = {*range(39, 48), 51, 73}  # from MISSION_ITEM to MISSION_ACK, and the INT ones


class LossyRadio:
    """A UDP relay that loses and doubles packets, both ways, by a seed; `url` is where to connect.

    Of a mission's packets it never loses two in a row one way, so that six tries always suffice: what order
    heartbeats and telemetry come in, and so which packet meets which random number, is up to the machine.
    """

    def __init__(self, target_url: str, *, loss: float, seed: int, double: float = 0.0) -> None:
        _, host, port = target_url.split(":")
        self._target = (host, int(port))
        self._loss, self._double = loss, double
        self._spared = {"near": False, "far": False}  # whether the mission's next packet from there gets through
        self._random = random.Random(seed)
        self._near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._near.bind(("127.0.0.1", 0))
        self.url = f"udpout:127.0.0.1:{self._near.getsockname()[1]}"
        self.lost = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> LossyRadio:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(5.0)
        self._near.close()
        self._far.close()

    def _run(self) -> None:
        station: Any = None
        while not self._stop.is_set():
            readable, _, _ = select.select([self._near, self._far], [], [], 0.05)
            for sock in readable:
                with contextlib.suppress(OSError):
                    data, sender = sock.recvfrom(65536)
                    station = sender if sock is self._near else station
                    if self._loses(data, "near" if sock is self._near else "far"):
                        self.lost += 1
                        continue
                    for _ in range(1 + (self._random.random() < self._double)):
                        if sock is self._near:
                            self._far.sendto(data, self._target)
                        elif station:
                            self._near.sendto(data, station)

    def _loses(self, data: bytes, side: str) -> bool:
        if int.from_bytes(data[7:10], "little") not in MISSION_MESSAGES:
            return self._random.random() < self._loss
        # p lost after one that came through, none after one lost: p / (1 + p) of all
        lost = not self._spared[side] and self._random.random() < self._loss / (1.0 - self._loss)
        self._spared[side] = lost
        return lost
