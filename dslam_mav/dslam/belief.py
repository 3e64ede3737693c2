"""What may be true after the legs flown so far: paths and layouts of sources, drawn from all that fit the readings.

Many chains each lean on a draw of their own from the prior and on readings with noise of their own added, and slide
down to where both agree; where the model is linear that draws from the posterior exactly. A chain counts as much as the
answer it slides to from there without that noise fits. Unlike the estimate this has an answer from the first leg on,
and it sees the alternatives while they still can be told apart. Canonical gauge; headings are unknown throughout.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dslam_mav.dslam.descent import Chains, Pull, Seen, cost_ahead, cost_of, descended
from dslam_mav.dslam.known import Known, anchors, middle, off_turn, plausibility, precision
from dslam_mav.dslam.layouts import Layouts
from dslam_mav.records import Estimate, Flight

Array = NDArray[np.float64]

CHAINS = 160
FROM_PRIOR = 0.25  # of the chains begin anew at every leg
FROM_MODES = 0.35  # begin at what the estimator has found
SCANNED = 48  # headings of a leg more
POINTS_PER_SPREAD = 5.0
SLIDE, SETTLE = 24, 10  # iterations with a draw's own noise, and without
EVIDENCE_TEMPERATURE = 2.0  # likelihoods of local answers are trusted to half their logarithm
QUIETEST = 1e-3  # of the readings' range


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """M draws: `vertices_m` (M, L+1, 2) of the legs flown, `layouts` of M, `weight` (M,) that sum to 1; `by_readings`
    (M,) as well, by them alone: the estimator knows nothing of region, peaks and turns told.
    """

    vertices_m: Array
    layouts: Layouts
    weight: Array
    by_readings: Array
    chains: Chains
    noise_sd: float

    def part(self, count: int, rng: np.random.Generator) -> Belief:
        """`count` of them, drawn evenly by weight, which then are alike."""
        return self._some(count, self.weight, rng)

    def rivals(self, count: int, rng: np.random.Generator) -> Belief:
        """`count` of them, drawn by what the readings say: what the estimator may take for true."""
        return self._some(count, self.by_readings, rng)

    def _some(self, count: int, weight: Array, rng: np.random.Generator) -> Belief:
        at = (np.arange(count) + rng.random()) / count
        index = np.minimum(np.searchsorted(np.cumsum(weight), at), len(weight) - 1)
        even = np.full(count, 1.0 / count)
        some = self.layouts.chosen(index)
        return Belief(self.vertices_m[index], some, even, even, self.chains.part(index), self.noise_sd)


def believed(
    flight: Flight,
    known: Known,
    rng: np.random.Generator,
    before: Belief | None = None,
    estimate: Estimate | None = None,
    turn_rad: ArrayLike | None = None,
) -> Belief:
    """What may be true after a flight of straight legs; `before`: what was believed some legs ago, `estimate`: of the
    same legs, `turn_rad` (L−1,): the turns between them as the vehicle was told to fly them, the first positive.
    """
    told = np.asarray(() if turn_rad is None else turn_rad, dtype=np.float64)
    seen = seen_of(flight, known)
    anchor = anchors(seen, known, CHAINS, rng)
    starts = _starts(_Begin(seen, told, rng), anchor, before, estimate)
    anchor = replace(anchor, theta=starts.theta)
    sure = precision(seen, known)
    pull = Pull(anchor.vector(), sure, rng.standard_normal((len(anchor), seen.reading.size)))
    held = descended(starts, seen, pull, SLIDE).upright()
    calm = Pull(middle(seen, known, anchor).vector(), sure, np.zeros_like(pull.noise))
    settled = descended(held, seen, calm, SETTLE).upright()
    evidence = -0.5 * cost_of(settled, seen, calm) / EVIDENCE_TEMPERATURE
    known_too = plausibility(held, known, told)
    layouts = Layouts(
        held.place, np.exp(held.log_peak), np.exp(0.5 * held.log_spread2), np.full(len(held), known.rate_m2_s)
    )
    return Belief(
        held.vertices(seen.length), layouts, _shares(evidence + known_too), _shares(evidence), held, seen.noise_sd
    )


def _shares(evidence: Array) -> Array:
    weight = np.exp(evidence - evidence.max())
    return np.asarray(weight / weight.sum())


def seen_of(flight: Flight, known: Known) -> Seen:
    """The readings, those that lie closer than a Gaussian needs averaged."""
    low, high = known.spread_m
    step = math.sqrt(low * high) / POINTS_PER_SPREAD
    first = float(flight.legs[0].time_s[0])
    rows = []
    for j, leg in enumerate(flight.legs):
        if not leg.reading.size:
            continue
        _, cell = np.unique(np.floor(leg.distance_m / step), return_inverse=True)
        count = np.bincount(cell)
        mean = [np.bincount(cell, v) / count for v in (leg.distance_m, leg.time_s - first, leg.reading)]
        rows.append(np.column_stack([np.full(count.size, j), *mean, count]))
    table = np.vstack(rows)
    noise_sd = noise_of(flight)
    return Seen(
        np.array([leg.length_m for leg in flight.legs]), table[:, 0].astype(np.int64), table[:, 1], table[:, 3],
        np.sqrt(table[:, 4]) / noise_sd, known.rate_m2_s * table[:, 2], noise_sd,
    )  # fmt: skip


def noise_of(flight: Flight) -> float:
    """Noise of a reading, by third differences: a smooth field leaves nothing in them."""
    differences = np.concatenate(
        [np.diff(leg.reading, 3) for leg in flight.legs if leg.reading.size > 3] or [np.zeros(1)]
    )
    whole = np.concatenate([leg.reading for leg in flight.legs])
    rough = 1.4826 * float(np.median(np.abs(differences))) / math.sqrt(20.0)
    return max(rough, QUIETEST * float(np.ptp(whole)), 1e-12)


@dataclass(frozen=True, slots=True, eq=False)
class _Begin:
    """What every chain that begins goes by."""

    seen: Seen
    told: Array
    rng: np.random.Generator


def _starts(begin: _Begin, anchor: Chains, before: Belief | None, estimate: Estimate | None) -> Chains:
    """Where chains begin: at draws from the prior, at those of some legs ago, at what the estimator found."""
    parts, left = [], CHAINS
    modes = [] if estimate is None else [m for m in (estimate, *estimate.alternatives) if _usable(m, anchor)]
    if modes:
        count = round(CHAINS * (FROM_MODES if before is not None else 1.0 - FROM_PRIOR))
        parts.append(_at_modes(modes, anchor.part(np.arange(count))))
        left -= count
    if before is not None and before.layouts.k_sources == anchor.place.shape[1]:
        count = left - round(FROM_PRIOR * CHAINS)
        parts.append(before.part(count, begin.rng).chains)
        left -= count
    parts.append(anchor.part(np.arange(CHAINS - left, CHAINS)))
    return _of_all([_longer(part, begin) for part in parts])


def _usable(mode: Estimate, anchor: Chains) -> bool:
    return len(mode.sources) == anchor.place.shape[1] and bool(np.isfinite(mode.sources.position_m).all())


def _at_modes(modes: list[Estimate], like: Chains) -> Chains:
    """The modes in turn."""
    place, peak, theta, spread = like.place.copy(), like.log_peak.copy(), [], like.log_spread2.copy()
    for i in range(len(like)):
        mode = modes[i % len(modes)]
        place[i] = mode.sources.position_m
        peak[i] = np.log(np.maximum(mode.sources.peak_reading, 1e-12))
        spread[i] = 2.0 * math.log(mode.spread_m) if math.isfinite(mode.spread_m) else spread[i]
        theta.append(mode.path.heading_rad)
    return replace(like, place=place, log_peak=peak, theta=np.array(theta), log_spread2=spread)


def _longer(chains: Chains, begin: _Begin) -> Chains:
    """With headings for the legs flown since, drawn by how the readings fit each; cut where there are fewer legs."""
    seen, n_legs = begin.seen, begin.seen.length.size
    theta = chains.theta[:, :n_legs]
    while (leg := theta.shape[1]) < n_legs:
        around = math.pi if leg == 1 else 2.0 * math.pi  # the first turn is to +y
        tried = np.asarray((begin.rng.random() + np.arange(SCANNED)) * (around / SCANNED), dtype=np.float64)
        corner = replace(chains, theta=theta).vertices(seen.length[:leg])[:, -1]
        cost = cost_ahead(chains, corner, tried, seen.only(leg))
        if begin.told.size:
            cost += off_turn(tried - theta[:, -1:], begin.told[leg - 1]) ** 2
        lucky = begin.rng.gumbel(size=cost.shape) - 0.5 * cost
        theta = np.column_stack([theta, tried[lucky.argmax(axis=1)]])
    return replace(chains, theta=theta)


def _of_all(parts: list[Chains]) -> Chains:
    return Chains(
        *(
            np.concatenate([getattr(p, n) for p in parts])
            for n in ("theta", "place", "log_peak", "log_spread2", "ambient")
        )
    )
