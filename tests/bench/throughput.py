"""Readings at one a millisecond through bridge, vehicle, estimator's loop and log: `python -m tests.bench.throughput`.

A loopback vehicle in a process of its own flies for so long in its own time that `--minutes` are read; bridge,
estimator and log are a process as in `fly`. What is sent and what is in the log are counted: none may be lost. Then the
parts one by one, to tell what limits it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "commands"))

from fakes import mission
from running import spawn_vehicle, stop

from dslam_mav.assumed import estimator
from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.background import SWITCH_S
from dslam_mav.dslam.warm import warm_up
from dslam_mav.legs import LegCollector, plan_facts
from dslam_mav.log.reader import read_log
from dslam_mav.log.recorder import Recorder
from dslam_mav.mav.decode import decode
from dslam_mav.mav.frames import Encoder, Parser, parse_frame
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.transfer import start, upload
from dslam_mav.mav.onboard import Onboard
from dslam_mav.mav.readings import to_message
from dslam_mav.mission import Mission, leg_plan
from dslam_mav.observations import Reading
from dslam_mav.records.arrays import Array
from sim_bridge.bridge import Bridge
from sim_bridge.sampling import Sampling

SPEED_M_S = 5.0
CORNERS = 6
PART = 20_000


class Bumps:
    """Two sources that do not spread, as wide as a third of a leg."""

    def __init__(self, leg_m: float) -> None:
        self._places_m = leg_m * np.array([[0.3, 0.4], [0.8, 0.9]])
        self._squared_m2 = leg_m**2 / 9.0

    def read(self, time_s: Array, place_m: Array) -> Array:
        """20 and up to 10 more."""
        apart_m = place_m[:, None, :2] - self._places_m
        return np.asarray(20.0 + 10.0 * np.exp(-(apart_m**2).sum(axis=2) / self._squared_m2).sum(axis=1))


def main() -> int:
    """Print the flight and its parts; 1 if a reading was lost."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=10.0, help="of the vehicle's time, read at 1 kHz")
    parser.add_argument("--speedup", type=float, default=2.0)
    options = parser.parse_args()
    leg_m = options.minutes * 60.0 * SPEED_M_S / (CORNERS - 1)
    corners = [(leg_m * (k % 2), 0.6 * leg_m * (k // 2)) for k in range(CORNERS)]
    warm_up()
    lost = _flight(mission(corners, speed_m_s=SPEED_M_S), options.speedup, Bumps(leg_m))
    _parts()
    return 1 if lost else 0


def _flight(plan: Mission, speedup: float, bumps: Bumps) -> int:
    vehicle, url = spawn_vehicle("--speedup", speedup)
    try:
        with tempfile.TemporaryDirectory() as folder:
            return _fly(plan, url, Path(folder) / "flight.mcap", speedup, bumps)
    finally:
        stop(vehicle)


def _fly(plan: Mission, url: str, log: Path, speedup: float, bumps: Bumps) -> int:
    seqs = leg_plan(plan).sequence
    collector = LegCollector(plan_facts(plan))
    with (
        Link(url, system=255, component=190) as ground,
        Link(url, system=1, component=158) as sensor,
        Link(url, system=1, component=191) as computer,
        Recorder(log) as recorder,
    ):
        system = wait_for_vehicle(ground, 20.0)
        upload(ground, system, plan)
        rng = np.random.default_rng(0)
        bridge = Bridge(sensor, system, bumps, Sampling(interval_s=0.001), seqs, noise_sd=0.1, rng=rng)
        estimate = estimator(Assumptions(n_sources=2), collector, None)
        onboard = Onboard(computer, system, collector, estimate, recorder)
        never = threading.Event()
        sys.setswitchinterval(SWITCH_S)
        workers = [
            threading.Thread(target=lambda run=run: run(never), daemon=True) for run in (bridge.run, onboard.run)
        ]
        for worker in workers:
            worker.start()
        time.sleep(0.5)
        began_s, cpu_s = time.monotonic(), time.process_time()
        start(ground, system, 20.0)
        while any(worker.is_alive() for worker in workers):
            ground.send_heartbeat()
            until_s = time.monotonic() + 1.0
            while time.monotonic() < until_s:
                ground.receive(0.2)
        took_s, cpu_s = time.monotonic() - began_s, time.process_time() - cpu_s
    logged = len(read_log(log).readings)
    used = sum(leg.value.size for leg in collector.legs(final=True))
    lost = bridge.sent - logged
    verdict = "no estimate" if onboard.result is None else onboard.result.verdict.name
    unread = bridge.sampler.unplaced
    print(f"{verdict}: {bridge.sent} readings sent, {logged} logged, {used} on legs, {lost} lost, {unread} unread")
    print(
        f"flown {speedup:g} times as fast as real: {took_s:.0f} s, {bridge.sent / took_s:.0f} readings/s; "
        f"bridge, estimator and log took {cpu_s / took_s:.2f} of a core, the log {log.stat().st_size / 1e6:.1f} MB"
    )
    return lost


def _parts() -> None:
    """Readings a second that each part can do on its own."""
    encoder = Encoder(1, 158)
    raws = [encoder.pack(to_message(Reading(k, 20.0))) for k in range(PART)]
    frames = [frame for raw in raws if (frame := parse_frame(raw, 0))]
    print("a part on its own: readings a second")
    _rate("to_message and pack", lambda: [encoder.pack(to_message(Reading(k, 20.0))) for k in range(PART)])
    parser = Parser()
    _rate("parse", lambda: [parser.feed(raw, 0) for raw in raws])
    _rate("decode", lambda: [decode(frame, 1) for frame in frames])
    observations = [o for frame in frames if (o := decode(frame, 1)) is not None]
    collector = LegCollector()
    _rate("collect", lambda: [collector.add(o) for o in observations])
    with tempfile.TemporaryDirectory() as folder, Recorder(Path(folder) / "x.mcap") as recorder:

        def record() -> None:
            for frame, reading in zip(frames, observations, strict=True):
                assert isinstance(reading, Reading)
                recorder.frame(0, frame.raw)
                recorder.reading(0, reading)

        _rate("record frame and reading", record)


def _rate(name: str, run: Callable[[], object]) -> None:
    begun = time.perf_counter()
    run()
    print(f"  {PART / (time.perf_counter() - begun):9.0f}  {name}")


if __name__ == "__main__":
    sys.exit(main())
