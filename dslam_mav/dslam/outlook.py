"""What a mission can be expected to see, summed up over layouts, and why one sees badly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.expected import Sensing, errors_flown, joined
from dslam_mav.dslam.layouts import Layouts
from dslam_mav.records.words import count

Array = NDArray[np.float64]

LAYOUTS = 200
POOR_SPREADS = 0.3  # of √C: half of all layouts worse than this is poor
POOR_SHARE = 0.05
BLIND_SHARE = 0.5
FEWEST_LEGS = 4
SAME_AXIS_RAD = math.radians(15.0)
SEEN_SPREADS = 1.5  # from a leg on which a source stands out: e^-2.25, a tenth of its peak
OUT_OF_REACH_SHARE = 0.2
SEEN_FROM = 2.5  # legs, in the mean


@dataclass(frozen=True, slots=True)
class Range:
    """Median and 90 % over layouts or flights, in metres; infinite where there is no answer to so many."""

    median_m: float
    p90_m: float

    @classmethod
    def of(cls, values: Array) -> Range:
        """Of the values themselves: none is made up between an answer and none."""
        return cls(float(np.percentile(values, 50, method="higher")), float(np.percentile(values, 90, method="higher")))


@dataclass(frozen=True, slots=True)
class Outlook:
    """Errors to expect of sources and path, RMS over either: relative to the first leg and (`aligned`) to the whole
    path; the share of layouts that cannot be identified; and the spread to measure them by.
    """

    source: Range
    source_aligned: Range
    path: Range
    path_aligned: Range
    unidentifiable_share: float
    spread_m: float

    @property
    def blind(self) -> bool:
        """Whether most layouts cannot be told."""
        return self.unidentifiable_share > BLIND_SHARE

    @property
    def poor(self) -> bool:
        """Whether a pilot should be warned."""
        return self.unidentifiable_share > POOR_SHARE or not self.source.median_m <= POOR_SPREADS * self.spread_m


def outlook(path: Array, groups: Sequence[Layouts], sensing: Sensing) -> Outlook:
    """What flights on the path (L+1, d) may come to, by the bound, over layouts of maybe different numbers of sources.

    The same draws for every path, so that paths compare.
    """
    rng = np.random.default_rng(0)
    errors = joined([errors_flown(path, group, sensing, rng) for group in groups])
    return Outlook(
        Range.of(errors.source),
        Range.of(errors.source_aligned),
        Range.of(errors.path),
        Range.of(errors.path_aligned),
        float(errors.blind.mean()),
        float(np.exp(np.concatenate([np.log(group.spread_m) for group in groups]).mean())),
    )


def reason(path: Array, groups: Sequence[Layouts], sensing: Sensing) -> str:
    """Why the path (L+1, d) sees these layouts badly: the first that applies, as half a sentence."""
    n_legs = len(path) - 1
    compass = sensing.heading_sd_rad is not None
    if groups[0].k_sources == 1 and len(groups) == 1 and not compass:
        return "a single source leaves every leg free to turn about it, unless a compass (--heading-sd) holds it"
    if n_legs < FEWEST_LEGS:
        legs = "a single leg" if n_legs == 1 else f"{n_legs} legs"
        return f"it has {legs}, and directions come out only where 4 or more cross the sources"
    gap = np.concatenate([_gaps(path, group).reshape(-1, n_legs) for group in groups])
    unreached = float((gap.min(axis=1) > SEEN_SPREADS).mean())
    if unreached > OUT_OF_REACH_SHARE:
        return f"{100.0 * unreached:.0f} % of sources would lie more than {SEEN_SPREADS:g} √C from every leg"
    axes = n_axes(path)
    if axes < 3 and not compass:
        return f"its legs run along {count(axes, 'direction')} only, and parallel legs cannot be placed"
    seen = float((gap < SEEN_SPREADS).sum(axis=1).mean())
    if seen < SEEN_FROM:
        return f"a source stands out on {seen:.1f} of its legs in the mean, and on fewer than 3 it cannot be placed"
    return "its readings are too few or too noisy for so many unknowns"


def n_axes(path: Array) -> int:
    """Directions its legs run along, there and back the same, 15° apart or more."""
    step = np.diff(path, axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    kept: list[float] = []
    for own in heading:
        if all(abs(math.sin(own - other)) > math.sin(SAME_AXIS_RAD) for other in kept):
            kept.append(float(own))
    return len(kept)


def _gaps(path: Array, group: Layouts) -> Array:
    """(M, K, L) distance of every source from every leg, in spreads."""
    a, step = path[:-1], np.diff(path, axis=0)
    off = group.places[:, :, None] - a
    share = np.clip((off * step).sum(axis=3) / (step**2).sum(axis=1), 0.0, 1.0)
    gap = np.linalg.norm(off - share[..., None] * step, axis=3)
    return np.asarray(gap / group.spread_m[:, None, None])
