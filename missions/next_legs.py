"""The legs to fly next: turns and lengths relative to the leg just flown that leave the least error to expect.

Without GPS nothing but the turn from the leg just flown means the same to the estimator and to the vehicle. Minimised
is the mean logarithm of the sources' RMS error by the bound (theory, section 9) over what may be true after the legs
flown so far: every draw goes on from where it believes to be. Draws far apart make the legs that come serve all of
them, and so tell them apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from dslam_mav.dslam.expected import Sensing, log_errors
from dslam_mav.dslam.layouts import Layouts
from missions.course import beyond, chained
from missions.fence import Fence

Array = NDArray[np.float64]

USUAL_LEG_SPREADS = 4.48
USUAL_TURN_RAD = math.radians(146.0)
TURN_OFF_RAD = math.radians(4.0)
POINTS_PER_SPREAD = 5.0
TRIED, DESCENDED = 40, 4
ITERATIONS = 25
NO_FENCE = Fence()
FENCE_WEIGHT = 300.0
SHARES = (-1.2, 1.2)  # of a leg's length, in logarithms about the usual


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """What may be true: `vertices_m` (M, L+1, 2) of the legs flown, and the sources of each."""

    vertices_m: Array
    layouts: Layouts


@dataclass(frozen=True, slots=True)
class Limits:
    """Length left to fly, turns from … to (radians, 0 to π), shortest leg, most legs; the fence, seen from where the
    leg just flown ends, with that leg along +x and the side of the flight's first turn at +y.
    """

    length_m: float
    turn_rad: tuple[float, float] = (0.0, math.pi)
    least_leg_m: float = 0.1
    most_legs: int = 12
    fence: Fence = NO_FENCE


@dataclass(frozen=True, slots=True)
class Proposal:
    """Legs to come: `turn_rad` at the beginning of each, positive to the side of the flight's first turn, `length_m`;
    `log_error` is the mean ln of the error to expect after them.
    """

    turn_rad: tuple[float, ...]
    length_m: tuple[float, ...]
    log_error: float


@dataclass(frozen=True, slots=True, eq=False)
class _Ahead:
    """The objective, by turns and logarithms of the legs' shares."""

    flown: Flown
    sensing: Sensing
    limits: Limits
    off: Array  # (M, legs at most)

    def __call__(self, x: Array, gradient: bool = True) -> tuple[float, Array]:
        n = x.size // 2
        done = self.flown.vertices_m
        last = done[:, -1] - done[:, -2]
        theta = np.arctan2(last[:, 1], last[:, 0])[:, None] + np.cumsum(x[:n] + self.off[:, :n], axis=1)
        along = np.stack([np.cos(theta), np.sin(theta)], axis=2)
        share = np.exp(x[n:] - x[n:].max())
        share /= share.sum()
        lengths = self.limits.length_m * share
        to_come = done[:, -1:] + np.cumsum(lengths[:, None] * along, axis=1)
        path = np.concatenate([done, to_come], axis=1)
        value, moves = log_errors(path, self.flown.layouts, self.sensing, POINTS_PER_SPREAD, gradient)
        outside, by_outside = self._outside(x)
        total = float(value.mean()) + outside
        if not gradient:
            return total, x
        # the first vertex of what is to come stands for all that moves with it: turns act on vertices after it alone
        tail = np.concatenate([np.zeros((len(done), 1, 2)), moves[:, done.shape[1] :]], axis=1)
        back = chained(tail, along, lengths, share)
        by_turn = back[2 : n + 2]  # the first heading is the first turn's
        return total, np.concatenate([by_turn, back[n + 2 :]]) / len(done) + by_outside

    def _outside(self, x: Array) -> tuple[float, Array]:
        """What lies beyond the fence, in the frame of the leg just flown, and its derivatives."""
        if not self.limits.fence.polygons:
            return 0.0, np.zeros_like(x)
        spread_m = float(self.flown.layouts.spread_m.mean())
        course = np.concatenate([[0.0, 0.0], x])
        value, back = beyond(course, x.size // 2, self.limits.length_m, self.limits.fence, 0.0, spread_m)
        return FENCE_WEIGHT * value, FENCE_WEIGHT * back[2:]


def next_legs(
    flown: Flown, sensing: Sensing, limits: Limits, rng: np.random.Generator, before: Proposal | None = None
) -> Proposal:
    """The rest of the mission; `before`: what was proposed for it earlier, one of the starts."""
    off = TURN_OFF_RAD * rng.standard_normal((len(flown.layouts), limits.most_legs))
    ahead = _Ahead(flown, sensing, limits, off)
    starts = list(_starts(flown, limits, rng, before))
    starts.sort(key=lambda x: ahead(x, gradient=False)[0])
    best: tuple[float, Array] = math.inf, starts[0]
    for x in starts[:DESCENDED]:
        found = minimize(
            ahead, x, jac=True, method="L-BFGS-B", bounds=_bounds(x, limits), options={"maxiter": ITERATIONS}
        )
        best = min(best, (float(found.fun), found.x), key=lambda one: one[0])
    return _proposal(*best, limits)


def _proposal(value: float, x: Array, limits: Limits) -> Proposal:
    n = x.size // 2
    share = np.exp(x[n:] - x[n:].max())
    lengths = limits.length_m * share / share.sum()
    return Proposal(tuple(x[:n].tolist()), tuple(lengths.tolist()), value)


def _starts(flown: Flown, limits: Limits, rng: np.random.Generator, before: Proposal | None) -> Iterator[Array]:
    """Pentagrams stretched and turned, to either side, some legs more or fewer."""
    usual = limits.length_m / (USUAL_LEG_SPREADS * float(np.exp(np.log(flown.layouts.spread_m).mean())))
    most = max(1, min(limits.most_legs, int(limits.length_m / limits.least_leg_m)))
    low, high = limits.turn_rad
    if before is not None and 0 < len(before.length_m) <= most:
        turns = np.clip(np.abs(before.turn_rad), low, high) * np.sign(before.turn_rad)
        yield np.concatenate([turns, np.log(before.length_m) - np.log(before.length_m).mean()])
    for i in range(TRIED):
        n = int(np.clip(round(usual + 0.8 * rng.standard_normal()), 1, most))
        turns = np.clip(USUAL_TURN_RAD + math.radians(20.0) * rng.standard_normal(n), low, high)
        if i % 3 == 2:
            turns = turns * np.where(rng.random(n) < 0.4, -1.0, 1.0)
        yield np.concatenate([turns, 0.2 * rng.standard_normal(n)])


def _bounds(x: Array, limits: Limits) -> list[tuple[float, float]]:
    """Turns keep their side and their limits."""
    low, high = limits.turn_rad
    n = x.size // 2
    return [*[(low, high) if turn >= 0.0 else (-high, -low) for turn in x[:n]], *[SHARES] * n]
