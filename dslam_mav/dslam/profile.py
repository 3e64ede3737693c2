"""How sure an answer is where the readings bend: its likelihood, walked out along the ways its places are least sure.

F⁻¹ (bound.py) is the covariance of a model that is linear over an error's length. At 20 dB the widest directions are
not: valleys bend, flatten and run past folds into a neighbour's. Along the direction v of the sources' places,

    χ²(u) = min χ² subject to vᵀ(S − Ŝ) = u

is the profile likelihood (Bates and Watts, "Nonlinear Regression Analysis and Its Applications", 1988, section 6.1.2),
and its minimiser x(u) the curve the answer is unsure along. ∫(x − x̂)(x − x̂)ᵀ e^{−χ²(u)/2} du, normed, stands for what
F⁻¹ says of that direction. No covariance is made smaller: F⁻¹ is the floor, and where a direction is straight its share
is left as it is. Only where F⁻¹ reaches farther than `LONG_SPREADS` says it nothing, and the walk alone counts: beside
a leg's line a source is d off, its readings change with d², and at d = 0 they have no slope at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrs

from dslam_mav.dslam.fit import factored
from dslam_mav.dslam.joint import evaluate
from dslam_mav.dslam.kernels.plain_walk import Across, least_across
from dslam_mav.dslam.plain import Compiled, compiled, plain
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import (
    MAX_STEP_EXTENT,
    MAX_STEP_LOG,
    MAX_STEP_RAD,
    MAX_STEP_SPREADS,
    Layout,
    State,
    moved,
)

Array = NDArray[np.float64]

DIRECTIONS = 4  # of the places, the widest; every other one costs as much and adds less
STEP_SDS = 0.5  # valleys bend: steps of 1.6 leave them where four sources are hard to tell apart
MOST_STEPS = 10
STRAIGHT = 0.03  # share by which χ² may leave the parabola at the first step, on either side
ENOUGH = 9.0  # Δχ² beyond which nothing is left
SADDLE = 1.0  # Δχ² over which a fall leads into another answer's basin
FALL = 0.3
LONG_SPREADS = 0.5  # a linear model says nothing that far away
FARTHEST_SPREADS = 2.0  # that far, a place is no place
BLIND_SPREADS = 1e3  # beyond, nothing but rounding bounds a place
MOST_PARTS = 6  # of a step: beyond, the linear model says nothing
REFITS = 3
SETTLED = 0.3  # in χ²: what a further refit may gain
DAMPING = 1e-6
MORE_DAMPING = 1e-2


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """How far (P,) it is from the answer, χ² there; its state, but for plain problems, which need none."""

    away: Array
    chi2: float
    state: State


@dataclass(frozen=True, slots=True, eq=False)
class _Ground:
    """What a walk takes place on: the problem, its unknowns, a reading's variance, the answer it begins at, and where
    the problem is plain, as the compiled model knows it.
    """

    prob: Problem
    at: Layout
    variance: float
    answer: State
    compiled: Compiled | None

    def begin(self) -> _Point:
        """The answer itself."""
        residual = evaluate(self.prob, self.answer, self.at)[0]
        return _Point(np.zeros(self.at.size), float(residual @ residual) / self.variance, self.answer)

    def least(self, here: _Point, step: Array, way: Array) -> _Point:
        """The least χ² on the plane across `way` through a point's neighbour a step (P,) away."""
        limit = self._limit()
        away = here.away + step
        if not float((np.abs(step) / limit).max()) <= MOST_PARTS:
            return _Point(here.away, np.inf, here.state)
        if self.compiled is None:
            return self._least(_Point(away, np.nan, self._moved(here.state, step, limit)), way, limit)
        how = Across(self.variance, REFITS, SETTLED, DAMPING, MORE_DAMPING, MOST_PARTS)
        x = self.compiled.start + away
        chi2 = least_across(self.compiled.flown, self.compiled.base, x, way, limit, how)
        return _Point(x - self.compiled.start, chi2, here.state)

    def _limit(self) -> Array:
        """(P,) the farthest that `moved` takes each unknown in one go."""
        at, limit = self.at, np.full(self.at.size, MAX_STEP_LOG)
        limit[at.ambient] = limit[at.drift] = limit[at.shift] = np.inf
        limit[at.heading] = limit[at.climb] = limit[at.turn] = MAX_STEP_RAD
        limit[at.place] = limit[at.longer] = limit[at.gap] = limit[at.coefficient] = (
            0.5 * MAX_STEP_SPREADS * self.answer.spread
        )
        limit[at.extent] = MAX_STEP_EXTENT
        return limit

    def _moved(self, state: State, step: Array, limit: Array) -> State:
        parts = max(1, int(np.ceil(float((np.abs(step) / limit).max()))))
        for _ in range(parts):
            state = moved(self.prob, state, step / parts, self.at)
        return state

    def _least(self, here: _Point, way: Array, limit: Array) -> _Point:
        """As `kernels.plain_walk.least_across`, for every unknown and prior there is."""
        state, away, damping = here.state, here.away, DAMPING
        residual, jacobian = evaluate(self.prob, state, self.at)
        cost = float(residual @ residual)
        for _ in range(REFITS):
            step, gain = _step_across(residual, jacobian, way, damping)
            if not gain > SETTLED * self.variance:
                break
            if float((np.abs(step) / limit).max()) <= MOST_PARTS:
                there = self._moved(state, step, limit)
                residual_try, jacobian_try = evaluate(self.prob, there, self.at)
                if (cost_try := float(residual_try @ residual_try)) < cost:
                    state, away, cost = there, away + step, cost_try
                    residual, jacobian = residual_try, jacobian_try
                    damping = max(0.1 * damping, DAMPING)
                    continue
            damping = max(10.0 * damping, MORE_DAMPING)
        return _Point(away, cost / self.variance if np.isfinite(cost) else np.inf, state)


def second_moment(prob: Problem, state: State, at: Layout, covariance: Array, variance: float) -> Array:
    """(P, P) mean square of the unknowns about the answer `state`, in the problem's units; at least `covariance`, F⁻¹.

    `variance` of a reading. F⁻¹ itself where no walk would end, a place being bounded by nothing; and for parametric
    paths: the prior on strength, which bounds some of their answers, is no part of their F.
    """
    if not np.isfinite(covariance).all():
        return covariance
    values, vectors = np.linalg.eigh(covariance[at.place, at.place])
    if prob.basis is not None or not 0.0 < values[0] <= values[-1] < (BLIND_SPREADS * state.spread) ** 2:
        return covariance
    ground = _Ground(prob, at, variance, state, compiled(prob, state) if plain(prob) else None)
    start = ground.begin()
    floor = total = covariance
    for value, vector in list(zip(values, vectors.T, strict=True))[: -DIRECTIONS - 1 : -1]:
        way = np.zeros(at.size)
        way[at.place] = vector
        slope = covariance @ way / np.sqrt(value)  # of the linear answer, a standard deviation along
        share = min(1.0, LONG_SPREADS * state.spread / float(np.sqrt(value)))
        walked, ended = _both_sides(ground, start, way, share * slope)
        if share < 1.0 and not ended:
            return covariance
        if walked is not None:
            total = total + walked - np.outer(slope, slope)
            floor = floor - (1.0 - share**2) * np.outer(slope, slope)
    return covariance if total is covariance or not np.isfinite(total).all() else _at_least(floor, total)


def _both_sides(ground: _Ground, start: _Point, way: Array, slope: Array) -> tuple[Array | None, bool]:
    """(P, P) second moment along the profile through `start`, None where χ² is a parabola; and whether it ends."""
    first = [ground.least(start, sign * STEP_SDS * slope, way) for sign in (1.0, -1.0)]
    rises = np.array([point.chi2 - start.chi2 for point in first])
    if (np.abs(rises - STEP_SDS**2) < STRAIGHT * STEP_SDS**2).all():
        return None, True
    points, ended = [(0.0, start.away)], True
    for point in first:
        walked, there = _walk(ground, start, point, way)
        points, ended = points + walked, ended and there
    rise, away = np.array([r for r, _ in points]), np.array([a for _, a in points])
    weight = np.exp(-0.5 * (rise - rise.min()))
    return np.asarray((away.T * (weight / weight.sum())) @ away), ended


def _walk(ground: _Ground, start: _Point, there: _Point, way: Array) -> tuple[list[tuple[float, Array]], bool]:
    """(Δχ², how far) of equally spaced points of the profile, to where nothing is left or another basin begins; and
    whether it came there before it had gone too far.
    """
    points: list[tuple[float, Array]] = []
    here, highest = start, 0.0
    for _ in range(MOST_STEPS):
        rise = there.chi2 - start.chi2
        if not np.isfinite(rise) or (highest > SADDLE and rise < highest - FALL):
            break
        points.append((rise, there.away))
        highest = max(highest, rise)
        if rise > ENOUGH or abs(float(way @ there.away)) > FARTHEST_SPREADS * ground.answer.spread:
            break
        here, there = there, ground.least(there, there.away - here.away, way)
    return points, highest > SADDLE


def _step_across(residual: Array, jacobian: Array, way: Array, damping: float) -> tuple[Array, float]:
    """The step (P,) to the linear model's least with no part along `way` (Lagrange), and how far the cost falls."""
    gradient = jacobian.T @ residual
    factor, size = factored(jacobian, damping)
    if factor is None:
        return np.zeros(size.size), 0.0
    free, along = dpotrs(factor, np.stack([-gradient, way], axis=1) / size[:, None])[0].T / size
    step = free - along * float(way @ free) / float(way @ along)
    return step, -float(gradient @ step)


def _at_least(floor: Array, wide: Array) -> Array:
    """`wide`, made no smaller than `floor` in any direction: eigenvalues of one in the other's measure, at least 1."""
    scale = np.sqrt(np.diag(floor))
    unit = np.outer(scale, scale)
    values, vectors = np.linalg.eigh(floor / unit)
    root = vectors * np.sqrt(np.maximum(values, values[-1] * np.finfo(np.float64).eps))
    white = np.linalg.solve(root, np.linalg.solve(root, wide / unit).T)
    grown, axes = np.linalg.eigh(0.5 * (white + white.T))
    back = root @ axes
    return np.asarray((back * np.maximum(grown, 1.0)) @ back.T * unit)
