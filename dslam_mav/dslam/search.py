"""The global search: rounds until the answers are found again and again (theory, section 8, step 7).

χ² alone certifies an answer only at high signal-to-noise; reproduction does the work. The lowest minimum is often not
the truth, so that every mode nearly as good is kept. Rounds go in pairs, each round with randomness of its own, and
are judged in their order: two threads find what one does, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from dslam_mav.dslam.beam import REACH_SPREADS, corners_by_energy, search_round
from dslam_mav.dslam.compress import Compressed
from dslam_mav.dslam.folds import with_folds
from dslam_mav.dslam.modes import Modes, freedom, merge, misfit, no_modes

MAX_ROUNDS = 24
REACHES = (REACH_SPREADS, 3.5)  # of the rounds of a pair: the second also looks for sources the corner hardly sees
HITS = 3  # rounds that must have found the best answer …
HIT_WINDOW = 0.1  # … to within this
QUIET_ROUNDS = 3  # in a row that bring no news
MODE_WINDOW = 25.0  # keep modes whose χ² is within this of the best
NEW_MODE_WINDOW = 12.0  # a new mode within this of the best is news
FOLD_WINDOW = 9.0  # modes within this of the best are folded
CROWD = 40  # so many answers nearly as good are a continuum: more rounds would only go on finding more
CERTAIN_SD = 3.0  # of χ²: a lone answer that fits so well, found by both rounds of the first pair, is the answer …
CERTAIN_POWER = 5e3  # … where signal over noise in a sample is this at the mean: 30 dB with 64 readings a leg


@dataclass(slots=True, eq=False)
class _Progress:
    """What the rounds so far have found; `lows`: the lowest χ² of each, `quiet`: how many in a row brought no news."""

    modes: Modes
    unit: float
    lows: list[float]
    doubt: float
    quiet: int = 0

    def add(self, more: Modes, comp: Compressed) -> None:
        """Judge one round more."""
        before, k_sources = self.modes, self.modes.alpha.shape[1]
        self.lows.append(float(more.cost.min()) if len(more) else np.inf)
        self.unit = max(self.doubt, misfit(merge(before, more, np.inf), comp, k_sources))
        self.modes = merge(before, more, MODE_WINDOW * self.unit)
        improved = not len(before) or self.modes.cost[0] < before.cost[0] - 1e-3 * (1.0 + 1e-3 * before.cost[0])
        news = improved or self.near(self.modes) > self.near(before)
        self.quiet = 0 if news and len(more) else self.quiet + 1

    def near(self, modes: Modes) -> int:
        """How many modes are nearly as good as the best."""
        return int((modes.cost < modes.cost.min(initial=np.inf) + NEW_MODE_WINDOW * self.unit).sum())

    def done(self, comp: Compressed) -> bool:
        """Whether further rounds would bring nothing."""
        if not len(self.modes):
            return self.quiet >= QUIET_ROUNDS
        lowest = float(self.modes.cost[0])
        hits = sum(low < lowest + HIT_WINDOW * self.unit for low in self.lows)
        if hits == len(self.lows) and self._certain(comp):
            return True
        return hits >= HITS and (self.quiet >= QUIET_ROUNDS or self.near(self.modes) >= CROWD)

    def _certain(self, comp: Compressed) -> bool:
        """Whether the readings are clear, and one answer alone explains them."""
        clear = float(comp.products.energy.sum()) > CERTAIN_POWER * float(comp.rank.sum())
        free = max(freedom(comp, self.modes.alpha.shape[1]), 1)
        return clear and len(self.modes) == 1 and self.modes.cost[0] < free + CERTAIN_SD * (2.0 * free) ** 0.5


def search(
    comp: Compressed, k_sources: int, rng: np.random.Generator, *, threads: int = 2, doubt: float = 0.0
) -> Modes:
    """All modes nearly as good as the best; `threads` (1 or 2) changes none of them. `doubt`: the least χ² a degree of
    freedom that differences are measured in (`Problem.doubt`).
    """
    corners = corners_by_energy(comp)
    progress = _Progress(no_modes(comp.legs.length.size, k_sources), 1.0, [], doubt)

    def one(index: int, own: np.random.Generator) -> Modes:
        return search_round(comp, k_sources, int(corners[index % corners.size]), own, REACHES[index % len(REACHES)])

    if threads == 1:
        _rounds(progress, comp, rng, lambda indices, own: [one(i, g) for i, g in zip(indices, own, strict=True)])
    else:
        with ThreadPoolExecutor(threads) as pool:
            _rounds(progress, comp, rng, lambda indices, own: list(pool.map(one, indices, own)))
    modes = with_folds(comp, progress.modes, FOLD_WINDOW * progress.unit, MODE_WINDOW * progress.unit)
    return replace(modes, rounds=len(progress.lows))


def _rounds(
    progress: _Progress,
    comp: Compressed,
    rng: np.random.Generator,
    run: Callable[[range, list[np.random.Generator]], list[Modes]],
) -> None:
    """Pairs of rounds until nothing more is to be expected."""
    while len(progress.lows) < MAX_ROUNDS and not (progress.lows and progress.done(comp)):
        done = len(progress.lows)
        for more in run(range(done, done + len(REACHES)), rng.spawn(len(REACHES))):
            progress.add(more, comp)
