"""Trials of an experiment in processes of their own; the result does not depend on how many."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager

from dslam_mav.experiments.experiment import Experiment, Result
from dslam_mav.experiments.measures import Measured
from dslam_mav.experiments.trials import Piece, Row, pieces, run_piece, statistics

Done = Callable[[Piece, list[Measured]], None]


class Trials:
    """Runs pieces in `workers` processes, or in this one where that is 1."""

    def __init__(self, workers: int | None) -> None:
        self._workers = workers or os.cpu_count() or 1
        self._pool: ProcessPoolExecutor | None = None

    def run(self, name: str, rows: Sequence[Row], todo: Sequence[Piece], seed: int, done: Done) -> None:
        """Every piece; `done` is told of each as it ends."""
        if self._workers == 1 or len(todo) == 1:
            for piece in todo:
                done(piece, run_piece(name, rows[piece.row], piece, seed))
            return
        if self._pool is None:
            # not forked: a fork of a process with threads may hang
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(self._workers, mp_context=context, initializer=_deaf_to_ctrl_c)
        waiting: dict[Future[list[Measured]], Piece] = {}
        left = iter(todo)
        for piece in _next(left, 2 * self._workers):
            waiting[self._pool.submit(run_piece, name, rows[piece.row], piece, seed)] = piece
        while waiting:
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                done(waiting.pop(future), future.result())
                for piece in _next(left, 1):
                    waiting[self._pool.submit(run_piece, name, rows[piece.row], piece, seed)] = piece

    def close(self) -> None:
        """Let the processes end what they are at, and go."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def trials_in(workers: int | None) -> Iterator[Trials]:
    """Processes for as long as the block runs."""
    trials = Trials(workers)
    try:
        yield trials
    finally:
        trials.close()


class Course:
    """What an experiment has measured so far."""

    def __init__(self, experiment: Experiment, rows: Sequence[Row], trials: int) -> None:
        self.experiment, self.rows = experiment, rows
        self.todo = list(pieces(rows, trials))
        self.total = sum(piece.last - piece.first for piece in self.todo)
        self.done = 0
        self._found: dict[Piece, list[Measured]] = {}

    def take(self, piece: Piece, measured: list[Measured]) -> None:
        """A piece has come in."""
        self._found[piece] = measured
        self.done += len(measured)

    def result(self) -> Result:
        """In the order of the trials, whoever ran them."""
        by_row = [
            [one for piece in self.todo if piece.row == i for one in self._found.get(piece, ())]
            for i in range(len(self.rows))
        ]
        return Result(self.experiment, self.rows, [statistics(measured) for measured in by_row])


def _next(left: Iterator[Piece], count: int) -> list[Piece]:
    return [piece for _, piece in zip(range(count), left, strict=False)]


def _deaf_to_ctrl_c() -> None:
    """Ctrl-C reaches the whole group; the parent alone decides what it means."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
