"""Answers beside those the search has found: the rest of the path folded over a line.

Where all that later legs see lies near one line through a corner, the path may go on on either side of it, and the
readings hardly tell (two sources and a corner on their line: not at all). One such corner doubles the answers, several
multiply them, and rounds draw only some. So every answer is folded at every corner, over the line to each source and
over that through each two sources near the corner; the fit on compressed legs tells which of it is an answer.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.beam import roughly_fitted
from dslam_mav.dslam.compress import Compressed
from dslam_mav.dslam.modes import Indices, Modes, best, canonical, merge, new

Array = NDArray[np.float64]

NEAR_SPREADS = 1.0  # how far from the line through two sources a corner may lie
BESIDE_SPREADS = 0.7  # how far a source may lie from the leg that it is mirrored over
TRIED = 320  # folds, those that fit best as they are
ITERATIONS = 6
SAME_ROUGHLY = 0.1  # as modes.SAME_MODE, after so few iterations
KEPT = 48  # of these, for the whole fit
FINISHED_ITERATIONS = 60
DEPTH = 2  # folds of folds


def with_folds(comp: Compressed, modes: Modes, window: float, widest: float) -> Modes:
    """The modes and their folds: those of modes whose χ² is within `window` of the best, kept within `widest`."""
    fresh = modes
    for _ in range(DEPTH):
        near = fresh.take(np.flatnonzero(fresh.cost < modes.cost.min(initial=np.inf) + window))
        if not len(near):
            break
        known = modes.cost
        modes = merge(modes, folds_of(comp, near, modes), widest)
        fresh = modes.take(np.flatnonzero(~np.isin(modes.cost, known)))
    return modes


def folds_of(comp: Compressed, modes: Modes, known: Modes) -> Modes:
    """What fits come to that begin at the folds of the modes and do not lead back to those known, best first."""
    last = comp.legs.length.size - 1
    tried = roughly_fitted(comp, folded(comp, modes), 0, last, 0)
    tried = roughly_fitted(comp, tried.take(np.argsort(tried.cost, kind="stable")[:TRIED]), 0, last, ITERATIONS)
    return refitted(comp, new(known, canonical(tried), KEPT, SAME_ROUGHLY))


def refitted(comp: Compressed, modes: Modes) -> Modes:
    """The distinct minima that the modes lead to, best first."""
    last = comp.legs.length.size - 1
    return canonical(best(roughly_fitted(comp, modes, 0, last, FINISHED_ITERATIONS), 0, last, len(modes)))


def folded(comp: Compressed, modes: Modes) -> Modes:
    """Every fold of every mode: of the legs after a corner, of these with all sources (which is to fold the legs
    before), and of one source over a leg's line.
    """
    ends = np.cumsum(comp.legs.length[None, :, None] * _directions(modes.theta), axis=1)
    which, corner, axis = _axes(modes, ends[:, :-1])
    later = np.arange(modes.theta.shape[1])[None, :] > corner[:, None]
    theta = np.where(later, 2.0 * axis[:, None] - modes.theta[which], modes.theta[which])
    s = modes.s[which]
    mirrored = s - 2.0 * _off(s - ends[which, corner][:, None], axis[:, None])
    m, k, off = _beside_legs(modes, ends)
    over = modes.s[m]
    over[np.arange(m.size), k] -= 2.0 * off
    of = np.concatenate([which, which, m])
    return Modes(
        np.concatenate([theta, theta, modes.theta[m]]), np.concatenate([s, mirrored, over]), modes.alpha[of],
        np.zeros(of.size), modes.rounds,
    )  # fmt: skip


def _directions(angle: Array) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _off(place: Array, axis: Array) -> Array:
    """The part of places (…, 2) across a line through 0 of direction `axis` (…)."""
    along = _directions(axis)
    return np.asarray(place - (place * along).sum(axis=-1, keepdims=True) * along)


def _beside_legs(modes: Modes, ends: Array) -> tuple[Indices, Indices, Array]:
    """Sources near a leg's line: mode and source of each, and how far off it lies (…, 2)."""
    off = _off(modes.s[:, None] - ends[:, :, None], modes.theta[:, :, None])
    m, j, k = np.nonzero((off**2).sum(axis=-1) < BESIDE_SPREADS**2)
    return m, k, off[m, j, k]


def _axes(modes: Modes, corners: Array) -> tuple[Indices, Indices, Array]:
    """The lines to fold over: mode, corner (0 the end of the first leg) and direction of each."""
    to = modes.s[:, None] - corners[:, :, None]  # (M, L − 1, K, 2)
    which, corner, _ = np.indices(to.shape[:3])
    parts = [(which.ravel(), corner.ravel(), np.arctan2(to[..., 1], to[..., 0]).ravel())]
    for i, k in combinations(range(modes.alpha.shape[1]), 2):
        line = modes.s[:, k] - modes.s[:, i]
        angle = np.arctan2(line[:, 1], line[:, 0])
        m, j = np.nonzero((_off(to[:, :, i], angle[:, None]) ** 2).sum(axis=-1) < NEAR_SPREADS**2)
        parts.append((m, j, angle[m]))
    m, j, angle = (np.concatenate(column) for column in zip(*parts, strict=True))
    return m, j, angle
