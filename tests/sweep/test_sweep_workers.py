"""Worker processes: every job once, whatever order; a killed one is told, tried once more, then failed in words."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import pytest
from odd_jobs import COLUMNS, Dies, Raises, Refuses, Square, Tells

from dslam_mav.sweep.engine import Swept, sweep
from dslam_mav.sweep.journal import Journal
from dslam_mav.sweep.local import LocalWorkers


def swept(jobs: list[Any], folder: Path, workers: int = 2, said: list[Any] | None = None) -> tuple[Swept, list[str]]:
    warnings: list[str] = []
    with Journal(folder / "points.jsonl") as journal:
        tell = (said if said is not None else []).append
        workers_here = LocalWorkers(workers, warnings.append)
        return sweep(jobs, COLUMNS, journal, workers_here, lambda *now: tell(now)), warnings


def test_every_job_is_run_once_and_its_row_is_in_its_place(tmp_path):
    jobs = [Square(n, tmp_path, 0.02 * (n % 3)) for n in range(12)]
    said: list[tuple[int, int, float]] = []
    result, warnings = swept(jobs, tmp_path, said=said)
    assert result.rows == [{"n": n, "square": float(n**2), "failure": None} for n in range(12)]
    assert [job.times_run() for job in jobs] == [1] * 12
    assert (result.computed, result.failed, warnings) == (12, [], [])
    assert [done for done, _, _ in said] == list(range(13))
    assert math.isnan(said[0][2])
    assert said[-1][1:] == (12, 0.0)


def test_a_worker_that_dies_is_told_and_its_job_tried_once_more(tmp_path):
    once, always, fine = Dies(1, tmp_path), Dies(2, tmp_path, 0.01), Square(3, tmp_path, 0.1)
    result, warnings = swept([once, always, fine], tmp_path)
    assert [row["square"] for row in result.rows] == [1.0, None, 9.0]
    assert result.rows[1]["failure"] == "its worker process was killed or crashed, 2 times"
    assert [job.times_run() for job in (once, always, fine)] == [2, 2, 1]
    assert sorted(warnings) == [
        "1: its worker process was killed or crashed; it is tried once more",
        "2: its worker process was killed or crashed again; it is recorded as failed",
        "2: its worker process was killed or crashed; it is tried once more",
    ]


def test_a_job_that_fails_says_why_and_is_tried_again_by_the_next_run(tmp_path):
    jobs = [Raises(1, tmp_path), Refuses(2, tmp_path), Square(3, tmp_path)]
    first, _ = swept(jobs, tmp_path)
    assert [row["failure"] for row in first.rows] == ["ZeroDivisionError: one", "file.mcap: nothing in it", None]
    assert first.failed == first.rows[:2]
    mended = [Square(1, tmp_path), Refuses(2, tmp_path), Square(3, tmp_path)]
    second, _ = swept(mended, tmp_path)
    assert (second.computed, jobs[2].times_run()) == (2, 1)
    assert [row["square"] for row in second.rows] == [1.0, None, 9.0]


def test_workers_have_one_thread_and_leave_the_environment_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    result, _ = swept([Tells(1, tmp_path)], tmp_path, workers=1)
    assert result.rows[0]["square"] == 11.0
    assert os.environ["OPENBLAS_NUM_THREADS"] == "3"
    assert "NUMBA_NUM_THREADS" not in os.environ


def test_what_ended_before_an_interrupt_is_kept(tmp_path):
    jobs = [Square(n, tmp_path) for n in range(6)]

    def tell(done: int, total: int, left_s: float) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), Journal(tmp_path / "points.jsonl") as journal:
        sweep(jobs, COLUMNS, journal, LocalWorkers(2, print), tell)
    result, _ = swept(jobs, tmp_path)
    assert result.computed == 3
    assert [row["square"] for row in result.rows] == [float(n**2) for n in range(6)]
