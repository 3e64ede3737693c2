"""Rows of trials: what is run, in pieces that any process may take, and what comes of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from zlib import crc32

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from dslam_mav.experiments.measures import Measured
from dslam_mav.experiments.world import World

Array = NDArray[np.float64]
Measure = Callable[[World, np.random.Generator], Measured]

PIECE = 4  # trials


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """One row of an experiment: flights over `world`, each measured by `measure`.

    `label`: the row's own cells. `printed`: the paper's figures by error. `limits`: the bound by error. `once`: nothing
    is random in it, one trial tells all.
    """

    label: tuple[str, ...]
    world: World
    measure: Measure
    printed: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, float] = field(default_factory=dict)
    once: bool = False

    def trials(self, wanted: int) -> int:
        """How many flights the row takes."""
        return 1 if self.once else wanted


@dataclass(frozen=True, slots=True)
class Piece:
    """Trials `first` … `last` − 1 of a row."""

    row: int
    first: int
    last: int


def pieces(rows: Sequence[Row], trials: int) -> Iterator[Piece]:
    """All trials, every row's first ones first: an interrupted run has some of each row."""
    for first in range(0, trials, PIECE):
        for i, row in enumerate(rows):
            last = min(first + PIECE, row.trials(trials))
            if first < last:
                yield Piece(i, first, last)


def generator(name: str, row: int, trial: int, seed: int) -> np.random.Generator:
    """A trial's own randomness: it does not depend on who runs it, or when."""
    return np.random.default_rng((seed, crc32(name.encode()), row, trial))


def run_piece(name: str, row: Row, piece: Piece, seed: int) -> list[Measured]:
    """The trials of a piece of the experiment `name`."""
    measured = []
    with threadpool_limits(1):  # type: ignore[no-untyped-call]  # sums in another order end in other bits
        for trial in range(piece.first, piece.last):
            rng = generator(name, piece.row, trial, seed)
            measured.append(row.measure(row.world.placed(rng), rng))
    return measured


@dataclass(frozen=True, slots=True)
class Statistic:
    """A figure over the trials that gave one: what is averaged, and how many of all trials gave it."""

    mean: float
    rms: float
    median: float
    answered: int
    trials: int


def statistics(measured: Sequence[Measured]) -> dict[str, Statistic]:
    """By name, over the trials in their order."""
    names = list(dict.fromkeys(name for one in measured for name in one))
    return {name: _statistic(np.array([one.get(name, np.nan) for one in measured])) for name in names}


def _statistic(values: Array) -> Statistic:
    known = values[np.isfinite(values)]
    if not known.size:
        return Statistic(float("nan"), float("nan"), float("nan"), 0, values.size)
    rms = float(np.sqrt(np.mean(known**2)))
    return Statistic(float(known.mean()), rms, float(np.median(known)), known.size, values.size)
