"""Jobs on a Dask cluster whose workers have dslam_mav installed (extra `dask`)."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any

from dslam_mav.errors import DslamError
from dslam_mav.sweep.job import Ended, Job, run_job

MISSING = "--scheduler needs dask.distributed: pip install 'dslam-mav[dask]'"
PATIENCE_S = 10.0
DIED = "the Dask workers that tried it were killed or crashed, twice"
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
        """Every job. The scheduler tries those of a worker that died elsewhere, and in the end gives all of them up:
        they are then tried once more, one by one, so that each is judged by itself.
        """
        suspects: list[Job] = []
        try:
            for job, future in self._ending(jobs):
                if self._killed(future):
                    self._warn(f"{_named(job)}: the Dask workers that tried it died; it is tried once more at the end")
                    suspects.append(job)
                else:
                    yield self._ended(job, future)
            for suspect in suspects:
                for job, future in self._ending([suspect]):
                    if self._killed(future):
                        self._warn(
                            f"{_named(job)}: the Dask workers that tried it died again; it is recorded as failed"
                        )
                        yield Ended(job, {}, DIED)
                    else:
                        yield self._ended(job, future)
        except OSError:
            raise self._gone() from None
        finally:
            self._client.close()

    def _ending(self, jobs: Sequence[Job]) -> Iterator[tuple[Job, Any]]:
        """Jobs with their futures, as they end; never more of them at the cluster than it takes."""
        from distributed import as_completed

        left = iter(jobs)
        waiting: dict[str, Job] = {}
        arriving = as_completed(loop=self._client.loop)
        self._submit(left, waiting, arriving)
        while waiting:
            future = next(arriving)
            job = waiting.pop(future.key)
            self._submit(left, waiting, arriving)  # before anything else: nobody shall wait
            yield job, future

    def _submit(self, left: Iterator[Job], waiting: dict[str, Job], arriving: Any) -> None:
        wanted = max(1, self.threads) * AHEAD - len(waiting)  # workers come and go
        for _, job in zip(range(wanted), left, strict=False):
            future = self._client.submit(run_job, job, pure=False)
            waiting[future.key] = job
            arriving.add(future)

    def _killed(self, future: Any) -> bool:
        from distributed import KilledWorker

        return future.status == "error" and isinstance(future.exception(), KilledWorker)

    def _ended(self, job: Job, future: Any) -> Ended:
        if future.status == "finished":
            return Ended(job, *future.result())
        if future.status != "error":
            raise self._gone()
        problem = future.exception()
        why = f"{type(problem).__name__}: {problem}".splitlines()[0]
        raise DslamError(
            f"--scheduler {self._url}: its workers cannot run points, the same dslam_mav must be installed there: {why}"
        )

    def _gone(self) -> DslamError:
        return DslamError(f"--scheduler {self._url}: the scheduler went away; run again to go on")


def _named(job: Job) -> str:
    return ", ".join(str(value) for value in job.coordinates.values())
