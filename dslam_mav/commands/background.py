"""Work beside the main thread whose failure is not lost."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

SWITCH_S = 5e-4

Job = Callable[[threading.Event], object]


class Background:
    """One job in a thread; `error` is what it raised."""

    def __init__(self, job: Job, stop: threading.Event, name: str) -> None:
        self.error: BaseException | None = None
        self._job = job
        self._stop = stop
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether the job is still at it."""
        return self._thread.is_alive()

    def join(self, timeout_s: float | None = None) -> None:
        """Wait for the end of the job."""
        self._thread.join(timeout_s)

    def check(self) -> None:
        """Raise here what the job raised there."""
        if self.error is not None:
            raise self.error

    def _run(self) -> None:
        try:
            self._job(self._stop)
        except BaseException as error:
            self.error = error


@contextmanager
def background(job: Job, name: str, patience_s: float = 10.0) -> Iterator[Background]:
    """The job runs while the block does; at its end it is told to stop and waited for."""
    # a thread that sends gives the interpreter up at every packet: it must not wait long for one that estimates
    sys.setswitchinterval(min(sys.getswitchinterval(), SWITCH_S))
    stop = threading.Event()
    worker = Background(job, stop, name)
    try:
        yield worker
    finally:
        stop.set()
        worker.join(patience_s)
