"""`plan --simulate`: missions flown through the estimator, in processes of their own; how many changes no figure."""

from __future__ import annotations

import multiprocessing
import os
import signal
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass

import numpy as np

from dslam_mav.commands.plan_prior import Expectation
from dslam_mav.commands.screen import Advance
from dslam_mav.dslam.expected import Sensing
from dslam_mav.dslam.layouts import Layouts, drawn
from dslam_mav.dslam.outlook import Range, outlook
from dslam_mav.dslam.rehearsal import Rehearsed, rehearse
from dslam_mav.records.arrays import Array

FLIGHTS_SEED = 2  # none of the layouts the mission was made on


@dataclass(frozen=True, slots=True)
class Simulated:
    """What so many flights came to, beside what was predicted for their own layouts; `second_share`: of flights where
    another answer fits as well, `unanswered_share`: where no positions were given.
    """

    flights: int
    source: Range
    path: Range
    predicted: Range
    predicted_path: Range
    nearest: Range
    second_share: float
    unanswered_share: float


def simulate(
    path: Array, expected: Expectation, flights: int, workers: int | None, seed: int, advance: Advance
) -> Simulated:
    """Fly them; layouts are drawn afresh from what is known."""
    groups = drawn(expected.prior, flights, np.random.default_rng((seed, FLIGHTS_SEED)))
    jobs = [(group, i) for group in groups for i in range(len(group))]
    done: dict[int, Rehearsed] = {}
    count = min(workers or os.cpu_count() or 1, os.cpu_count() or 1, len(jobs))

    def take(number: int, found: Rehearsed) -> None:
        done[number] = found
        advance("simulated missions", len(done), len(jobs), f"{len(done)} of {len(jobs)}")

    if count == 1:
        for number, (group, i) in enumerate(jobs):
            take(number, fly_one(path, group, i, expected.sensing, seed, number))
    else:
        # not forked: a fork of a process with threads may hang
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(count, mp_context=context, initializer=_deaf_to_ctrl_c) as pool:
            try:
                waiting = {
                    pool.submit(fly_one, path, group.part(i, i + 1), 0, expected.sensing, seed, number): number
                    for number, (group, i) in enumerate(jobs)
                }
                for future in as_completed(waiting):
                    take(waiting[future], future.result())
            except BaseException:
                pool.shutdown(wait=True, cancel_futures=True)
                raise
    flown = [done[number] for number in range(len(jobs))]
    bound = outlook(path, groups, expected.sensing)
    return Simulated(
        len(flown),
        Range.of(np.array([one.source_m for one in flown])),
        Range.of(np.array([one.path_m for one in flown])),
        bound.source,
        bound.path,
        Range.of(np.array([one.nearest_m for one in flown])),
        float(np.mean([one.second for one in flown])),
        float(np.mean([not one.answered for one in flown])),
    )


def fly_one(path: Array, group: Layouts, i: int, sensing: Sensing, seed: int, number: int) -> Rehearsed:
    """The flight of this number: its noise is its own, whoever flies it."""
    return rehearse(path, group, i, sensing, np.random.default_rng((seed, FLIGHTS_SEED, number)))


def _deaf_to_ctrl_c() -> None:
    """Ctrl-C reaches the whole group; the parent alone decides what it means."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
