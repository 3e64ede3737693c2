"""The mission that sees best: straight legs of a given total length that leave the least error to expect.

Minimised is the mean logarithm of the sources' RMS error by the bound (theory, section 9) over many layouts drawn from
what is known of the sources, with √C up to 1.5 times off either way and every layout's turns some 5° off, so that the
plan does not live by what the pilot cannot know or fly. Legs and turns descend by gradients from many starts; stars of
equal length are candidates as they are, so that the answer is never worse than the best of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from dslam_mav.dslam.expected import Sensing, log_errors
from dslam_mav.dslam.layouts import Layouts, Prior, drawn
from dslam_mav.dslam.outlook import outlook
from missions.course import beyond, chained, coordinates, length_of, parts, path_of
from missions.fence import Fence
from missions.patterns import centred, star

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]
_Found = tuple[float, Array]

MISJUDGED = 1.5  # √C, either way
TURN_OFF_RAD = math.radians(5.0)
ROUGHLY, TRAINING, CHOOSING = 90, 180, 1200  # layouts: in the end at least 90, or a plan fits them and no others
POINTS_PER_SPREAD = 5.0
USUAL_LEG_SPREADS = 4.48
USUAL_TURN_RAD = math.radians(146.0)
STARTS = 16
FINALISTS = 6
ROUGH_STAGES = ((30.0, 30),)
FINE_STAGES = ((100.0, 70), (1e3, 20), (1e4, 20), (1e5, 20))
"""How much beyond the fence weighs, in spreads squared, and iterations: every stage pulls harder than the last."""
KEPT_STARS = 3
FINE_WORTH = 4  # starts, in time
NO_FENCE = Fence()
MOST_LEGS = 40
THREADS = 2
STARS = ((5, 2), (7, 3), (7, 2), (8, 3), (9, 4), (11, 5), (3, 1), (4, 1))
STAR_HEADINGS = 8


@dataclass(frozen=True, slots=True)
class Wish:
    """What is asked for: total length; how many legs (None: whatever sees best); where it may fly and how far from the
    fence; turns at corners from … to, radians of 0 to π; shortest leg.
    """

    length_m: float
    legs: int | None = None
    fence: Fence = NO_FENCE
    margin_m: float = 0.0
    turn_rad: tuple[float, float] = (0.0, math.pi)
    least_leg_m: float = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class _Score:
    """Mean ln error of a path over layouts, each with turns a little off."""

    groups: list[Layouts]
    turn_off: list[Array]  # (M, legs' turns at most) each
    sensing: Sensing

    def of(self, path: Array) -> float:
        """Without derivatives."""
        x = coordinates(path)
        return self.with_gradient(x, len(path) - 1, length_of(path), gradient=False)[0]

    def with_gradient(self, x: Array, n_legs: int, length_m: float, gradient: bool = True) -> tuple[float, Array]:
        """By `path_of`'s coordinates."""
        total, count, back = 0.0, 0, np.zeros_like(x)
        start, theta0, turn, share = parts(x, n_legs)
        lengths = length_m * share
        for group, off in zip(self.groups, self.turn_off, strict=True):
            theta = theta0 + np.hstack([np.zeros((len(group), 1)), np.cumsum(turn + off[:, : n_legs - 1], axis=1)])
            along = np.stack([np.cos(theta), np.sin(theta)], axis=2)
            corners = np.concatenate([np.zeros((len(group), 1, 2)), np.cumsum(lengths[:, None] * along, axis=1)], 1)
            value, moves = log_errors(start + corners, group, self.sensing, POINTS_PER_SPREAD, gradient)
            total += float(value.sum())
            count += len(group)
            if gradient:
                back += chained(moves, along, lengths, share)
        return total / count, back / count


def best_path(
    wish: Wish, prior: Prior, sensing: Sensing, rng: np.random.Generator, progress: Progress | None = None
) -> Array | None:
    """(L+1, 2) vertices; None where no path of this length, legs and turns was found within the fence."""
    spread_m = prior.usual_spread_m
    roughly, training, choosing = (_score(prior, sensing, count, rng) for count in (ROUGHLY, TRAINING, CHOOSING))
    stars = sorted(_stars(wish, prior), key=training.of)[:KEPT_STARS]
    starts = [*stars[:2], *_starts(wish, prior, rng)]
    bar = _Bar(progress, len(starts) + FINALISTS * FINE_WORTH)
    with ThreadPoolExecutor(THREADS) as pool:  # the kernels let go of the interpreter
        rough = list(pool.map(lambda path: bar.after(_descend(path, wish, roughly, spread_m, ROUGH_STAGES), 1), starts))
        rough.sort(key=lambda found: found[0] + training.of(found[1]))

        def finely(found: _Found) -> Array:
            return bar.after(_descend(found[1], wish, training, spread_m, FINE_STAGES), FINE_WORTH)[1]

        candidates = [*stars, *pool.map(finely, rough[:FINALISTS])]
    flyable = [path for path in candidates if _may_fly(path, wish)]
    for found in rough[FINALISTS:]:  # a winding fence may hold back the best of them
        if flyable:
            break
        path = finely(found)
        flyable += [path] if _may_fly(path, wish) else []
    return min(flyable, key=choosing.of) if flyable else None


class _Bar:
    """Counts what is done, from any thread."""

    def __init__(self, tell: Progress | None, steps: int) -> None:
        self._tell, self._steps, self._done, self._lock = tell, steps, 0, Lock()

    def after(self, found: _Found, worth: int) -> _Found:
        """Passes on what was found."""
        with self._lock:
            self._done = min(self._done + worth, self._steps)
            if self._tell is not None:
                self._tell(self._done, self._steps)
        return found


def _score(prior: Prior, sensing: Sensing, count: int, rng: np.random.Generator) -> _Score:
    low, high = prior.spread_m
    groups = drawn(replace(prior, spread_m=(low / MISJUDGED, high * MISJUDGED)), count, rng)
    off = [TURN_OFF_RAD * rng.standard_normal((len(group), MOST_LEGS)) for group in groups]
    return _Score(groups, off, sensing)


def _stars(wish: Wish, prior: Prior) -> Iterator[Array]:
    """Stars of the wanted length that may be flown, about the middle of where sources may be."""
    for n, k in STARS:
        turn = 2.0 * math.pi * k / n
        for rounds in (1, 2):
            legs = n * rounds
            if not (wish.turn_rad[0] <= turn <= wish.turn_rad[1]) or wish.legs not in (None, legs):
                continue
            if wish.length_m / legs < wish.least_leg_m or legs > MOST_LEGS:
                continue
            for heading in np.arange(STAR_HEADINGS) * (2.0 * math.pi / n / STAR_HEADINGS):
                path = _middled(star(n, k, wish.length_m / legs, legs, float(heading)), prior)
                if wish.fence.lets_pass(path, wish.margin_m):
                    yield path
                    if not wish.fence.polygons:
                        break


def _middled(path: Array, prior: Prior) -> Array:
    east_m, north_m = prior.region.middle[:2]
    return centred(path, (float(east_m), float(north_m)))


def _starts(wish: Wish, prior: Prior, rng: np.random.Generator) -> Iterator[Array]:
    """Stretched pentagrams and their like, some legs more or fewer, turned anyhow."""
    usual = _usual_legs(wish, prior)
    around = [usual, usual + 1, usual + 2] if wish.fence.polygons else [usual, usual + 1]
    counts = [wish.legs] if wish.legs else [*around, max(usual - 1, 3)]
    low, high = wish.turn_rad
    for i in range(STARTS):
        n_legs = counts[i % len(counts)]
        turn = np.clip(USUAL_TURN_RAD + math.radians(4.0) * rng.standard_normal(n_legs - 1), low, high)
        if i >= 2 * len(counts):  # and some that turn to both sides
            turn = turn * np.where(rng.random(n_legs - 1) < 0.25, -1.0, 1.0)
        x = np.concatenate([[0.0, 0.0, 2.0 * math.pi * rng.random()], turn, 0.05 * rng.standard_normal(n_legs)])
        yield _middled(path_of(x, n_legs, wish.length_m), prior)


def _usual_legs(wish: Wish, prior: Prior) -> int:
    """Legs of 4.5 √C, or as long as the fence has room for."""
    leg = USUAL_LEG_SPREADS * prior.usual_spread_m
    if wish.fence.within:
        low, high = wish.fence.extent()
        leg = min(leg, 0.9 * float(np.linalg.norm(high - low)))
    return int(np.clip(round(wish.length_m / leg), 4, MOST_LEGS // 2))


def _descend(first: Array, wish: Wish, score: _Score, spread_m: float, stages: Sequence[tuple[float, int]]) -> _Found:
    """Down from a start; what the fence still costs and the path it ends at, which may lie beyond it."""
    n_legs, length_m = len(first) - 1, length_of(first)
    x = coordinates(first)
    bounds = _bounds(x, wish, n_legs)
    x = np.array([np.clip(value, *limits) for value, limits in zip(x, bounds, strict=True)])

    def cost(x: Array, weight: float) -> tuple[float, Array]:
        value, back = score.with_gradient(x, n_legs, length_m)
        if wish.fence.polygons:
            outside, by_outside = beyond(x, n_legs, length_m, wish.fence, wish.margin_m, spread_m)
            value, back = value + weight * outside, back + weight * by_outside
        return value, back

    for weight, iterations in stages:
        found = minimize(
            cost, x, args=(weight,), jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": iterations}
        )
        x = found.x
        if _may_fly(path_of(x, n_legs, length_m), wish):
            break
    fenced = (x, n_legs, length_m, wish.fence, wish.margin_m, spread_m)
    left = stages[-1][0] * beyond(*fenced)[0] if wish.fence.polygons else 0.0
    return left, path_of(x, n_legs, length_m)


def _may_fly(path: Array, wish: Wish) -> bool:
    shortest_m = np.linalg.norm(np.diff(path, axis=0), axis=1).min()
    return bool(shortest_m >= wish.least_leg_m) and wish.fence.lets_pass(path, wish.margin_m)


def _bounds(x: Array, wish: Wish, n_legs: int) -> list[tuple[float, float]]:
    """Turns keep their side and their limits, legs a tenth to ten times the usual."""
    low, high = wish.turn_rad
    turns = [(low, high) if turn >= 0.0 else (-high, -low) for turn in x[3 : n_legs + 2]]
    middle = float(x[n_legs + 2 :].mean())
    free = (-np.inf, np.inf)
    return [free, free, free, *turns, *[(middle - 1.5, middle + 1.5)] * n_legs]


def best_star_error_m(wish: Wish, prior: Prior, groups: Sequence[Layouts], sensing: Sensing) -> float:
    """Median RMS source error of the best star of the wanted length; infinite where none may be flown."""
    errors = [outlook(path, groups, sensing).source.median_m for path in _stars(wish, prior)]
    return min(errors, default=math.inf)
