"""What a person knows of the sources before take-off, and random layouts drawn from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.path import vertices
from dslam_mav.records.words import count

Array = NDArray[np.float64]

APART_SPREADS = 0.8
AMPLITUDE_RATIO = 4.0
TRIES = 200  # of a whole layout
STAR_TURN = 2.0 * np.pi * 3.0 / 7.0
STAR_POINTS = 32  # a leg


@dataclass(frozen=True, slots=True)
class Region:
    """Where sources may be: between `low` and `high` (d,) and `inside`: (n, 2) places on the ground -> (n,) whether."""

    low: tuple[float, ...]
    high: tuple[float, ...]
    inside: Callable[[Array], NDArray[np.bool_]] | None = None

    @property
    def middle(self) -> Array:
        """(d,)."""
        return np.asarray(0.5 * (np.asarray(self.low) + np.asarray(self.high)), dtype=np.float64)

    @property
    def extent(self) -> Array:
        """(d,) lengths."""
        return np.asarray(np.subtract(self.high, self.low), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Prior:
    """`k_sources` from … to, anywhere in `region`, at least `apart_m` apart (None: 0.8 √C); √C at the flight's start
    from … to, uniform in its logarithm; `rate_m2_s` = 4μ where the field evolves, 0 where it stands still. Peak
    readings then lie within a factor `ratio` about `peak`.
    """

    k_sources: tuple[int, int]
    spread_m: tuple[float, float]
    region: Region
    rate_m2_s: float = 0.0
    peak: float = 1.0
    apart_m: float | None = None
    ratio: float = AMPLITUDE_RATIO

    @property
    def usual_spread_m(self) -> float:
        """In the middle of the range."""
        return float(np.sqrt(self.spread_m[0] * self.spread_m[1]))


@dataclass(frozen=True, slots=True, eq=False)
class Layouts:
    """M layouts of K sources: `places` (M, K, d), `peak` (M, K), `spread_m` (M,), `rate_m2_s` (M,)."""

    places: Array
    peak: Array
    spread_m: Array
    rate_m2_s: Array

    def __len__(self) -> int:
        return len(self.places)

    def part(self, first: int, last: int) -> Layouts:
        """Some of them."""
        return self.chosen(slice(first, last))

    def chosen(self, which: slice | NDArray[np.int64]) -> Layouts:
        """Some of them, maybe several times."""
        return Layouts(self.places[which], self.peak[which], self.spread_m[which], self.rate_m2_s[which])

    @property
    def k_sources(self) -> int:
        """K."""
        return int(self.places.shape[1])


def joined(parts: Sequence[Layouts]) -> Layouts:
    """Some layouts, then others of as many sources."""
    return Layouts(
        np.concatenate([p.places for p in parts]),
        np.concatenate([p.peak for p in parts]),
        np.concatenate([p.spread_m for p in parts]),
        np.concatenate([p.rate_m2_s for p in parts]),
    )


def drawn(prior: Prior, count: int, rng: np.random.Generator) -> list[Layouts]:
    """`count` layouts, as many of each number of sources as can be; a ValueError where they do not fit the region."""
    low, high = prior.k_sources
    groups = []
    for k, share in zip(range(low, high + 1), _shares(count, high - low + 1), strict=True):
        if share:
            groups.append(_of_k(prior, k, share, rng))
    return groups


def _shares(count: int, parts: int) -> list[int]:
    return [count // parts + (i < count % parts) for i in range(parts)]


def _of_k(prior: Prior, k: int, count: int, rng: np.random.Generator) -> Layouts:
    logs = np.log(prior.spread_m)
    spread = np.exp(logs[0] + (logs[1] - logs[0]) * rng.random(count))
    peak = prior.peak * prior.ratio ** (rng.random((count, k)) - 0.5)
    apart = APART_SPREADS * spread if prior.apart_m is None else np.full(count, prior.apart_m)
    places = np.array([_placed(prior.region, k, own, rng) for own in apart])
    return Layouts(places, peak, spread, np.full(count, prior.rate_m2_s))


def _placed(region: Region, k: int, apart_m: float, rng: np.random.Generator) -> Array:
    """(K, d) places; the whole layout anew where two are too near, so that none is more likely than another."""
    low, size = np.asarray(region.low), region.extent
    for _ in range(TRIES):
        places = np.empty((0, low.size))
        for _ in range(TRIES):
            more = low + size * rng.random((2 * k, low.size))
            places = np.vstack([places, more if region.inside is None else more[region.inside(more[:, :2])]])
            if len(places) >= k:
                break
        places = places[:k]
        gaps = np.linalg.norm(places[:, None] - places[None], axis=2) + np.diag(np.full(len(places), np.inf))
        if len(places) == k and gaps.min() >= apart_m:
            return places
    wide = " × ".join(f"{side:.3g}" for side in size)
    raise ValueError(f"{count(k, 'source')} {apart_m:.3g} m apart do not fit into {wide} m")


def noise_below(groups: Sequence[Layouts], region: Region, snr_db: float) -> float:
    """The noise that lies so far below the mean squared reading on a star {7/3} that fills the region.

    The star is only a yardstick: missions compare fairly if the sensor's noise does not depend on which is flown.
    """
    star = vertices(STAR_TURN * np.arange(7, dtype=np.float64), np.ones(7))
    star = (star - star.min(axis=0)) / np.ptp(star, axis=0)
    u = (np.arange(STAR_POINTS) + 0.5) / STAR_POINTS
    points = (star[:-1, None] + u[None, :, None] * np.diff(star, axis=0)[:, None]).reshape(-1, 2)
    points = np.asarray(region.low)[:2] + points * region.extent[:2]
    if region.middle.size == 3:
        points = np.column_stack([points, np.full(len(points), region.middle[2])])
    total = 0.0
    for group in groups:
        far2 = ((points[None, :, None] - group.places[:, None]) ** 2).sum(axis=3) / group.spread_m[:, None, None] ** 2
        total += float(((group.peak[:, None] * np.exp(-far2)).sum(axis=2) ** 2).mean(axis=1).sum())
    return float(np.sqrt(total / sum(len(g) for g in groups)) * 10.0 ** (-snr_db / 20.0))
