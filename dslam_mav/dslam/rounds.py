"""Rounds of a search until they bring nothing new: chi² alone certifies an answer only at high signal-to-noise, that it
is found again does the work (theory, section 8, step 7).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.kernels.distinct import distinct

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

QUIET = 3
WINDOW = 25.0  # of χ²: answers kept
NEWS = 12.0  # a new answer within this of the best is news
MOST_KEPT = 24
CROWD = 20  # so many answers nearly as good are a continuum
SAME = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """M candidate answers: `path` (M, …, d) directions of legs or coefficients, S (M, K, d), log amplitudes α (M, K),
    ambient level (M,), χ² `cost` (M,).
    """

    path: Array
    s: Array
    alpha: Array
    level: Array
    cost: Array

    def __len__(self) -> int:
        return int(self.cost.size)

    def take(self, index: Indices) -> Candidates:
        """Some of the candidates, in the given order."""
        return Candidates(*(getattr(self, f.name)[index] for f in fields(self)))


def joined(*parts: Candidates) -> Candidates:
    """All of them."""
    return Candidates(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Candidates)))


def best(pool: Candidates, marks: Callable[[Candidates], Array], keep: int) -> Candidates:
    """The best `keep` whose `marks` (M, …) differ: what no change of gauge changes."""
    order = np.argsort(pool.cost, kind="stable")
    pool = pool.take(order[np.isfinite(pool.cost[order])])
    return pool.take(distinct(marks(pool).reshape(len(pool), -1), keep, SAME)) if len(pool) else pool


def searched(
    one_round: Callable[[int], Candidates], marks: Callable[[Candidates], Array], most: int, enough: float
) -> Candidates:
    """Distinct answers, best first, of rounds 0, 1, … until `QUIET` in a row bring nothing better or new.

    `enough`: the χ² that noise explains; an answer above it is not believed however often it is found.
    """
    found, quiet = one_round(0), 0
    for i in range(1, most):
        before = found.cost
        both = joined(found, one_round(i))
        if not len(both):
            continue
        found = best(both.take(np.flatnonzero(both.cost < both.cost.min() + WINDOW)), marks, MOST_KEPT)
        quiet = 0 if _news(before, found.cost) else quiet + 1
        crowded = quiet > 0 and int((found.cost < found.cost[0] + NEWS).sum()) >= CROWD
        if found.cost[0] < enough and (quiet >= QUIET or crowded):
            break
    return found


def _news(before: Array, after: Array) -> bool:
    if not before.size:
        return True
    limit = float(after.min()) + NEWS
    return bool(after.min() < before.min() - 1e-3 * (1.0 + 1e-3 * before.min())) or int((after < limit).sum()) > int(
        (before < limit).sum()
    )
