"""Scenes that fit a table: the paper prints no coordinates, but errors relative to distances from an origin.

A drawn scene is flown by the paper's method at every noise of its rows. What the answers miss in metres does not
depend on where the scene's origin lies, what the table prints does: (V-A) divides by distances from it. So the origin
is placed where the worst of the rows' errors is nearest to what is printed, and draws are compared by that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from dslam_mav.dslam.paper.gaussians import Gaussians, assess, model
from dslam_mav.dslam.paper.method import estimate_by_paper
from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.experiments.errors import in_scene
from dslam_mav.experiments.measures import medium_for
from dslam_mav.experiments.trials import generator
from dslam_mav.experiments.world import World
from dslam_mav.records import Truth

Array = NDArray[np.float64]

STEPS = 24  # along a leg
LEAST_ANSWERED = 0.8  # share of the flights that should give an answer
WIDEST = 2.0  # standard deviation of an error over its mean: more makes the mean a matter of luck
RINGS, BEARINGS = 24, 24  # of the grid of origins
LEG_SPREADS = (3.0, 5.0)
TURNS_DEG = (95.0, 165.0)
SCATTER, APART, BEYOND = 1.8, 0.45, 0.2  # √C: sources about the middle, centres' least gap, how far beyond a leg
GEOMETRIES = 6000  # tried for a scene


class Geometry(NamedTuple):
    """A drawn scene, metres: vertices (L+1, 2), sources (K, 2), √C."""

    vertices: Array
    source: Array
    spread: float


class Missed(NamedTuple):
    """What answers miss on average, metres: sources (K,), places along the legs (L, STEPS).

    `answered`: share of the flights with an answer; `width`: standard deviation over mean of the whole miss.
    """

    sources: Array
    lines: Array
    answered: float
    width: float


class Wanted(NamedTuple):
    """A row to be met: its misses and the errors that are printed."""

    missed: Missed
    printed: Mapping[str, float]


def draw(rng: np.random.Generator, k: int, length_m: float, readings: int, noise: float, sure: float) -> Geometry:
    """A scene whose every leg places its centres to `sure` √C by its own bound, or the surest of all tried.

    `noise`: sd over the RMS of the readings. Where a leg cannot tell its centres the filter has no answer, and the mean
    of those it has is a matter of luck. ValueError where none is found with its centres apart.
    """
    best: tuple[float, Geometry] | None = None
    for tried in range(GEOMETRIES):
        if best is not None and (best[0] < sure or tried > GEOMETRIES // 4):
            break
        legs = int(rng.choice([4, 5] if k == 2 else [3, 4, 5]))
        spread = length_m / rng.uniform(*LEG_SPREADS)
        turns = np.deg2rad(rng.uniform(*TURNS_DEG, legs - 1))
        heading = np.concatenate(([0.0], np.cumsum(turns)))
        direction = np.column_stack((np.cos(heading), np.sin(heading)))
        vertices = np.vstack((np.zeros((1, 2)), np.cumsum(length_m * direction, axis=0)))
        source = vertices[:-1].mean(axis=0) + spread * rng.uniform(-SCATTER, SCATTER, (k, 2))
        geometry = Geometry(vertices, source, spread)
        y = np.einsum("kjd,jd->kj", source[:, None] - vertices[:-1], direction)
        gap, least, most = np.diff(np.sort(y, axis=0), axis=0).min(), y.min(), y.max()
        if gap >= APART * spread and least >= -BEYOND * spread and most <= length_m + BEYOND * spread:
            worst = _worst_leg(geometry, y / spread, length_m / spread, readings, noise)
            if best is None or worst < best[0]:
                best = (worst, geometry)
    if best is None:
        raise ValueError(f"k: no scene of {k} sources with centres apart on every leg was drawn")
    return best[1]


def _worst_leg(geometry: Geometry, y: Array, length: float, readings: int, noise: float) -> float:
    """sd of the worst centre of the worst leg, in √C; y (K, L) and length in √C too."""
    to_source = (geometry.source[:, None] - geometry.vertices[:-1]) / geometry.spread
    height = np.exp(y**2 - (to_source**2).sum(axis=2))
    s = np.arange(readings) * length / readings
    legs = [Gaussians(y[:, j], height[:, j], np.ones(len(y))) for j in range(y.shape[1])]
    clean = [model(s, leg) for leg in legs]
    rms = np.sqrt(np.mean(np.square(clean)))
    worst = max(assess(s, one, leg).condition / one.max() for leg, one in zip(legs, clean, strict=True))
    return float(worst * rms * noise)


def missed(world: World, options: PaperOptions, flights: int, seed: int) -> Missed:
    """The paper's method over `flights` flights of a world."""
    medium, truth = medium_for(world, False), world.truth
    k, real = len(truth.amplitude), _places(truth.vertices_m)
    sources, lines = [], []
    for trial in range(flights):
        flight = world.flight(generator("chosen", 0, trial, seed))
        placed = in_scene(estimate_by_paper(flight, medium, k, k, options), world)
        if placed is None:
            continue
        sources.append(np.linalg.norm(placed[0][placed[2]] - truth.source_position_m, axis=1))
        lines.append(np.linalg.norm(_places(placed[1]) - real, axis=2))
    if not sources:
        return Missed(np.full(k, np.nan), np.full(real.shape[:2], np.nan), 0.0, np.inf)
    whole = np.array([one.mean() for one in sources])
    share = len(sources) / flights
    return Missed(np.mean(sources, axis=0), np.mean(lines, axis=0), share, float(whole.std() / whole.mean()))


def place_origin(truth: Truth, rows: Sequence[Wanted]) -> tuple[Array, float]:
    """(2,) where the origin fits the rows best, and by how much the worst error is off there, as a logarithm."""
    middle, source = truth.vertices_m.mean(axis=0), truth.source_position_m
    size = float(np.ptp(truth.vertices_m, axis=0).max())
    angle = 2.0 * np.pi * np.arange(BEARINGS) / BEARINGS
    ring = np.column_stack((np.cos(angle), np.sin(angle)))
    starts = [
        centre + radius * away
        for centre, least in ((middle, 0.1), *((place, 1e-3) for place in source))
        for radius in np.geomspace(least, 300.0 if least == 0.1 else 0.3, RINGS) * size
        for away in ring
    ]
    costs = [_off(origin, truth, rows) for origin in starts]
    best = np.argsort(costs)[:3]
    polished = [
        minimize(_off, starts[i], (truth, rows), method="Nelder-Mead", options={"xatol": 1e-4 * size}) for i in best
    ]
    found = min(polished, key=lambda one: float(one.fun))
    return np.asarray(found.x), float(found.fun)


def penalty(rows: Sequence[Wanted]) -> float:
    """What a scene is worse by where flights go unanswered, or the mean hangs on a few of them."""
    unanswered = max(0.0, *(LEAST_ANSWERED - row.missed.answered for row in rows))
    return 4.0 * unanswered + 0.5 * max(0.0, *(row.missed.width - WIDEST for row in rows))


def errors_from(origin: Array, truth: Truth, row: Missed) -> dict[str, float]:
    """E_sources and E_lines of the misses with the origin there."""
    sources = np.linalg.norm(truth.source_position_m - origin, axis=1)
    lines = np.linalg.norm(_places(truth.vertices_m) - origin, axis=2)
    return {"E_sources": float((row.sources / sources).mean()), "E_lines": float((row.lines / lines).mean())}


def _off(origin: Array, truth: Truth, rows: Sequence[Wanted]) -> float:
    """The largest |ln(error / printed)|."""
    worst = 0.0
    for row in rows:
        found = errors_from(origin, truth, row.missed)
        worst = max(worst, *(abs(np.log(found[name] / row.printed[name])) for name in found))
    return float(worst)


def _places(vertices: Array) -> Array:
    """(L, STEPS, 2) places along the legs, at the middles of equal steps."""
    s = (np.arange(STEPS) + 0.5) / STEPS
    return np.asarray(vertices[:-1, None] + s[:, None] * np.diff(vertices, axis=0)[:, None])
