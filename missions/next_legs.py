"""The legs to fly next: turns and lengths relative to the leg just flown that leave the least error to expect.

Without GPS nothing but the turn from the leg just flown means the same to the estimator and to the vehicle. Minimised
is the power mean of the sources' RMS error by the bound (theory, section 9) over what may be true after the legs
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
from missions.telling_apart import Answers

Array = NDArray[np.float64]

USUAL_LEG_SPREADS = 4.48
USUAL_TURN_RAD = math.radians(146.0)
TURN_OFF_RAD = math.radians(4.0)
POINTS_PER_SPREAD = 5.0
TRIED, DESCENDED, JUDGED = 30, 4, 4
ITERATIONS = 20
POWER = 0.5  # of the mean of errors: between what lowers the median most and what lowers the tail
ANSWERS = 18  # told apart
NO_FENCE = Fence()
FENCE_WEIGHT = 300.0
MOST_APART = 1.2  # legs' lengths, in logarithms either way


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """What may be true: `vertices_m` (M, L+1, 2) of the legs flown, and the sources of each; `rivals`: what besides may
    be taken for true in its place.
    """

    vertices_m: Array
    layouts: Layouts
    rivals: Flown | None = None


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

    def __call__(self, x: Array) -> tuple[float, Array]:
        """Mean ln error with what the fence costs, and its derivatives."""
        value, moves, along, lengths = self._paths(x, gradient=True)
        mean, share = _mean(value)
        moves = moves * share[:, None, None]
        done = self.flown.vertices_m
        # the last vertex flown stays where it is, and turns act on those after it
        tail = np.concatenate([np.zeros((len(done), 1, 2)), moves[:, done.shape[1] :]], axis=1)
        back = chained(tail, along, lengths, lengths / lengths.sum())
        outside, by_outside = self.outside(x)
        # the first heading is the first turn's
        return mean + outside, back[2:] + by_outside

    def value(self, x: Array) -> float:
        """Without derivatives."""
        return _mean(self._paths(x, gradient=False)[0])[0] + self.outside(x)[0]

    def errors2_m2(self, x: Array) -> Array:
        """(M,) the bound on the sources' mean squared error."""
        return np.asarray(np.exp(2.0 * self._paths(x, gradient=False)[0]))

    def outside(self, x: Array) -> tuple[float, Array]:
        """What lies beyond the fence, in the frame of the leg just flown, and its derivatives."""
        if not self.limits.fence.polygons:
            return 0.0, np.zeros_like(x)
        spread_m = float(self.flown.layouts.spread_m.mean())
        course = np.concatenate([[0.0, 0.0], x])
        value, back = beyond(course, x.size // 2, self.limits.length_m, self.limits.fence, 0.0, spread_m)
        return FENCE_WEIGHT * value, FENCE_WEIGHT * back[2:]

    def _paths(self, x: Array, *, gradient: bool) -> tuple[Array, Array, Array, Array]:
        n, done = x.size // 2, self.flown.vertices_m
        last = done[:, -1] - done[:, -2]
        theta = np.arctan2(last[:, 1], last[:, 0])[:, None] + np.cumsum(x[:n] + self.off[:, :n], axis=1)
        along = np.stack([np.cos(theta), np.sin(theta)], axis=2)
        lengths = _legs(x, self.limits)[1]
        path = np.concatenate([done, done[:, -1:] + np.cumsum(lengths[:, None] * along, axis=1)], axis=1)
        value, moves = log_errors(path, self.flown.layouts, self.sensing, POINTS_PER_SPREAD, gradient)
        return value, moves, along, lengths


def next_legs(
    flown: Flown, sensing: Sensing, limits: Limits, rng: np.random.Generator, before: Proposal | None = None
) -> Proposal:
    """The rest of the mission; `before`: what was proposed for it earlier, one of the starts."""
    off = TURN_OFF_RAD * rng.standard_normal((len(flown.layouts), limits.most_legs))
    ahead = _Ahead(flown, sensing, limits, off)
    starts = [_within(x, limits) for x in _starts(flown, limits, rng, before)]
    starts.sort(key=ahead.value)
    candidates = list(starts[DESCENDED : DESCENDED + JUDGED])
    for x in starts[:DESCENDED]:
        found = minimize(
            ahead, x, jac=True, method="L-BFGS-B", bounds=_bounds(x, limits), options={"maxiter": ITERATIONS}
        )
        candidates.append(found.x)
    chosen = np.unique(np.linspace(0, len(flown.layouts) - 1, ANSWERS).astype(np.int64))
    some = Answers.of(flown.vertices_m[chosen], flown.layouts.chosen(chosen))
    if flown.rivals is not None:
        some = some.beside(Answers.of(flown.rivals.vertices_m, flown.rivals.layouts))
    judged = [(_expected(x, ahead, some, chosen), x) for x in candidates]
    value, best = min(judged, key=lambda one: one[0])
    turn, length = _legs(best, limits)
    return Proposal(tuple(turn.tolist()), tuple(length.tolist()), value)


def _expected(x: Array, ahead: _Ahead, some: Answers, chosen: NDArray[np.int64]) -> float:
    """Mean ln of the error, alternatives taken for true included."""
    turn, length = _legs(x, ahead.limits)
    sharp = ahead.errors2_m2(x)[chosen]
    confused = some.confusion_m2(turn, length, ahead.sensing)
    return _mean(0.5 * np.log(sharp + confused))[0] + ahead.outside(x)[0]


def _mean(log_error: Array) -> tuple[float, Array]:
    """ln of the power mean of errors, and each one's share in its derivative."""
    worth = np.exp(POWER * (log_error - log_error.max()))
    mean = float(log_error.max() + np.log(worth.mean()) / POWER)
    return mean, np.asarray(worth / worth.sum())


def _legs(x: Array, limits: Limits) -> tuple[Array, Array]:
    n = x.size // 2
    share = np.exp(x[n:] - x[n:].max())
    return x[:n], np.asarray(limits.length_m * share / share.sum())


def _starts(flown: Flown, limits: Limits, rng: np.random.Generator, before: Proposal | None) -> Iterator[Array]:
    """Pentagrams stretched and turned, to either side, some legs more or fewer."""
    usual = limits.length_m / (USUAL_LEG_SPREADS * float(np.exp(np.log(flown.layouts.spread_m).mean())))
    most = max(1, min(limits.most_legs, int(limits.length_m / limits.least_leg_m)))
    low, high = limits.turn_rad
    first = flown.vertices_m.shape[1] == 2  # the first turn of all: its side is the gauge's
    if before is not None and 0 < len(before.length_m) <= most:
        turns = np.clip(np.abs(before.turn_rad), low, high) * np.sign(before.turn_rad)
        yield np.concatenate([turns, np.log(before.length_m) - np.log(before.length_m).mean()])
    for i in range(TRIED):
        n = int(np.clip(round(usual + 0.8 * rng.standard_normal()), 1, most))
        turns = np.clip(USUAL_TURN_RAD + math.radians(20.0) * rng.standard_normal(n), low, high)
        if i % 3 == 2:
            turns = turns * np.where(rng.random(n) < 0.4, -1.0, 1.0)
        if first:
            turns[0] = abs(turns[0])
        yield np.concatenate([turns, 0.2 * rng.standard_normal(n)])


def _bounds(x: Array, limits: Limits) -> list[tuple[float, float]]:
    """Turns keep their side and their limits; shares lie so near to each other that no leg becomes too short."""
    low, high = limits.turn_rad
    n = x.size // 2
    ratio = max(limits.length_m / limits.least_leg_m - 1.0, 1.0) / max(n - 1, 1)
    apart = min(MOST_APART, max(0.5 * math.log(ratio), 0.0))
    return [*[(low, high) if turn >= 0.0 else (-high, -low) for turn in x[:n]], *[(-apart, apart)] * n]


def _within(x: Array, limits: Limits) -> Array:
    low, high = np.array(_bounds(x, limits)).T
    return np.asarray(np.clip(x, low, high))
