"""Readings at one a millisecond through bridge, vehicle, estimator's loop and log: `python -m tests.bench.throughput`.

A loopback vehicle in a process of its own flies for so long in its own time that `--minutes` are read; bridge, estimator
and log are a process as in `fly`. What is sent and what is in the log are counted: none may be lost. Then the parts one
by one, to tell what limits it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "commands"))
sys.path.insert(0, str(Path(__file__).parents[1] / "mav"))

from aboard import stand_in
from fakes import mission
from running import end, spawn_vehicle, stop

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


class Even:
    """A field that costs nothing to read."""

    def read(self, time_s: Array, place_m: Array) -> Array:
        """20 + east/100."""
        return np.asarray(20.0 + 0.01 * place_m[:, 0])


def main() -> int:
    """Print the flight and its parts; 1 if a reading was lost."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=10.0, help="of the vehicle's time, read at 1 kHz")
    parser.add_argument("--speedup", type=float, default=2.0)
    options = parser.parse_args()
    leg_m = options.minutes * 60.0 * SPEED_M_S / (CORNERS - 1)
    corners = [(leg_m * (k % 2), 0.6 * leg_m * (k // 2)) for k in range(CORNERS)]
    lost = _flight(mission(corners, speed_m_s=SPEED_M_S), options.speedup)
    _parts()
    return 1 if lost else 0


def _flight(plan: Mission, speedup: float) -> int:
    vehicle, url = spawn_vehicle("--speedup", speedup)
    try:
        with tempfile.TemporaryDirectory() as folder:
            return _fly(plan, url, Path(folder) / "flight.mcap", vehicle, speedup)
    finally:
        stop(vehicle)


def _fly(plan: Mission, url: str, log: Path, vehicle: subprocess.Popen[str], speedup: float) -> int:
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
        bridge = Bridge(sensor, system, Even(), Sampling(interval_s=0.001), seqs)
        onboard = Onboard(computer, system, collector, stand_in, recorder)
        never = threading.Event()
        workers = [threading.Thread(target=lambda run=run: run(never), daemon=True) for run in (bridge.run, onboard.run)]
        for worker in workers:
            worker.start()
        time.sleep(0.5)
        began_s, cpu_s = time.monotonic(), time.process_time()
        start(ground, system, 20.0)
        while any(worker.is_alive() for worker in workers):
            ground.receive(0.2)
            ground.send_heartbeat()
        took_s, cpu_s = time.monotonic() - began_s, time.process_time() - cpu_s
    logged = len(read_log(log).readings)
    used = sum(leg.value.size for leg in collector.legs(final=True))
    lost = bridge.sent - logged
    print(f"{bridge.sent} readings sent, {logged} logged, {used} on legs, {lost} lost, {bridge.sampler.unplaced} unread")
    print(
        f"flown {speedup:g} times as fast as real: {took_s:.0f} s, {bridge.sent / took_s:.0f} readings/s; "
        f"bridge, estimator and log took {cpu_s / took_s:.2f} of a core, the log {log_mb(log):.1f} MB" if log.exists() else ""
    )
    return lost


def log_mb(log: Path) -> float:
    """Its size."""
    return log.stat().st_size / 1e6


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
