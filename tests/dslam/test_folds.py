"""Alternatives that are folds of the answer: all of them are listed, not only those that rounds happen to draw."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from numpy.typing import NDArray
from random_scenes import matched_error_m

from dslam_mav import Flight, Leg, Medium, Verdict, estimate
from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.compress import Samples, compress
from dslam_mav.dslam.field import field
from dslam_mav.dslam.folds import folded, with_folds
from dslam_mav.dslam.modes import Modes

Array = NDArray[np.float64]

SOURCES = np.array([[0.4, 0.0], [2.1, 0.0]])
AMPLITUDE = np.array([120.0, 80.0])
# Corners 2 and 4 lie on the sources' line: the path may go on on either side of it after each.
TO_CORNERS = np.array([[0.0, -1.5], [1.2, -1.9], [1.3, 0.0], [2.8, 1.2], [3.0, 0.0], [0.9, 1.1], [-0.6, 0.2]])
CROSSINGS = (2, 4)
NOISE_SD = 0.4


def flown(vertices: Array, seed: int | None) -> tuple[list[Samples], Flight]:
    """Readings along the polyline, with noise of a seed."""
    rng = np.random.default_rng(seed)
    samples, legs, start_s = [], [], 0.0
    for a, b in pairwise(vertices):
        length = float(np.linalg.norm(b - a))
        s = length * np.arange(64) / 64
        y = field(a + s[:, None] * (b - a) / length, 1.0, SOURCES, AMPLITUDE)
        y = y if seed is None else y + NOISE_SD * rng.standard_normal(64)
        samples.append(Samples(length, s, y, np.ones(64)))
        legs.append(Leg(length, s, start_s + s, y))
        start_s += length
    return samples, Flight(tuple(legs))


def beyond(vertices: Array, corners: tuple[int, ...]) -> Array:
    """The path that goes on on the other side of the sources' line after each of the corners."""
    out = vertices.copy()
    for corner in corners:
        out[corner:, 1] *= -1.0
    return out


ALL_PATHS = [
    beyond(TO_CORNERS, tuple(c for c, taken in zip(CROSSINGS, taken, strict=True) if taken))
    for taken in product((False, True), repeat=2)
]


@pytest.mark.parametrize("medium", [Medium(spread_m=1.0, static=True), Medium(static=True)])
@pytest.mark.parametrize("seed", range(3))
def test_every_fold_is_listed(medium: Medium, seed: int) -> None:
    result = estimate(flown(TO_CORNERS, seed)[1], medium, 2)
    assert result.verdict is Verdict.AMBIGUOUS
    listed = [result, *result.alternatives]
    likelihood = [mode.log_likelihood for mode in result.alternatives]
    assert likelihood == sorted(likelihood, reverse=True)
    for path in ALL_PATHS:
        canonical = to_canonical(path)
        corners, sources = canonical.apply(path), canonical.apply(SOURCES)
        off = [
            max(matched_error_m(mode, sources), float(np.abs(mode.path.vertices_m - corners).max())) for mode in listed
        ]
        assert min(off) < 0.5  # other paths are two away


def test_folds_over_the_sources_line_read_the_same() -> None:
    samples, _ = flown(TO_CORNERS, None)
    comp = compress(samples, 1.0, ambient_unknown=False, sigma=NOISE_SD)
    step = np.diff(TO_CORNERS, axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    alpha = np.log(AMPLITUDE / (np.pi * comp.sigma))
    truth = Modes(heading[None], (SOURCES - TO_CORNERS[0])[None], alpha[None], np.zeros(1))
    theta = folded(comp, truth).theta
    corners = np.cumsum(comp.legs.length[None, :, None] * np.stack([np.cos(theta), np.sin(theta)], axis=2), axis=1)
    for path in ALL_PATHS[1:3]:
        assert (np.abs(corners - (path[1:] - path[0])).max(axis=(1, 2)) < 1e-9).any()
    found = with_folds(comp, truth, 9.0, 25.0)
    assert (found.cost < 9.0).sum() >= len(ALL_PATHS)
