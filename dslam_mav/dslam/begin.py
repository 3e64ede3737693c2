"""Where the joint fit begins, whatever is known of the medium: the search for straight legs, curves, slow sensors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.media import media_starts
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.reduce import unlagged
from dslam_mav.dslam.scatter import scatter
from dslam_mav.dslam.starts import Starts, starts
from dslam_mav.dslam.state import State

Array = NDArray[np.float64]

USUAL_LAGS = np.array([0.003, 0.01, 0.03])  # of the flight: where an unknown lag is looked for
NO_LAG = 1e-4  # of the flight: a fast sensor
LONGEST_LAG = 0.2  # of the flight: what is slower is looked for as if it were not
NEAR_LAG = np.array([0.6, 1.0])  # of a known one: how far back readings belong depends on what they pass


def begin(prob: Problem, coarse: Problem, k_sources: int, rng: np.random.Generator) -> Starts:
    """Starts at one C for all sources, whatever is known of each; of a slow sensor at its lag, or at likely ones."""
    if prob.lag == 0.0 or prob.basis is not None:
        return _search_unlagged(prob, coarse, k_sources, rng)
    duration = float(prob.t[-1])
    likely = USUAL_LAGS * duration if prob.lag is None else NEAR_LAG * min(prob.lag, LONGEST_LAG * duration)
    lags = [float(lag) for lag in likely]
    found = [_search_unlagged(prob, unlagged(coarse, lag), k_sources, rng) for lag in lags]
    if prob.lag is None:
        lags.append(NO_LAG * duration)
        found.append(_search_unlagged(prob, coarse, k_sources, rng))
    states = []
    for lag, each in zip(lags, found, strict=True):
        own = float(np.log(lag if prob.lag is None else prob.lag))
        states += [replace(state, log_lag=own, log_spread2=_as_known(coarse, state)) for state in each.states]
    return replace(found[0], states=tuple(states))


def _as_known(prob: Problem, state: State) -> Array:
    """(K,) ln C as known, which the search may have widened."""
    return state.log_spread2 if prob.spread2 is None else np.log(np.broadcast_to(prob.spread2, len(state.s)))


def _search_unlagged(prob: Problem, coarse: Problem, k_sources: int, rng: np.random.Generator) -> Starts:
    if prob.basis is not None or prob.dimensions == 3:
        return scatter(prob, k_sources, rng)
    return media_starts(coarse, k_sources, rng) if coarse.spread2 is None else starts(coarse, k_sources, rng)


def dithered(prob: Problem, share: float, rng: np.random.Generator) -> Problem:
    """With noise added to the readings.

    Where misfit stands far out of the noise, the search takes it for signal: its valleys are narrow, wrong ones deep,
    and what the final fits would put first is thrown away early. White noise as large as the misfit levels them.
    """
    noise = share * float(np.ptp(prob.y)) * rng.standard_normal(prob.y.size)
    return replace(prob, y=prob.y + noise)
