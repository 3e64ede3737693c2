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
STEP_SDS = 1.6  # the trapezium rule at this spacing gives a Gaussian's variance to a hundredth
MOST_STEPS = 3
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
    """How far (P,) it is from the answer, its residual and Jacobian, both in standard deviations; its state, but for
    plain problems, which need none.
    """

    state: State
    away: Array
    residual: Array
    jacobian: Array

    @property
    def chi2(self) -> float:
        return float(self.residual @ self.residual)


@dataclass(frozen=True, slots=True, eq=False)
class _Ground:
    """What a walk takes place on: the problem, its unknowns, a reading's standard deviation, the answer it begins at,
    and where the problem is plain, as the compiled model knows it.
    """

    prob: Problem
    at: Layout
    sd: float
    answer: State
    compiled: Compiled | None

    def begin(self) -> _Point:
        """The answer itself."""
        return self._point(self.answer, np.zeros(self.at.size))

    def beyond(self, here: _Point, step: Array) -> _Point:
        """The point a step (P,) away, in parts that `moved` takes in full; χ² is infinite where they would be many."""
        at, reach = self.at, 0.5 * MAX_STEP_SPREADS * self.answer.spread
        limit = np.full(at.size, MAX_STEP_LOG)
        limit[at.ambient] = limit[at.drift] = limit[at.shift] = np.inf
        limit[at.heading] = limit[at.climb] = limit[at.turn] = MAX_STEP_RAD
        limit[at.place] = limit[at.longer] = limit[at.gap] = limit[at.coefficient] = reach
        limit[at.extent] = MAX_STEP_EXTENT
        longest = float((np.abs(step) / limit).max())
        parts = max(1, int(np.ceil(min(longest, MOST_PARTS + 1.0))))
        if parts > MOST_PARTS:
            return _Point(here.state, here.away, np.array([np.inf]), here.jacobian)
        state = here.state
        if self.compiled is None:
            for _ in range(parts):
                state = moved(self.prob, state, step / parts, at)
        return self._point(state, here.away + step)

    def _point(self, state: State, away: Array) -> _Point:
        if self.compiled is None:
            residual, jacobian = evaluate(self.prob, state, self.at)
        else:
            residual, jacobian = self.compiled.evaluate(self.compiled.start + away)
        return _Point(state, away, residual / self.sd, jacobian / self.sd)


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
    ground = _Ground(prob, at, float(np.sqrt(variance)), state, compiled(prob, state) if plain(prob) else None)
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
    first = [_settled(ground, ground.beyond(start, sign * STEP_SDS * slope), way) for sign in (1.0, -1.0)]
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
        here, there = there, _settled(ground, ground.beyond(there, there.away - here.away), way)
    return points, highest > SADDLE


def _settled(ground: _Ground, here: _Point, way: Array) -> _Point:
    """The least χ² on the plane across `way` through a point, by Gauss–Newton steps within the plane."""
    damping = DAMPING
    if not np.isfinite(here.chi2):
        return here
    for _ in range(REFITS):
        step, gain = _step_across(here, way, damping)
        if not gain > SETTLED:
            break
        there = ground.beyond(here, step)
        if there.chi2 < here.chi2:
            here, damping = there, max(0.1 * damping, DAMPING)
        else:
            damping = max(10.0 * damping, MORE_DAMPING)
    return here


def _step_across(here: _Point, way: Array, damping: float) -> tuple[Array, float]:
    """The step (P,) to the least of the linear model with no part along `way` (Lagrange), and by how much χ² falls."""
    gradient = here.jacobian.T @ here.residual
    factor, size = factored(here.jacobian, damping)
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
