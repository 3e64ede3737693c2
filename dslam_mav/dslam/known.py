"""What is known before any reading, and before a leg's turn is flown, as chains of `belief` have it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.descent import Chains, Seen
from dslam_mav.dslam.layouts import AMPLITUDE_RATIO, APART_SPREADS, Prior, Region, drawn

Array = NDArray[np.float64]

LEVEL_LOG_SD = 0.5  # of all peaks together
PEAK_LOG_SD = math.hypot(LEVEL_LOG_SD, math.log(AMPLITUDE_RATIO) / math.sqrt(12.0))
PLACE_SD_EXTENTS = 1.0 / math.sqrt(12.0)
TURN_SD_RAD, STRAY = math.radians(10.0), 4.0
BEYOND_EXTENTS, CLOSER_SPREADS, UNEQUAL_LOG = 0.05, 0.1, 0.2
"""How far beyond the region, nearer to each other and less equal than the prior allows sources may still be."""
SURE = 1e-4


@dataclass(frozen=True, slots=True)
class Known:
    """What is known besides readings: how many sources, in which region (canonical gauge), √C from … to at the first
    reading, its rate 4μ where the field evolves, and the ambient level (None: unknown).
    """

    k_sources: int
    region: Region
    spread_m: tuple[float, float]
    rate_m2_s: float = 0.0
    ambient: float | None = 0.0


def anchors(seen: Seen, known: Known, count: int, rng: np.random.Generator) -> Chains:
    """A draw from the prior for every chain."""
    region = Region(known.region.low[:2], known.region.high[:2])
    prior = Prior((known.k_sources, known.k_sources), known.spread_m, region)
    try:
        some = drawn(prior, count, rng)[0]
    except ValueError:  # too little room to keep apart
        some = drawn(replace(prior, apart_m=0.0), count, rng)[0]
    level, peak = _level(seen, known)
    height = math.log(peak) + LEVEL_LOG_SD * rng.standard_normal((count, 1))
    return Chains(
        np.zeros((count, 1)), some.places, height + np.log(some.peak), 2.0 * np.log(some.spread_m),
        np.full(count, level),
    )  # fmt: skip


def plausibility(chains: Chains, known: Known, told: Array) -> Array:
    """(M,) ln of how well the sources keep to the prior, of which the chains' anchors are only an echo, and the turns
    to those told.
    """
    low, high = (np.asarray(corner)[:2] for corner in (known.region.low, known.region.high))
    beyond = np.maximum(np.maximum(low - chains.place, chains.place - high), 0.0) / (BEYOND_EXTENTS * (high - low))
    first, second = np.triu_indices(known.k_sources, 1)
    gap = np.linalg.norm(chains.place[:, first] - chains.place[:, second], axis=2)
    spread = np.exp(0.5 * chains.log_spread2)[:, None]
    closer = np.maximum(APART_SPREADS - gap / spread, 0.0) / CLOSER_SPREADS
    unequal = np.maximum(np.ptp(chains.log_peak, axis=1) - math.log(AMPLITUDE_RATIO), 0.0) / UNEQUAL_LOG
    bent = off_turn(np.diff(chains.theta, axis=1)[:, : told.size], told)
    off2 = (beyond**2).sum(axis=(1, 2)) + (closer**2).sum(axis=1) + unequal**2 + (bent**2).sum(axis=1)
    return np.asarray(-0.5 * off2)


def off_turn(turn: Array, told: Array) -> Array:
    """In standard deviations; further off than `STRAY` says no more."""
    off = np.remainder(turn - told + math.pi, 2.0 * math.pi) - math.pi
    return np.asarray(np.clip(off / TURN_SD_RAD, -STRAY, STRAY))


def middle(seen: Seen, known: Known, like: Chains) -> Chains:
    """The prior's middle, as often as there are chains."""
    level, peak = _level(seen, known)
    return Chains(
        like.theta,
        np.broadcast_to(known.region.middle[:2], like.place.shape).copy(),
        np.full_like(like.log_peak, math.log(peak)),
        np.full_like(like.log_spread2, float(np.log(known.spread_m).sum())),
        np.full_like(like.ambient, level),
    )


def _level(seen: Seen, known: Known) -> tuple[float, float]:
    """Ambient level and the peak to expect of a source."""
    level = float(seen.reading.min()) if known.ambient is None else known.ambient
    return level, max(float(np.abs(seen.reading - level).max()), 3.0 * seen.noise_sd)


def precision(seen: Seen, known: Known) -> Array:
    """(P,) how surely each unknown is known before: one over its standard deviation."""
    k, headings = known.k_sources, seen.length.size - 1
    wide = PLACE_SD_EXTENTS * known.region.extent[:2]
    low, high = np.log(known.spread_m)
    spread = max(2.0 * (high - low) / math.sqrt(12.0), SURE)
    ambient = SURE * seen.noise_sd if known.ambient is not None else float(np.ptp(seen.reading)) + seen.noise_sd
    return np.concatenate(
        [np.zeros(headings), np.tile(1.0 / wide, k), np.full(k, 1.0 / PEAK_LOG_SD), [1.0 / spread, 1.0 / ambient]]
    )
