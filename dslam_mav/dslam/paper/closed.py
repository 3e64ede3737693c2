"""Appendix D: one source, a closed path of any L ≥ 3 legs, equal or not (2-D).

Three legs: the triangle is fixed by its lengths; c_3 = α c_1 + β c_2 with α = −l_1/l_3, β = −l_2/l_3 (the paper's −1 is
for equal legs), so X = c_1ᵀc_2 = (l_3² − l_1² − l_2²)/(2 l_1 l_2), and (33) is a check on the centres.

More legs: by (25) d²_j = p + a_j, all offsets follow from p = d²_1. Leg j is seen from the source under the angle
φ_j = arctan((l_j − Y_j)/d_j) + arctan(Y_j/d_j), and round a closed path Σ_j s_j φ_j(p) is a multiple of 2π, s_j = ±1
the side the source is on. Every root p for every choice of sides is a solution; all that stand are returned.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from dslam_mav.dslam.paper.layout import Failure, Layout, Projections, complete, vertices

Array = NDArray[np.float64]

FARTHEST = 16.0  # largest d² of the leg nearest to the source, in C: farther, the flight hardly reads it
STEPS = 400  # of the scan for roots
MOST_FREE_SIDES = 12  # legs up to which every choice of sides is tried
CLOSED = 0.05  # share of the path's length by which its end may miss its start


def by_closure(p: Projections) -> list[Layout] | Failure:
    """Every layout of one source on a closed path that stands, the best closed first; or why there is none."""
    n_legs = p.length.size
    if p.dimensions != 2 or len(p.y) != 1 or n_legs < 3:
        return Failure("Closure settles one source in the plane on three or more legs.")
    if n_legs == 3:
        return _triangle(p)
    found = [_directions(p, x, sides) for sides in _sides(n_legs) for x in _roots(p, sides)]
    gaps = [float(np.linalg.norm(vertices(c, p.length)[-1])) for c in found]
    order = [i for i in np.argsort(gaps) if gaps[i] <= CLOSED * p.length.sum()]
    if not order:
        return Failure("No path with these projections returns to its start.")
    return [complete(found[i], p, "closure") for i in order]


def cosine_of_turn(length: Array) -> float:
    """X = c_1ᵀ c_2 of a closed triangle with sides (3,); beyond ±1 there is none."""
    return float((length[2] ** 2 - length[0] ** 2 - length[1] ** 2) / (2.0 * length[0] * length[1]))


def defect(p: Projections) -> float:
    """Left side of (33) with general α, β: 0 where the centres agree with the triangle; a length."""
    x, l, y = cosine_of_turn(p.length), p.length, p.y[0]  # noqa: E741 (the paper's l)
    alpha, beta = -l[0] / l[2], -l[1] / l[2]
    return float(alpha * (l[0] + l[1] * x - y[0]) + beta * (l[1] - y[1]) + y[2])


def _triangle(p: Projections) -> list[Layout] | Failure:
    x = cosine_of_turn(p.length)
    if abs(x) >= 1.0:
        return Failure("Three legs of these lengths close no triangle.")
    c1, c2 = np.array([1.0, 0.0]), np.array([x, np.sqrt(1.0 - x * x)])
    c3 = -(p.length[0] * c1 + p.length[1] * c2) / p.length[2]
    return [complete(np.array([c1, c2, c3]), p, "closed triangle")]


def _sides(n_legs: int) -> list[Array]:
    """Choices of s_j, one of each mirrored pair; long paths: at most two legs away from the rest."""
    if n_legs <= MOST_FREE_SIDES:
        return [np.array([1.0, *rest]) for rest in product((1.0, -1.0), repeat=n_legs - 1)]
    choices = [np.ones(n_legs)]
    for i in range(n_legs):
        for j in range(i, n_legs):
            sides = np.ones(n_legs)
            sides[[i, j]] = -1.0
            choices.append(sides)
    return choices


def _squared_offsets(p: Projections) -> Array:
    """(L,) a_j of (28): d²_j − d²_1."""
    steps = (p.y[0, :-1] - p.length[:-1]) ** 2 - p.y[0, 1:] ** 2
    return np.concatenate(([0.0], np.cumsum(steps)))


def _turned(x: Array, p: Projections, sides: Array, a: Array) -> Array:
    """(M,) Σ s_j φ_j for p = x (M,)."""
    d = np.sqrt(np.maximum(x[:, None] + a, 1e-300))
    return np.asarray((np.arctan((p.length - p.y[0]) / d) + np.arctan(p.y[0] / d)) @ sides)


def _roots(p: Projections, sides: Array) -> list[float]:
    a = _squared_offsets(p)
    least = float(-a.min())
    # Offsets, not their squares, are scanned evenly: φ changes fastest near d = 0.
    grid = least + np.linspace(0.0, np.sqrt(FARTHEST * float(p.c.max())), STEPS) ** 2
    turned = _turned(grid, p, sides, a)
    found = []
    for winding in range(int(np.ceil(turned.min() / (2 * np.pi))), int(np.floor(turned.max() / (2 * np.pi))) + 1):
        off = turned - 2.0 * np.pi * winding
        for i in np.flatnonzero(off[:-1] * off[1:] < 0.0):
            found.append(_root(p, sides, a, winding, (float(grid[i]), float(grid[i + 1]))))
    return found


def _root(p: Projections, sides: Array, a: Array, winding: int, ends: tuple[float, float]) -> float:
    def off(x: float) -> float:
        return float(_turned(np.array([x]), p, sides, a)[0] - 2.0 * np.pi * winding)

    return float(brentq(off, *ends, xtol=1e-15, rtol=1e-14))


def _directions(p: Projections, x: float, sides: Array) -> Array:
    """(L, 2) directions from the offsets, (22) with one source: the turn that takes one leg's frame to the next."""
    d = sides * np.sqrt(np.maximum(x + _squared_offsets(p), 0.0))
    bearing_before = np.arctan2(d[:-1], p.y[0, :-1] - p.length[:-1])
    bearing_after = np.arctan2(d[1:], p.y[0, 1:])
    heading = np.concatenate(([0.0], np.cumsum(bearing_before - bearing_after)))
    return np.column_stack((np.cos(heading), np.sin(heading)))
