"""Every leg's peaks, with the spread known (III-A) or each source's own (IV-B), and what the legs lose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.paper import fri
from dslam_mav.dslam.paper.layout import Failure, Projections
from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.dslam.paper.pairing import LegPeaks
from dslam_mav.dslam.paper.scenery import Scenery
from dslam_mav.dslam.paper.separated import count_groups, pool_and_repeat, separated_peaks
from dslam_mav.records import Medium

Array = NDArray[np.float64]

MOST_DIGITS = 16.0  # a reading has


class FlightPeaks(NamedTuple):
    """Peaks of every leg; the legs' noise (without units), how each was found, its condition; `repeat` for IV-B."""

    legs: list[LegPeaks]
    noise: float
    how: tuple[str, ...]
    condition: Array
    repeat: Callable[[Projections], Projections] | None = None

    @property
    def quiet(self) -> bool:
        """Whether the readings are free of noise."""
        return self.noise < fri.FREE_OF_NOISE

    def conditioning(self) -> dict[str, Any]:
        """What every leg multiplies its readings' noise with, and the digits the worst one loses of what they hold."""
        worst = float(self.condition.max())
        lost = min(float(np.log10(max(worst, 1.0))), MOST_DIGITS)
        return {"per_leg": self.condition.tolist(), "worst": worst, "digits_lost": lost}


def count_sources(scene: Scenery, most: int, options: PaperOptions) -> list[int]:
    """Numbers of sources to try: Remark 4, or the separate groups of readings where spreads are unknown."""
    if scene.c_first is None:
        return [count_groups(scene, most, options)]
    return fri.counts(_views(scene, options), most, options if scene.still else replace(options, polish=False))


def peaks_of(scene: Scenery, medium: Medium, k: int, options: PaperOptions) -> FlightPeaks | Failure:
    """K peaks on every leg, or which leg has none."""
    if scene.c_first is None:
        return _separated(scene, medium, k, options)
    views = _views(scene, options)
    # a field that evolves on a leg is no sum of Gaussians to rounding
    own = options if scene.still else replace(options, polish=False)
    found = [fri.centres(view, k, own) for view in views]
    exact = any(not isinstance(one, str) and one.how == "logarithms" for one in found)
    legs, how, condition = [], [], []
    for j, one in enumerate(found):
        if isinstance(one, str):
            if not exact:
                return Failure(f"Leg {j + 1}: {one}")
            legs.append(_unknown(views[j], k, scene.c_first))
            how.append("none")
            condition.append(np.inf)
            continue
        legs.append(_peaks(one, scene.c_first))
        how.append(one.how)
        condition.append(one.fit.condition)
    noise = np.array([v.noise for v in views])
    level = float(np.sqrt(np.mean(noise[np.isfinite(noise)] ** 2))) if np.isfinite(noise).any() else 0.0
    return FlightPeaks(legs, level, tuple(how), np.array(condition))


def _separated(scene: Scenery, medium: Medium, k: int, options: PaperOptions) -> FlightPeaks | Failure:
    found = separated_peaks(scene, k, options)
    if isinstance(found, Failure):
        return found
    common = medium.activation_s == "shared" or (medium.static and medium.diffusivity_m2_s is None)
    return FlightPeaks(
        legs=found.legs,
        noise=found.noise,
        how=("separated",) * len(found.legs),
        condition=found.condition,
        repeat=lambda p: pool_and_repeat(scene, p, common),
    )


def _views(scene: Scenery, options: PaperOptions) -> list[fri.LegView]:
    assert scene.c_first is not None
    c = scene.c_first + scene.growth_mid  # C_j, IV-A
    return [
        fri.view(s, y, float(length), float(c_j), options, scene.offset)
        for s, y, length, c_j in zip(scene.s, scene.reading, scene.length, c, strict=True)
    ]


def _unknown(view: fri.LegView, k: int, c_first: float) -> LegPeaks:
    """Centres anywhere, for a leg that other legs may do without."""
    y = np.linspace(*view.reach.ends, k + 2)[1:-1]
    wide = np.tile(np.eye(2), (k, 1, 1)) * view.c * 100.0
    return LegPeaks(y, np.full(k, view.largest or 1.0), np.full(k, view.c), wide, np.full(k, c_first), np.zeros(k))


def _peaks(found: fri.LegCentres, c_first: float) -> LegPeaks:
    g, k = found.fit.gaussians, len(found.fit.gaussians.y)
    own = np.arange(k)
    blocks = np.empty((k, 2, 2))
    for row, i in enumerate((own, own + k)):
        for column, j in enumerate((own, own + k)):
            blocks[:, row, column] = found.fit.covariance[i, j] * found.variance
    return LegPeaks(g.y, g.a, g.c, blocks, np.full(k, c_first), np.zeros(k))
