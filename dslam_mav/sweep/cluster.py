"""Jobs on a Dask cluster whose workers have dslam_mav installed (extra `dask`)."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any

from dslam_mav.errors import DslamError
from dslam_mav.sweep.job import Ended, Job, run_job

MISSING = "--scheduler needs dask.distributed: pip install 'dslam-mav[dask]'"
PATIENCE_S = 10.0
AHEAD = 3  # jobs handed over for every thread of the cluster: none waits for the next


class DaskWorkers:
    """The cluster whose scheduler is at `url`; `warn` is told of points whose workers died.

    DslamError: dask.distributed is missing, or nobody answers at `url`.
    """

    def __init__(self, url: str, warn: Callable[[str], None]) -> None:
        if importlib.util.find_spec("distributed") is None:
            raise DslamError(MISSING)
        from distributed import Client

        self._url, self._warn = url, warn
        try:
            self._client = Client(url, timeout=PATIENCE_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as problem:
            why = str(problem).splitlines()[0] if str(problem) else type(problem).__name__
            raise DslamError(f"--scheduler {url}: no Dask scheduler can be reached: {why}") from None

    @property
    def threads(self) -> int:
        """Of all workers together; 0 as long as there are none."""
        return int(sum(self._client.nthreads().values()))

    def run(self, jobs: Sequence[Job]) -> Generator[Ended, None, None]:
        """Every job. The scheduler itself tries a job again whose worker died, until it gives it up."""
        from distributed import as_completed

        left = iter(jobs)
        waiting: dict[str, Job] = {}
        arriving = as_completed(loop=self._client.loop)
        try:
            self._submit(left, max(1, self.threads) * AHEAD, waiting, arriving)
            while waiting:
                future = next(arriving)
                job = waiting.pop(future.key)
                # as many as the cluster takes by now: workers come and go
                self._submit(left, max(1, self.threads) * AHEAD - len(waiting), waiting, arriving)
                yield self._ended(job, future)
        finally:
            self._client.close()

    def _submit(self, left: Iterator[Job], count: int, waiting: dict[str, Job], arriving: Any) -> None:
        for _, job in zip(range(count), left, strict=False):
            future = self._client.submit(run_job, job, pure=False)
            waiting[future.key] = job
            arriving.add(future)

    def _ended(self, job: Job, future: Any) -> Ended:
        from distributed import KilledWorker

        if future.status == "finished":
            return Ended(job, *future.result())
        problem = future.exception() if future.status == "error" else None
        if isinstance(problem, KilledWorker):
            name = ", ".join(str(value) for value in job.coordinates.values())
            self._warn(f"{name}: every Dask worker that tried it died; it is recorded as failed")
            return Ended(job, {}, "every Dask worker that tried it was killed or crashed")
        if problem is None:
            raise DslamError(f"--scheduler {self._url}: the scheduler went away; run again to go on")
        why = str(problem).splitlines()[0] if str(problem) else ""
        raise DslamError(
            f"--scheduler {self._url}: its workers cannot run points, the same dslam_mav must be installed there: "
            f"{type(problem).__name__}: {why}"
        )
