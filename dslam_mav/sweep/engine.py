"""Works off what is not yet finished, and keeps each row as it comes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass

from dslam_mav.sweep.job import Ended, Job, Workers
from dslam_mav.sweep.journal import Journal
from dslam_mav.sweep.points.columns import Column, Row, plain, whole_row

Tell = Callable[[int, int, float], None]
"""Points done, points there are, seconds left (NaN as long as nobody knows)."""


@dataclass(frozen=True, slots=True, eq=False)
class Swept:
    """The rows of all jobs in their order, and how many of them were computed just now."""

    rows: list[Row]
    computed: int

    @property
    def failed(self) -> list[Row]:
        """Rows without a result."""
        return [row for row in self.rows if row["failure"]]


def unfinished(jobs: Sequence[Job], journal: Journal) -> list[Job]:
    """Jobs without a row, and those that failed: a failure may have been the machine's."""
    return [job for job in jobs if journal.rows.get(job.key, {"failure": "none yet"}).get("failure")]


def sweep(jobs: Sequence[Job], columns: Sequence[Column], journal: Journal, workers: Workers, tell: Tell) -> Swept:
    """Every job's row. Whatever ends this early leaves the finished rows in the journal."""
    todo = unfinished(jobs, journal)
    kept, begun_s = len(jobs) - len(todo), time.monotonic()
    tell(kept, len(jobs), float("nan"))
    with closing(workers.run(todo)) as ending:
        for count, ended in enumerate(ending, start=1):
            journal.add(ended.job.key, _row(columns, ended))
            left_s = (time.monotonic() - begun_s) / count * (len(todo) - count)
            tell(kept + count, len(jobs), left_s)
    return Swept([journal.rows[job.key] for job in jobs], len(todo))


def _row(columns: Sequence[Column], ended: Ended) -> Row:
    failure: Row = {"failure": ended.failure or None}
    return whole_row(columns, plain({**ended.row, **ended.job.coordinates, **failure}))
