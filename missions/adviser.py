"""After each leg: what to fly next, from all that the readings so far leave open. Pure, and the same in air and bench.

The adviser is told what the estimator is told (legs with readings, what is assumed of medium and sources) and what the
pilot set: how much may be flown, how sharply the sources are wanted. Before three legs are flown it goes by the prior
alone, then by the estimator's answers as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import ThreadpoolController

from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.belief import Belief, believed
from dslam_mav.dslam.estimator import estimate
from dslam_mav.dslam.expected import Sensing
from dslam_mav.dslam.known import Known
from dslam_mav.dslam.layouts import Prior, Region, drawn
from dslam_mav.dslam.problem import steadied
from dslam_mav.dslam.reduce import at_once
from dslam_mav.records import Estimate, Flight, Medium, Verdict
from missions.next_legs import Flown, Limits, Proposal, next_legs

Array = NDArray[np.float64]

DRAWS, RIVALS = 64, 14
FEWEST_LEGS = 3  # for the estimator
FIRST_GUESS_K = 3
SPREAD_AGAIN = 1.15  # √C may be this far off what was estimated
LEFT_SPREADS = 0.5  # less is no leg


@dataclass(frozen=True, slots=True)
class Assumed:
    """What is assumed of the sources: `medium` and `n_sources` as the estimator has them, and the prior that counts
    before it has an answer.
    """

    medium: Medium
    n_sources: int | None
    prior: Known


@dataclass(frozen=True, slots=True, eq=False)
class Advice:
    """Legs to come after the one under way, none where the flight may end; `estimate` of the legs so far, where there
    is one; `reached`: it is as sure as wanted.
    """

    turn_rad: tuple[float, ...]
    length_m: tuple[float, ...]
    expected_m: float
    estimate: Estimate | None
    reached: bool


class Adviser:
    """One flight's; `advise` after every leg, or before its end. `target_sd_m`: how sure every source is wanted."""

    def __init__(self, assumed: Assumed, *, target_sd_m: float | None = None, seed: int = 0) -> None:
        self._assumed = assumed
        self._target_sd_m = target_sd_m
        self._seed = seed
        self._rng = np.random.default_rng(seed)
        self._threads = ThreadpoolController()  # type: ignore[no-untyped-call]
        self._belief: Belief | None = None
        self._before: Proposal | None = None

    def warm_up(self) -> None:
        """Compile ahead what `dslam.warm` does not: the first advice must not wait for it."""
        known = self._assumed.prior
        layouts = drawn(Prior((1, 1), (1.0, 1.0), Region((0.0, 0.0), (1.0, 1.0))), 2, np.random.default_rng(0))[0]
        path = np.array([[[0.0, 0.0], [1.0, 0.0]]] * 2)
        limits = Limits(2.0, most_legs=1)
        next_legs(Flown(path, layouts), Sensing(1.0, 5.0, spread_unknown=known.spread_m[0] < known.spread_m[1]), limits,
                  np.random.default_rng(0))  # fmt: skip

    def advise(self, flight: Flight, limits: Limits, turn_rad: ArrayLike | None = None) -> Advice:
        """What to fly after the last leg of `flight`, whose readings may still be few.

        `turn_rad`: the turns between its legs as the vehicle was told to fly them, the first positive.
        """
        with self._threads.limit(limits=1, user_api="blas"):  # more are slower on matrices so small
            return self._advise(flight, limits, turn_rad)

    def _advise(self, flight: Flight, limits: Limits, turn_rad: ArrayLike | None) -> Advice:
        result = self._estimate(flight)
        if result is not None and self._reached(result):
            return Advice((), (), float(result.sd_m.max()), result, reached=True)
        known = self._known(result)
        if limits.length_m < LEFT_SPREADS * known.spread_m[0]:
            return Advice((), (), float("nan"), result, reached=False)
        usable = result if result is not None and np.isfinite(result.sources.position_m).all() else None
        seen = _as_seen(flight, self._assumed.medium if usable is None else usable.medium)
        self._belief = believed(seen, known, self._rng, self._belief, usable, turn_rad)
        draws = self._belief.part(DRAWS, self._rng)
        sensing = self._sensing(flight, self._belief)
        rivals = self._belief.rivals(RIVALS, self._rng)
        flown = Flown(draws.vertices_m, draws.layouts, Flown(rivals.vertices_m, rivals.layouts))
        proposal = next_legs(flown, sensing, limits, self._rng, self._before)
        self._before = replace(proposal, turn_rad=proposal.turn_rad[1:], length_m=proposal.length_m[1:])
        return Advice(proposal.turn_rad, proposal.length_m, float(np.exp(proposal.log_error)), usable, reached=False)

    def _estimate(self, flight: Flight) -> Estimate | None:
        if len(flight.legs) < FEWEST_LEGS:
            return None
        return estimate(flight, self._assumed.medium, self._assumed.n_sources, seed=self._seed)

    def _reached(self, result: Estimate) -> bool:
        """Whether every source is as sure as wanted, with no other answer that fits."""
        if self._target_sd_m is None or result.verdict is not Verdict.IDENTIFIED:
            return False
        return bool((result.sd_m <= self._target_sd_m).all())

    def _known(self, result: Estimate | None) -> Known:
        """The prior, sharpened by what the estimator says of the number of sources and the medium."""
        prior, medium = self._assumed.prior, self._assumed.medium
        if result is None:
            return prior
        spread_m = prior.spread_m
        if spread_m[0] < spread_m[1] and np.isfinite(result.spread_m):
            spread_m = (result.spread_m / SPREAD_AGAIN, result.spread_m * SPREAD_AGAIN)
        mu = result.medium.diffusivity_m2_s
        rate = prior.rate_m2_s if medium.static or mu is None else 4.0 * mu
        k = len(result.sources) if np.isfinite(result.sources.position_m).all() else prior.k_sources
        return replace(prior, k_sources=k, spread_m=spread_m, rate_m2_s=rate)

    def _sensing(self, flight: Flight, belief: Belief) -> Sensing:
        metres = sum(float(np.ptp(leg.distance_m)) for leg in flight.legs if leg.reading.size)
        seconds = flight.legs[-1].time_s[-1] - flight.legs[0].time_s[0]
        low, high = self._assumed.prior.spread_m
        return Sensing(
            belief.noise_sd,
            flight.n_readings / metres,
            speed_m_s=metres / max(float(seconds), 1e-9),
            ambient_unknown=self._assumed.medium.ambient is None,
            spread_unknown=low < high,
        )


def _as_seen(flight: Flight, medium: Medium) -> Flight:
    """The readings of a sensor that is fast at a level that is steady, as far as either is known to be otherwise."""
    return at_once(steadied(flight, medium.ambient_drift_per_s or 0.0), medium.sensor_lag_s or 0.0)


def canonical_box(vertices_m: Array) -> tuple[Array, Array]:
    """Lowest and highest corner (2,) of the box about a path (L+1, 2), in the gauge in which its first leg is +x."""
    points = to_canonical(vertices_m).apply(vertices_m)
    return points.min(axis=0), points.max(axis=0)
