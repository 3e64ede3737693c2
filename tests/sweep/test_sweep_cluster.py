"""Jobs on a real Dask cluster: all rows, failures in words, a dead worker's job given up, a lost scheduler one line."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from odd_jobs import COLUMNS, Dies, Raises, Square

from dslam_mav.errors import DslamError
from dslam_mav.sweep.cluster import DaskWorkers
from dslam_mav.sweep.engine import sweep
from dslam_mav.sweep.journal import Journal

distributed = pytest.importorskip("distributed")


@pytest.fixture
def cluster() -> Iterator[Any]:
    """Two workers; a job whose worker died is given up at once."""
    import dask

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as made,
    ):
        yield made


def test_jobs_on_a_cluster_end_as_they_do_here(cluster, tmp_path):
    warnings: list[str] = []
    jobs = [Raises(0, tmp_path), Dies(1, tmp_path, 0.01), *(Square(n, tmp_path) for n in range(2, 30))]
    workers = DaskWorkers(cluster.scheduler_address, warnings.append)
    assert workers.threads == 2
    with Journal(tmp_path / "points.jsonl") as journal:
        result = sweep(jobs, COLUMNS, journal, workers, lambda *_: None)
    assert [row["square"] for row in result.rows] == [None, None, *(float(n**2) for n in range(2, 30))]
    assert result.rows[0]["failure"] == "ZeroDivisionError: one"
    assert result.rows[1]["failure"] == "the Dask workers that tried it were killed or crashed, twice"
    assert result.failed == result.rows[:2], "those that waited on the same worker have their rows"
    assert "1: the Dask workers that tried it died; it is tried once more at the end" in warnings
    assert warnings[-1] == "1: the Dask workers that tried it died again; it is recorded as failed"


def test_a_scheduler_that_goes_away_leaves_what_ended(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("dslam_mav.sweep.cluster.PATIENCE_S", 2.0)
    jobs = [Square(n, tmp_path, 0.05) for n in range(200)]

    def tell(done: int, total: int, left_s: float) -> None:
        if done == 5:
            cluster.close()

    with Journal(tmp_path / "points.jsonl") as journal:
        with pytest.raises(DslamError, match="the scheduler went away; run again to go on"):
            sweep(jobs, COLUMNS, journal, DaskWorkers(cluster.scheduler_address, print), tell)
        assert 5 <= len(journal.rows) < 200
