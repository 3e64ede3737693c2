"""Jobs in processes of this machine. A process that dies takes its own job with it, and no other."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Self

from dslam_mav.sweep.job import Ended, Job, run_job
from dslam_mav.sweep.points.columns import Row

ATTEMPTS = 2
DIED = "its worker process was killed or crashed"
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

Answer = Future[tuple[Row, str]]


@dataclass(frozen=True, slots=True, eq=False)
class _Turn:
    """A job's turn on the process with this number."""

    process: int
    job: Job
    attempt: int


class LocalWorkers:
    """`count` processes, each with one thread; `warn` is told of each that dies with a job."""

    def __init__(self, count: int, warn: Callable[[str], None]) -> None:
        self._count, self._warn = count, warn

    def run(self, jobs: Sequence[Job]) -> Generator[Ended, None, None]:
        """Every job; one whose process died is tried once more, then it has failed."""
        left = deque((job, 1) for job in jobs)
        running: dict[Answer, _Turn] = {}
        with _one_thread_each(), _Processes(min(self._count, len(left))) as processes:
            for process in range(len(processes)):
                _start(processes, process, left, running)
            while running:
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    turn = running.pop(future)
                    ended = self._ended(future, turn)
                    if ended is None:
                        left.appendleft((turn.job, turn.attempt + 1))
                    _start(processes, turn.process, left, running)  # before anything else: nobody shall wait
                    if ended is not None:
                        yield ended

    def _ended(self, future: Answer, turn: _Turn) -> Ended | None:
        """What came of it; None: to be tried again."""
        try:
            return Ended(turn.job, *future.result())
        except BrokenExecutor:
            name = ", ".join(str(value) for value in turn.job.coordinates.values())
            if turn.attempt < ATTEMPTS:
                self._warn(f"{name}: {DIED}; it is tried once more")
                return None
            self._warn(f"{name}: {DIED} again; it is recorded as failed")
            return Ended(turn.job, {}, f"{DIED}, {ATTEMPTS} times")


class _Processes:
    """Pools of one process each: a pool whose process dies says so of all its jobs, and cannot be used any more."""

    def __init__(self, count: int) -> None:
        self._pools = [_pool() for _ in range(count)]

    def __len__(self) -> int:
        return len(self._pools)

    def submit(self, process: int, job: Job) -> Answer:
        """Hand it over, to a fresh process where that one is dead."""
        with _ctrl_c_waits():
            try:
                return self._pools[process].submit(run_job, job)
            except BrokenExecutor:
                self._pools[process].shutdown(wait=True)
                self._pools[process] = _pool()
                return self._pools[process].submit(run_job, job)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *problem: object) -> None:
        for pool in self._pools:
            pool.shutdown(wait=True, cancel_futures=True)


def _pool() -> ProcessPoolExecutor:
    # not forked: a fork of a process with threads may hang
    return ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"), initializer=_prepare)


def _start(processes: _Processes, process: int, left: deque[tuple[Job, int]], running: dict[Answer, _Turn]) -> None:
    if left:
        job, attempt = left.popleft()
        running[processes.submit(process, job)] = _Turn(process, job, attempt)


@contextmanager
def _ctrl_c_waits() -> Iterator[None]:
    """A process started meanwhile never hears Ctrl-C, not even while it is still loading; this one does, afterwards."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _prepare() -> None:
    """Ctrl-C reaches the whole group, and the parent alone decides what it means; without a parent there is no work."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes started meanwhile have one thread: libraries read this once, when they are loaded."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
