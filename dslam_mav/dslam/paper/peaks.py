"""Every leg's peaks, with the spread known (III-A) or each source's own (IV-B), and what the legs lose."""

from __future__ import annotations

from collections.abc import Callable
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


class FlightPeaks(NamedTuple):
    """Peaks of every leg; the legs' noise (without units), how each was found, its condition; `repeat` for IV-B."""

    legs: list[LegPeaks]
    noise: float
    how: tuple[str, ...]
    condition: Array
    repeat: Callable[[Projections], Projections] | None = None

    def conditioning(self) -> dict[str, Any]:
        """What every leg multiplies its readings' noise with, and the digits the worst one loses of what they hold."""
        worst = float(self.condition.max())
        return {"per_leg": self.condition.tolist(), "worst": worst, "digits_lost": float(np.log10(max(worst, 1.0)))}


def count_sources(scene: Scenery, most: int, options: PaperOptions) -> int:
    """K by the legs' vote: Remark 4, or the separate groups of readings where spreads are unknown."""
    if scene.c_first is None:
        return count_groups(scene, most, options)
    return fri.count(_views(scene, options), most, options)


def peaks_of(scene: Scenery, medium: Medium, k: int, options: PaperOptions) -> FlightPeaks | Failure:
    """K peaks on every leg, or which leg has none."""
    if scene.c_first is None:
        return _separated(scene, medium, k, options)
    legs, how, condition = [], [], []
    views = _views(scene, options)
    for j, view in enumerate(views):
        found = fri.centres(view, k, options)
        if isinstance(found, str):
            return Failure(f"Leg {j + 1}: {found}")
        legs.append(_peaks(found, scene.c_first))
        how.append(found.how)
        condition.append(found.fit.condition)
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
        fri.view(s, y, float(length), float(c_j), options)
        for s, y, length, c_j in zip(scene.s, scene.reading, scene.length, c, strict=True)
    ]


def _peaks(found: fri.LegCentres, c_first: float) -> LegPeaks:
    g, k = found.fit.gaussians, len(found.fit.gaussians.y)
    own = np.arange(k)
    blocks = np.empty((k, 2, 2))
    for row, i in enumerate((own, own + k)):
        for column, j in enumerate((own, own + k)):
            blocks[:, row, column] = found.fit.covariance[i, j] * found.variance
    return LegPeaks(g.y, g.a, g.c, blocks, np.full(k, c_first), np.zeros(k))
