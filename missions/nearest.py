"""The plan to fly instead of one that sees badly: a star at the same place, about as long."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.expected import Sensing
from dslam_mav.dslam.layouts import Layouts
from dslam_mav.dslam.outlook import Outlook, outlook
from missions.patterns import centred, star

Array = NDArray[np.float64]

STARS = {"star5": (5, 2), "star7": (7, 3)}
ROUNDS = (1, 2, 3)
LONGER = (1.0, 1.5, 2.0, 3.0)
WORTH = 1.25  # times better: less is no reason to fly another plan


@dataclass(frozen=True, slots=True)
class Instead:
    """A named pattern, its legs, where its middle lies, and what it sees."""

    pattern: str
    leg_m: float
    legs: int
    first_heading_rad: float
    centre_m: tuple[float, float]
    climb_rad: float
    seen: Outlook


def nearest_that_sees(
    path: Array, seen: Outlook, groups: Sequence[Layouts], sensing: Sensing, centre_m: tuple[float, float]
) -> Instead | None:
    """Of stars about `centre_m`, as long as the path (L+1, d) or, if need be, longer, the best of the shortest that
    sees well; failing that, the best as long as the path; None where that is not clearly better either.
    """
    fallback = None
    for longer in LONGER:
        best = min(
            _stars(path, longer, groups, sensing, centre_m),
            key=lambda one: (one.seen.source.median_m, one.seen.unidentifiable_share),
        )
        if not best.seen.poor:
            return best
        fallback = fallback or best
    assert fallback is not None
    if not math.isfinite(fallback.seen.source.median_m):
        return None
    blinder = fallback.seen.unidentifiable_share > seen.unidentifiable_share
    return None if blinder or seen.source.median_m < WORTH * fallback.seen.source.median_m else fallback


def _stars(
    path: Array, longer: float, groups: Sequence[Layouts], sensing: Sensing, centre_m: tuple[float, float]
) -> Iterator[Instead]:
    step = np.diff(path[:, :2], axis=0)
    length_m = longer * float(np.linalg.norm(step, axis=1).sum())
    heading = float(math.atan2(step[0, 1], step[0, 0]))
    for name, (n, k) in STARS.items():
        for rounds in ROUNDS:
            leg_m, legs = float(f"{length_m / (n * rounds):.3g}"), n * rounds
            flown = centred(star(n, k, leg_m, legs, heading), centre_m)
            climb = math.atan2(float(np.ptp(path[:, 2])), leg_m) if path.shape[1] == 3 else 0.0
            if path.shape[1] == 3:
                flown = climbing(flown, path)
            yield Instead(name, leg_m, legs, heading, centre_m, climb, outlook(flown, groups, sensing))


def climbing(flat: Array, path: Array) -> Array:
    """The flat path (L+1, 2) going up and down between the lowest and the highest of `path` (V, 3)."""
    up = np.arange(len(flat)) % 2
    height = path[:, 2].min() + up * np.ptp(path[:, 2])
    return np.column_stack([flat, height])
