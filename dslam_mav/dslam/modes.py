"""Distinct minima of the search, best first: pick, merge, and bring to one gauge."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.align import MIN_TURN_SINE
from dslam_mav.dslam.compress import Compressed
from dslam_mav.dslam.kernels.distinct import distinct

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SAME_MODE = 0.03  # in spreads, and in the headings' cosines and sines
MOST_MODES = 128


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """M candidates: headings θ (M, L), sources S (M, K, 2), log amplitudes α (M, K), χ² `cost` (M,).

    In the units of the `Compressed` they were found on; sources are measured from the start of the first leg in use.
    """

    theta: Array
    s: Array
    alpha: Array
    cost: Array
    rounds: int = 0

    def __len__(self) -> int:
        return int(self.cost.size)

    def take(self, index: Indices) -> Modes:
        """Some of the modes, in the given order."""
        return Modes(self.theta[index], self.s[index], self.alpha[index], self.cost[index], self.rounds)


def no_modes(n_legs: int, k_sources: int) -> Modes:
    """No mode yet."""
    return Modes(np.empty((0, n_legs)), np.empty((0, k_sources, 2)), np.empty((0, k_sources)), np.empty(0))


def best(modes: Modes, lo: int, hi: int, keep: int) -> Modes:
    """The best `keep` that differ on legs lo … hi."""
    order = np.argsort(modes.cost, kind="stable")
    ordered = modes.take(order[np.isfinite(modes.cost[order])])
    return ordered.take(distinct(_marks(ordered, lo, hi), keep, SAME_MODE))


def new(known: Modes, more: Modes, keep: int, same: float) -> Modes:
    """The best `keep` of `more` that differ from each other and from those known."""
    order = np.argsort(more.cost, kind="stable")
    more = more.take(order[np.isfinite(more.cost[order])])
    last = more.theta.shape[1] - 1
    marks = np.concatenate([_marks(known, 0, last), _marks(more, 0, last)])
    kept = distinct(marks, len(known) + keep, same)
    return more.take(kept[kept >= len(known)][:keep] - len(known))


def _marks(modes: Modes, lo: int, hi: int) -> Array:
    """(M, …) sources in order of x, and the cosines and sines of headings lo … hi."""
    m, k_sources = modes.alpha.shape
    by_x = np.argsort(modes.s[:, :, 0], axis=1)
    s = np.take_along_axis(modes.s, by_x[:, :, None], axis=1)
    theta = modes.theta[:, lo : hi + 1]
    return np.concatenate([s.reshape(m, 2 * k_sources), np.cos(theta), np.sin(theta)], axis=1)


def merge(modes: Modes, more: Modes, window: float) -> Modes:
    """Both sets' distinct minima within `window` of the best."""
    if not len(more):
        return modes
    both = Modes(
        np.concatenate([modes.theta, more.theta]),
        np.concatenate([modes.s, more.s]),
        np.concatenate([modes.alpha, more.alpha]),
        np.concatenate([modes.cost, more.cost]),
        max(modes.rounds, more.rounds),
    )
    near = np.flatnonzero(both.cost < both.cost.min() + window)
    return best(both.take(near), 0, modes.theta.shape[1] - 1, MOST_MODES)


def canonical(modes: Modes) -> Modes:
    """Turn every mode so that its first leg has heading 0, and mirror it so that its first turn is positive."""
    theta, s = modes.theta.copy(), modes.s.copy()
    for i in range(len(modes)):
        first = theta[i, 0]
        cos, sin = np.cos(first), np.sin(first)
        theta[i] -= first
        s[i] = s[i] @ np.array([[cos, -sin], [sin, cos]])
        sines = np.sin(np.diff(theta[i]))
        turns = sines[np.abs(sines) > MIN_TURN_SINE]
        if turns.size and turns[0] < 0.0:
            theta[i] *= -1.0
            s[i, :, 1] *= -1.0
    return replace(modes, theta=theta, s=s)


def freedom(comp: Compressed, k_sources: int) -> int:
    """Degrees of freedom that a fit of so many sources leaves inside the bases."""
    return int(comp.rank.sum()) - (comp.legs.length.size - 1) - 3 * k_sources


def misfit(modes: Modes, comp: Compressed, k_sources: int) -> float:
    """By how much the best answer's χ² exceeds what noise explains, at least 1: Δχ² is measured in its units."""
    if not len(modes):
        return 1.0
    return max(1.0, float(modes.cost.min()) / max(freedom(comp, k_sources), 1))
