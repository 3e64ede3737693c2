"""An hour's log at 50 readings a second, replayed and reported as a user does it: `python -m tests.bench.replay_hour`.

A star flown for an hour over two sources: readings at 50 Hz, dead reckoning and ground speed at 10 Hz, and all that a
log holds besides. Wall clock and CPU time (user + system) of whole commands, medians; then where the time goes.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from flown import fly

from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.attached import as_logged, attach
from dslam_mav.dslam.warm import warm_up
from dslam_mav.errors import BadInputError
from dslam_mav.log.reader import read_log
from dslam_mav.log.recorder import Recorder
from dslam_mav.log.topics import RAW
from dslam_mav.mission import CMD_WAYPOINT, Home, Mission, MissionItem, enu_to_e7, home_item
from dslam_mav.observations import Reading
from dslam_mav.records.arrays import Array
from dslam_mav.replay import flight_from_packets
from missions.patterns import pattern

HOME = Home(47.397742, 8.545594, 488.0)
SPEED_M_S = 2.0
HOUR_S = 3600.0
LEG_SPREADS = 3.8  # a leg, in √C
T = TypeVar("T")


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--legs", type=int, default=7)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    warm_up()
    with tempfile.TemporaryDirectory() as folder:
        log, page = Path(folder) / "flight.mcap", Path(folder) / "report.html"
        write_hour(log, options.legs)
        print(f"{options.legs} legs, {log.stat().st_size / 1e6:.1f} MB; medians of {options.runs}")
        print("command                     wall, s   user + system, s")
        for words in (
            ("replay", log, "--sources", 2),
            ("replay", log),
            ("report", log, "--sources", 2, "-o", page),
            ("info", log),
        ):
            shown = " ".join(str(word) for word in words if not isinstance(word, Path))
            wall_s, cpu_s = _command(words, options.runs)
            print(f"{shown:25s}   {wall_s:7.2f}   {cpu_s:16.2f}", flush=True)
        print(f"the page: {page.stat().st_size / 1e6:.2f} MB")
        _parts(log)


def write_hour(path: Path, legs: int) -> None:
    """The log of a vehicle that flew a star of so many legs for an hour, with its mission and assumptions."""
    leg_m = SPEED_M_S * HOUR_S / legs
    corners_m = pattern("star7", leg_m, legs=legs)
    spread_m = leg_m / LEG_SPREADS
    middle_m = corners_m.mean(axis=0)
    places_m = middle_m + spread_m * np.array([[0.9, 0.6], [-0.7, -0.8]])
    noise = np.random.default_rng(0)

    def value(north_m: float, east_m: float) -> float:
        apart_m = np.hypot(*(places_m - (east_m, north_m)).T) / spread_m
        return 20.0 + sum(8.0 * math.exp(-x * x) for x in apart_m) + noise.normal(0.0, 0.2)

    way = [(float(north), float(east)) for east, north in corners_m]
    flown = fly(way, speed_m_s=SPEED_M_S, position_ms=100, reading_ms=20, value=value)
    with Recorder(path) as recorder:
        attach(recorder, as_logged(_mission(corners_m)), Assumptions(), 1)
        for frame in flown.frames:
            recorder.frame(frame.received_ns, frame.raw)
            if frame.message.get_type() == "NAMED_VALUE_FLOAT":
                recorder.reading(frame.received_ns, Reading(frame.message.time_boot_ms, frame.message.value))


def _mission(corners_m: Array) -> Mission:
    """Home, and the corners as items 1, 2, …"""
    items = [
        MissionItem(CMD_WAYPOINT, 6, (0.0, 0.0, 0.0, math.nan), *enu_to_e7(float(e), float(n), HOME), 10.0)
        for e, n in corners_m
    ]
    return Mission((home_item(HOME), *items), HOME)


def _command(words: tuple[object, ...], runs: int) -> tuple[float, float]:
    """Medians of wall clock and CPU time, s, of a command in a process of its own."""
    walls_s, cpus_s = [], []
    for _ in range(runs):
        before, begun_s = os.times(), time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", "dslam_mav", *map(str, words), "--json"], capture_output=True, text=True, check=False
        )
        after = os.times()
        if done.returncode:
            raise BadInputError(f"{words}: {done.stderr}")
        walls_s.append(time.perf_counter() - begun_s)
        cpus_s.append(sum(after[2:4]) - sum(before[2:4]))
    return statistics.median(walls_s), statistics.median(cpus_s)


def _parts(log: Path) -> None:
    """CPU seconds of the parts of a replay before the estimate, in this process."""
    packets = _told("packets out of the log", lambda: read_log(log, (RAW,)).frames)
    _told("packets into legs", lambda: flight_from_packets(packets, "log", system=1))


def _told(what: str, run: Callable[[], T]) -> T:
    begun_s = time.process_time()
    result = run()
    print(f"{what:28s}{time.process_time() - begun_s:6.2f} s of CPU time", flush=True)
    return result


if __name__ == "__main__":
    main()
