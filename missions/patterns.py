"""Patterns of straight legs: pure geometry, metres east and north, headings counter-clockwise from east.

A star {n/k} has n equal legs and turns by k·360/n degrees at every corner; {7/3} and {5/2} cross their middle
from many sides, which is what the reconstruction asks of a path.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dslam_mav.errors import BadInputError

Array = NDArray[np.float64]

# Positions go over the wire in steps of 1 cm, so a shorter leg has no direction; further out than a few
# kilometres the tangent plane at home is no longer good to a centimetre.
SHORTEST_LEG_M = 0.1
LONGEST_LEG_M = 5000.0
MOST_LEGS = 500

RANDOM_TURN_DEG = (30.0, 150.0)


def from_turns(lengths_m: Array, turns_rad: Array, heading_rad: float = 0.0) -> Array:
    """(L+1, 2) vertices of a path from the origin: leg lengths (L,), left turns between them (L-1,)."""
    headings = heading_rad + np.concatenate(([0.0], np.cumsum(turns_rad)))
    steps = np.asarray(lengths_m)[:, None] * np.column_stack((np.cos(headings), np.sin(headings)))
    return np.vstack((np.zeros((1, 2)), np.cumsum(steps, axis=0)))


def star(n: int, k: int, leg_m: float, legs: int | None = None, heading_rad: float = 0.0) -> Array:
    """(L+1, 2) vertices of the star polygon {n/k}; L = n closes it, more legs fly it again.

    A ValueError unless 1 ≤ k < n/2 with n and k coprime: anything else is no single closed star.
    """
    if not (n >= 3 and 1 <= k < n / 2 and math.gcd(n, k) == 1):
        raise ValueError(f"star {{{n}/{k}}}: expected 1 <= k < n/2 without a common divisor")
    total = n if legs is None else legs
    return from_turns(np.full(total, leg_m), np.full(total - 1, 2.0 * math.pi * k / n), heading_rad)


def lawnmower(leg_m: float, legs: int = 7, heading_rad: float = 0.0) -> Array:
    """(L+1, 2) vertices: long legs of `leg_m` to and fro, joined by short ones of a third."""
    index = np.arange(legs)
    lengths = np.where(index % 2 == 0, leg_m, leg_m / 3.0)
    side = np.where((index[:-1] // 2) % 2 == 0, 1.0, -1.0)
    return from_turns(lengths, 0.5 * math.pi * side, heading_rad)


def spiral(leg_m: float, legs: int = 7, heading_rad: float = 0.0) -> Array:
    """(L+1, 2) vertices of a square spiral inwards: two legs of `leg_m`, then two shorter ones, and so on."""
    rounds = (legs + 1) // 2
    lengths = leg_m * (1.0 - (np.arange(legs) // 2) / rounds)
    return from_turns(lengths, np.full(legs - 1, 0.5 * math.pi), heading_rad)


def random_turns(
    leg_m: float, legs: int = 7, heading_rad: float = 0.0, rng: np.random.Generator | None = None
) -> Array:
    """(L+1, 2) vertices: equal legs, turns uniform in 30 to 150° to either side; no `rng` means seed 0."""
    generator = np.random.default_rng(0) if rng is None else rng
    turns = np.deg2rad(generator.uniform(*RANDOM_TURN_DEG, size=legs - 1))
    return from_turns(np.full(legs, leg_m), turns * generator.choice([-1.0, 1.0], size=legs - 1), heading_rad)


_Maker = Callable[[float, int, float, np.random.Generator | None], Array]
# name -> (legs flown unless told otherwise, maker)
_PATTERNS: dict[str, tuple[int, _Maker]] = {
    "star7": (7, lambda leg_m, legs, heading, _: star(7, 3, leg_m, legs, heading)),
    "star5": (5, lambda leg_m, legs, heading, _: star(5, 2, leg_m, legs, heading)),
    "triangle": (3, lambda leg_m, legs, heading, _: star(3, 1, leg_m, legs, heading)),
    "square": (4, lambda leg_m, legs, heading, _: star(4, 1, leg_m, legs, heading)),
    "lawnmower": (7, lambda leg_m, legs, heading, _: lawnmower(leg_m, legs, heading)),
    "spiral": (7, lambda leg_m, legs, heading, _: spiral(leg_m, legs, heading)),
    "random": (7, random_turns),
}
PATTERN_NAMES: tuple[str, ...] = tuple(_PATTERNS)


def pattern(
    name: str,
    leg_m: float,
    *,
    legs: int | None = None,
    heading_rad: float = 0.0,
    centre_m: tuple[float, float] | None = None,
    rng: np.random.Generator | None = None,
) -> Array:
    """(L+1, 2) vertices of a named pattern with (longest) legs of `leg_m`, its first leg along `heading_rad`.

    It begins at (0, 0), or has the middle of its extent at `centre_m` [east, north]. `legs`: more or fewer
    legs than the pattern's own. `rng` is drawn from by "random" only. BadInputError names an unknown pattern
    or a value out of range.
    """
    if name not in _PATTERNS:
        raise BadInputError(f"pattern {name!r}: expected one of {', '.join(PATTERN_NAMES)}")
    own_legs, make = _PATTERNS[name]
    total = own_legs if legs is None else legs
    if not SHORTEST_LEG_M <= leg_m <= LONGEST_LEG_M:
        raise BadInputError(f"leg length {leg_m:g} m: expected {SHORTEST_LEG_M:g} to {LONGEST_LEG_M:g} m")
    if not (isinstance(total, int) and 1 <= total <= MOST_LEGS):
        raise BadInputError(f"legs {total}: expected a whole number from 1 to {MOST_LEGS}")
    if not math.isfinite(heading_rad):
        raise BadInputError(f"heading {heading_rad} rad: expected a finite angle")
    vertices = make(float(leg_m), total, float(heading_rad), rng)
    if name == "spiral" and leg_m / ((total + 1) // 2) < SHORTEST_LEG_M:
        raise BadInputError(f"legs {total}: a spiral from {leg_m:g} m has legs under {SHORTEST_LEG_M:g} m")
    return vertices if centre_m is None else centred(vertices, centre_m)


def centred(vertices_m: Array, centre_m: tuple[float, float] = (0.0, 0.0)) -> Array:
    """The path with the middle of its extent at `centre_m`: a path that fits an area then lies in it."""
    if not all(math.isfinite(c) for c in centre_m):
        raise BadInputError(f"centre {centre_m[0]}, {centre_m[1]} m: expected finite numbers")
    middle = 0.5 * (vertices_m.min(axis=0) + vertices_m.max(axis=0))
    return np.asarray(vertices_m - middle + np.asarray(centre_m, dtype=np.float64))
