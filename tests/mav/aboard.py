"""The live loop run against a vehicle of stored frames: what its tests share."""

from __future__ import annotations

import socket
import threading
import time
from dataclasses import dataclass, field

import numpy as np
from flown import Flown

from dslam_mav.errors import LinkError
from dslam_mav.legs import FlownLeg, LegCollector, PlanFacts
from dslam_mav.mav.frames import Frame, Parser
from dslam_mav.mav.link import Link
from dslam_mav.mav.onboard import Onboard
from dslam_mav.records import Estimate, Flight, Medium, Path, Sources, Verdict

PLAN = PlanFacts((1, 2, 3, 4, 5), (30.0,) * 4)


def stand_in(flight: Flight, legs: tuple[FlownLeg, ...] = ()) -> Estimate:
    """An "estimate" that depends on every bit of the flight."""
    sums = [float((leg.distance_m * leg.reading * (1.0 + leg.time_s)).sum()) for leg in flight.legs]
    n = len(flight.legs)
    return Estimate(
        sources=Sources([[sums[0], 2.0], [3.0, 4.0]], [200.0, 100.0], [5.0, 4.0], [-1.0, -1.0]),
        path=Path(np.zeros((n + 1, 2)), np.zeros(n)),
        medium=Medium(), verdict=Verdict.IDENTIFIED, reason="", spread_m=10.0,
        position_covariance_m2=np.stack([0.04 * np.eye(2)] * 2),
        path_aligned_covariance_m2=np.stack([0.04 * np.eye(2)] * 2),
        parameter_covariance=np.zeros((0, 0)), parameter_names=(), noise_sd=0.1, log_likelihood=0.0,
        residual=np.array(sums),
    )  # fmt: skip


@dataclass
class Log:
    frames: list[tuple[int, bytes]] = field(default_factory=list)
    readings: list = field(default_factory=list)
    progressed: list = field(default_factory=list)
    estimates: list[tuple[Estimate, int, bool]] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    def frame(self, received_ns, raw):
        self.frames.append((received_ns, raw))

    def reading(self, received_ns, reading):
        self.readings.append(reading)

    def progress(self, received_ns, progress):
        self.progressed.append(progress)

    def estimate(self, received_ns, estimate, legs_flown, final, flight):
        assert len(flight.legs) == legs_flown
        self.estimates.append((estimate, legs_flown, final))

    def text(self, received_ns, level, text):
        self.texts.append(text)


class Vehicle:
    """Sends stored frames from a socket to whoever speaks to it first, and keeps what it hears."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.url = f"udpout:127.0.0.1:{self.socket.getsockname()[1]}"
        self.heard: list[Frame] = []
        self._peer = None
        self._parser = Parser()
        self._over = threading.Event()
        self.socket.settimeout(0.05)
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def send(self, frames: list[Frame], pause_every: int = 100) -> None:
        while self._peer is None:
            time.sleep(0.01)
        for i, frame in enumerate(frames):
            self.socket.sendto(frame.raw, self._peer)
            if i % pause_every == 0:
                time.sleep(0.005)

    def of(self, kind: str) -> list:
        return [f.message for f in self.heard if f.message.get_type() == kind]

    def close(self) -> None:
        time.sleep(0.1)
        self._over.set()
        self._thread.join()
        self.socket.close()

    def _listen(self) -> None:
        while not self._over.is_set():
            try:
                data, self._peer = self.socket.recvfrom(65536)
            except TimeoutError:
                continue
            self.heard += self._parser.feed(data, 0)


def cut_short(flown: Flown) -> list[Frame]:
    """The frames until half a second into the fourth leg."""
    return [f for f in flown.frames if f.received_ns <= (flown.corner_ms[3] + 500) * 1_000_000]


def run(vehicle: Vehicle, frames: list[Frame], *, estimate=stand_in, plan=PLAN, stop=None, **options):
    """The loop over a socket while the vehicle sends; (loop, log, updates, what it raised)."""
    log, updates = Log(), []
    with Link(vehicle.url, system=1, component=191) as link:
        onboard = Onboard(
            link,
            1,
            LegCollector(plan),
            estimate,
            log,
            on_update=updates.append,
            **{"quiet_s": 0.4, **options},
        )
        sender = threading.Thread(target=vehicle.send, args=(frames,))
        sender.start()
        raised = None
        try:
            assert onboard.run(stop or threading.Event()) is onboard.result
        except LinkError as error:
            raised = error
        sender.join()
    return onboard, log, updates, raised
