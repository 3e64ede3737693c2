"""A point as a worker sees it: something to run that gives a row."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Protocol

from threadpoolctl import threadpool_limits

from dslam_mav.errors import DslamError
from dslam_mav.sweep.points.columns import Row, Scalar


class Job(Protocol):
    """A point; pickled to worker processes. Its row depends on nothing but itself."""

    @property
    def key(self) -> str:
        """Alike for points whose rows are alike."""

    @property
    def coordinates(self) -> Mapping[str, Scalar]:
        """The columns that say which point it is."""

    def run(self) -> Row:
        """The other columns. An exception makes it a failed point."""


@dataclass(frozen=True, slots=True, eq=False)
class Ended:
    """What came of a job: a row, or `failure` in words."""

    job: Job
    row: Row
    failure: str = ""


class Workers(Protocol):
    """Who works jobs off."""

    def run(self, jobs: Sequence[Job]) -> Generator[Ended, None, None]:
        """Every job, in the order they end; closing the generator ends the work."""


def run_job(job: Job) -> tuple[Row, str]:
    """(row, "") or ({}, why not): a point that cannot be computed is no reason to lose the others."""
    one_thread()
    try:
        return job.run(), ""
    except DslamError as problem:
        return {}, str(problem)
    except Exception as problem:
        return {}, f"{type(problem).__name__}: {problem}".splitlines()[0]


@cache
def one_thread() -> None:
    """One BLAS thread from now on: more would only get into each other's way, and sum in another order."""
    threadpool_limits(1)  # type: ignore[no-untyped-call]
