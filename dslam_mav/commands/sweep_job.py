"""A point of a sweep, as a worker process runs it: a simulated flight, or one from a log."""

from __future__ import annotations

import math
import time
from argparse import Namespace
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Literal

import numpy as np

from dslam_mav.commands.assume import PACKAGES
from dslam_mav.commands.logged import estimate_again, open_logged
from dslam_mav.commands.sweep_parts import TRUE, Estimate
from dslam_mav.dslam.field import squared_spread_m2
from dslam_mav.records import Medium, Sources
from dslam_mav.records.arrays import Array
from dslam_mav.sweep.points.columns import Row, Scalar
from dslam_mav.sweep.points.flown import Flown, Told, answered, row_of
from dslam_mav.sweep.points.judge import judged
from dslam_mav.sweep.points.seeds import generator
from sim_bridge.fields.scene import Scene, simulate

CLOSED_M = 0.05  # a path that ends so near where it began is said to close


@cache
def versions() -> dict[str, str]:
    """What a row depends on besides the point itself: other packages may end in other bits."""
    return {name: version(name) for name in PACKAGES}


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Where a point is flown: the scene, its noise included, begins at time 0; the path's vertices are (L+1, 2)."""

    scene: Scene
    vertices_m: Array


@dataclass(frozen=True, slots=True, eq=False)
class SceneJob:
    """A simulated flight. Its randomness follows from scene, mission, noise and seed by name: all methods are given the
    same readings.
    """

    key: str
    coordinates: dict[str, Scalar]
    place: Place
    told: Estimate
    method: Literal["joint", "paper"]
    seed: int

    def run(self) -> Row:
        """Fly, estimate, judge."""
        at = self.coordinates
        rng = generator(self.seed, at["scene"], at["mission"], at["noise"])
        flown = _flown(self.place, rng)
        told = told_of(self.place.scene, self.place.vertices_m, self.told, self.method)
        begun_s = time.perf_counter()
        answer = answered(flown, told, rng)
        seconds = time.perf_counter() - begun_s
        return row_of(flown, told, answer) | {"seconds": seconds, "noise_snr_db": _snr_db(self.place, flown.noise_sd)}


def _snr_db(place: Place, noise_sd: float) -> float | None:
    return 10.0 * math.log10(place.scene.mean_square(place.vertices_m) / noise_sd**2) if noise_sd > 0.0 else None


def _flown(place: Place, rng: np.random.Generator) -> Flown:
    scene, vertices = place.scene, place.vertices_m
    medium = scene.medium
    c = squared_spread_m2(0.0, medium.diffusivity_m2_s, scene.activation_s)
    peak = scene.amplitude / (np.pi * c)
    sources = Sources(scene.source_position_m, scene.amplitude, peak, scene.activation_s)
    flight = simulate(scene, vertices, rng)
    return Flown(flight, vertices, sources, scene.noise_sd(vertices), scene.sampling.speed_m_s)


def told_of(scene: Scene, vertices_m: Array, asked: Estimate, method: Literal["joint", "paper"]) -> Told:
    """What the estimator is told of a scene that begins at time 0."""
    n_sources = len(scene.sources) if asked.n_sources == TRUE else asked.n_sources
    return Told(
        medium_told(scene, known_of(scene, asked)),
        n_sources if isinstance(n_sources, int) else None,
        max_sources=asked.max_sources,
        method=method,
        closed=asked.closed and bool(np.allclose(vertices_m[0], vertices_m[-1], rtol=0.0, atol=CLOSED_M)),
        heading_sd_rad=None if asked.heading_sd_deg is None else float(np.deg2rad(asked.heading_sd_deg)),
    )


def known_of(scene: Scene, asked: Estimate) -> frozenset[str]:
    """What is known of the medium; all of it, unless the file says."""
    if asked.known is not None:
        return frozenset(asked.known)
    return frozenset(("spread", "ambient") if scene.medium.static else ("diffusivity", "activation", "ambient"))


def medium_told(scene: Scene, known: frozenset[str]) -> Medium:
    """The medium with what is known of it. √C known is μ and τ known."""
    m, times = scene.medium, tuple(scene.activation_s.tolist())
    ambient, alike = (m.ambient if "ambient" in known else None), len(set(times)) == 1
    spread = "spread" in known
    if spread and alike:
        c = float(squared_spread_m2(0.0, m.diffusivity_m2_s, times[0]))
        return Medium(spread_m=c**0.5, static=True, ambient=ambient)
    rate = m.diffusivity_m2_s if spread or "diffusivity" in known else None
    if spread or "activation" in known:
        return Medium(rate, times[0] if alike else times, ambient=ambient, static=m.static)
    return Medium(rate, "shared" if alike else None, ambient=ambient, static=m.static)


@dataclass(frozen=True, slots=True, eq=False)
class LogJob:
    """A flight that was flown, its log replayed with the options' assumptions."""

    key: str
    coordinates: dict[str, Scalar]
    path: Path
    options: Namespace

    def run(self) -> Row:
        """Read, estimate; judge where the log knows the truth."""
        logged = open_logged(self.path, self.options)
        begun_s = time.perf_counter()
        outcome = estimate_again(logged)
        seconds = time.perf_counter() - begun_s
        assert outcome.estimate is not None
        answer = outcome.estimate
        return judged(answer, outcome.flight, outcome.truth, answer.spread_m) | {"seconds": seconds}
