"""What a second process gains a sweep: `python -m tests.bench.sweeping`.

The same points on one process, then on two, from the first process' start to the last point. Efficiency by the clock is
t1 / (2 t2), which means something only where nothing else runs. The other does anyway: occupied is the share of their
time that the processes were at work on points (starting is not work), and CPU what points took of one process over what
they took of two. Their product is what the sweep itself allows.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dslam_mav.commands.sweep_file import read_sweep
from dslam_mav.commands.sweep_points import points_of
from dslam_mav.sweep.job import Job
from dslam_mav.sweep.local import LocalWorkers
from dslam_mav.sweep.points.columns import Row, Scalar

SWEEP = """
seeds = {seeds}
[scenes]
random = 10
sources = [2, 3]
spread_m = 10.0
area_m = [32.0, 32.0]
[[missions]]
pattern = "star7"
leg_m = 32.0
[noise]
snr_db = [20.0, 40.0]
[estimate]
methods = ["joint"]
n_sources = "true"
known = ["spread", "ambient"]
"""
POINTS_A_SEED = 40


@dataclass(frozen=True)
class _Timed:
    """A point that tells nothing but what it took: seconds by the clock, and of CPU time."""

    job: Job

    @property
    def key(self) -> str:
        return self.job.key

    @property
    def coordinates(self) -> Mapping[str, Scalar]:
        return self.job.coordinates

    def run(self) -> Row:
        begun_s, begun_cpu_s = time.perf_counter(), time.process_time()
        self.job.run()
        return {"wall_s": time.perf_counter() - begun_s, "cpu_s": time.process_time() - begun_cpu_s}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=25, help=f"{POINTS_A_SEED} points each")
    seeds = parser.parse_args().seeds
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "sweep.toml"
        file.write_text(SWEEP.format(seeds=list(range(seeds))))
        jobs = [_Timed(job) for job in points_of(read_sweep(file), file).jobs]
    print(f"{len(jobs)} points, {os.cpu_count()} cores")
    print("processes   wall, s   occupied   CPU of points, s")
    (one_s, _, one_cpu_s), (two_s, occupied, two_cpu_s) = (_worked(jobs, count) for count in (1, 2))
    print(f"efficiency of two, by the clock     {one_s / (2.0 * two_s):.0%}")
    print(f"efficiency of two, occupied × CPU   {occupied * one_cpu_s / two_cpu_s:.0%}")


def _worked(jobs: list[_Timed], count: int) -> tuple[float, float, float]:
    """Seconds by the clock, the share of them that all processes were at work, seconds of CPU time."""
    begun_s = time.perf_counter()
    rows = [ended.row for ended in LocalWorkers(count, print).run(jobs)]
    wall_s = time.perf_counter() - begun_s
    occupied = sum(float(row["wall_s"] or 0.0) for row in rows) / (count * wall_s)
    cpu_s = sum(float(row["cpu_s"] or 0.0) for row in rows)
    print(f"{count:9d}   {wall_s:7.1f}   {occupied:8.0%}   {cpu_s:16.1f}", flush=True)
    return wall_s, occupied, cpu_s


if __name__ == "__main__":
    main()
