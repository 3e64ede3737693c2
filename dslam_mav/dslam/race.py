"""Fits from many starts: all are begun, those far behind give up, and what crawls is taken on by Newton's steps."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from dslam_mav.dslam.certify import SAME_PLACE_SPREADS, WINDOW
from dslam_mav.dslam.fit import Fit, fit, settled
from dslam_mav.dslam.pool import apart
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import State

THREADS = 2  # as the search; the fits are the same whatever their number
HEAT = 6  # iterations all starts are given
CRAWLING = 8  # of the best: taken on by Newton's steps where they have not settled
FAR_BEHIND = 40.0  # in χ², after them


def raced(prob: Problem, states: Sequence[State], eased: Sequence[Problem] = ()) -> list[Fit]:
    """Fits from all states, best first: after a few iterations those far behind, or where another is, give up.

    `eased`: the same problem with less and less slack in what is known of it, for states that do not keep to that yet.
    """

    def begun(state: State) -> Fit:
        for easier in eased:
            state = fit(easier, state, iterations=HEAT).state
        return fit(prob, state, iterations=HEAT)

    with ThreadPoolExecutor(THREADS) as threads:
        pool = list(threads.map(begun, states))
    ordered = sorted((f for f in pool if np.isfinite(f.cost)), key=lambda f: f.cost)
    kept: list[Fit] = []
    for f in ordered:
        unit = max((ordered[0].cost + prob.outside) / prob.n_readings, prob.doubt)
        if f.cost > ordered[0].cost + FAR_BEHIND * unit:
            break
        if all(apart(prob, f.state, other.state) > SAME_PLACE_SPREADS * f.state.spread for other in kept):
            kept.append(f)
    with ThreadPoolExecutor(THREADS) as threads:
        kept = sorted(threads.map(lambda f: f if f.converged else fit(prob, f.state), kept), key=lambda f: f.cost)
        within = kept[0].cost + WINDOW * (kept[0].cost + prob.outside) / prob.n_readings if kept else 0.0
        crawling = [i < CRAWLING and f.cost < within for i, f in enumerate(kept)]
        ended = threads.map(lambda f, crawls: settled(prob, f) if crawls else f, kept, crawling)
        return _settled(list(ended))


def _settled(fits: list[Fit]) -> list[Fit]:
    """Settled fits first, best first; those that ended in a flat valley stay as rivals."""
    return sorted((f for f in fits if np.isfinite(f.cost)), key=lambda f: (not f.converged, f.cost))
