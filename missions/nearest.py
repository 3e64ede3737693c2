"""The plan to fly instead of one that sees badly: a star at the same place, about as long."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.expected import Sensing
from dslam_mav.dslam.layouts import Layouts
from dslam_mav.dslam.outlook import Outlook, outlook
from missions.fence import Fence
from missions.patterns import LONGEST_LEG_M, SHORTEST_LEG_M, centred, star
from missions.plan import FURTHEST_M

Array = NDArray[np.float64]

STARS = {"star5": (5, 2), "star7": (7, 3)}
ROUNDS = (1, 2, 3)
LONGER = (1.0, 1.5, 2.0, 3.0)
WORTH = 1.25  # times better: less is no reason to fly another plan


@dataclass(frozen=True, slots=True)
class Limits:
    """What any plan here has to keep: the fence and how far from it, turns at corners from … to, radians of 0 to π."""

    fence: Fence
    margin_m: float = 0.0
    turn_rad: tuple[float, float] = (0.0, math.pi)

    def keeps(self, path: Array, turn_rad: float) -> bool:
        """Whether a star (L+1, 2) of such turns may be flown."""
        near = float(np.linalg.norm(path, axis=1).max()) <= FURTHEST_M
        turns = self.turn_rad[0] <= turn_rad <= self.turn_rad[1]
        return near and turns and self.fence.lets_pass(path, self.margin_m)


ANYWHERE = Limits(Fence())


@dataclass(frozen=True, slots=True)
class Instead:
    """A named pattern, its legs, where its middle lies, and what it sees. Heading and middle are as a command has them:
    to a tenth of a degree and of a metre.
    """

    pattern: str
    leg_m: float
    legs: int
    first_heading_rad: float
    centre_m: tuple[float, float]
    climb_rad: float
    seen: Outlook


def nearest_that_sees(
    path: Array,
    seen: Outlook,
    groups: Sequence[Layouts],
    sensing: Sensing,
    centre_m: tuple[float, float],
    limits: Limits = ANYWHERE,
) -> Instead | None:
    """Of stars about `centre_m` that keep the limits, as long as the path (L+1, d) or, if need be, longer, the best of
    the shortest that sees well; failing that, the best of the shortest; None where that is not clearly better either,
    or no star keeps the limits.
    """
    middle = (round(centre_m[0], 1), round(centre_m[1], 1))
    fallback = None
    for longer in LONGER:
        best = min(
            _stars(path, longer, lambda flown: outlook(flown, groups, sensing), middle, limits),
            key=lambda one: (one.seen.source.median_m, one.seen.unidentifiable_share),
            default=None,
        )
        if best is not None and not best.seen.poor:
            return best
        fallback = fallback or best
    if fallback is None or not math.isfinite(fallback.seen.source.median_m):
        return None
    blinder = fallback.seen.unidentifiable_share > seen.unidentifiable_share
    return None if blinder or seen.source.median_m < WORTH * fallback.seen.source.median_m else fallback


def _stars(
    path: Array, longer: float, see: Callable[[Array], Outlook], centre_m: tuple[float, float], limits: Limits
) -> Iterator[Instead]:
    step = np.diff(path[:, :2], axis=0)
    length_m = longer * float(np.linalg.norm(step, axis=1).sum())
    heading = math.radians(round(math.degrees(math.atan2(step[0, 1], step[0, 0])), 1))
    for name, (n, k) in STARS.items():
        for rounds in ROUNDS:
            leg_m, legs = float(f"{length_m / (n * rounds):.3g}"), n * rounds
            if not SHORTEST_LEG_M <= leg_m <= LONGEST_LEG_M:
                continue
            flown = centred(star(n, k, leg_m, legs, heading), centre_m)
            if not limits.keeps(flown, 2.0 * math.pi * k / n):
                continue
            climb = math.atan2(float(np.ptp(path[:, 2])), leg_m) if path.shape[1] == 3 else 0.0
            if path.shape[1] == 3:
                flown = climbing(flown, path)
            yield Instead(name, leg_m, legs, heading, centre_m, climb, see(flown))


def climbing(flat: Array, path: Array) -> Array:
    """The flat path (L+1, 2) going up and down between the lowest and the highest of `path` (V, 3)."""
    up = np.arange(len(flat)) % 2
    height = path[:, 2].min() + up * np.ptp(path[:, 2])
    return np.column_stack([flat, height])
