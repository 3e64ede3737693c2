"""What a path sees: the error to expect of a source, wherever it might lie."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.expected import Sensing, place_errors
from dslam_mav.dslam.layouts import APART_SPREADS, Layouts, Prior, drawn

Array = NDArray[np.float64]

POOL = 400  # layouts of the other sources
OTHERS = 40  # of them beside a place
QUANTILE = 90
BLOCK = 64  # places at once


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """`error_m` (rows of `y_m`, columns of `x_m`): not exceeded by 90 % of flights; infinite where not seen."""

    x_m: Array
    y_m: Array
    error_m: Array


def sight(path: Array, prior: Prior, sensing: Sensing, axes: tuple[Array, Array], rng: np.random.Generator) -> Sight:
    """Of the path (L+1, 2), for a usual source at every place of the grid; the others lie anywhere in the prior's
    region, 0.8 √C from it and from one another. The number of sources is the prior's largest, two or more.
    """
    k = prior.k_sources[1]
    if k < 2:
        raise ValueError(f"prior.k_sources: expected 2 or more, got {k}")
    others = Prior((k - 1, k - 1), prior.spread_m, prior.region, prior.rate_m2_s, prior.peak)
    (pool,) = drawn(others, POOL, rng)
    x, y = axes
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    error = [_not_exceeded(path, layouts, sensing, rng) for layouts in _beside(places, pool, prior.peak)]
    return Sight(x, y, np.concatenate(error).reshape(len(y), len(x)))


def _beside(places: Array, pool: Layouts, peak: float) -> Iterator[Layouts]:
    """Every place (M, 2) with 40 layouts of others that keep their distance from it, in blocks."""
    gap = np.linalg.norm(pool.places[None] - places[:, None, None], axis=3).min(axis=2) / pool.spread_m
    near_last = np.argsort(gap < APART_SPREADS, axis=1, kind="stable")[:, :OTHERS]
    for i in range(0, len(places), BLOCK):
        chosen = near_last[i : i + BLOCK].ravel()
        own = np.repeat(places[i : i + BLOCK], OTHERS, axis=0)[:, None]
        yield Layouts(
            np.concatenate([own, pool.places[chosen]], axis=1),
            np.concatenate([np.full((len(own), 1), peak), pool.peak[chosen]], axis=1),
            pool.spread_m[chosen],
            pool.rate_m2_s[chosen],
        )


def _not_exceeded(path: Array, layouts: Layouts, sensing: Sensing, rng: np.random.Generator) -> Array:
    errors = place_errors(path, layouts, sensing, rng)[:, 0].reshape(len(layouts) // OTHERS, -1)
    return np.asarray(np.percentile(errors, QUANTILE, axis=1, method="higher"))
