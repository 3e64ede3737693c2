"""Legs in space, their climbs known or not: the start is found, and what cannot be known is said."""

from __future__ import annotations

from itertools import pairwise, permutations

import numpy as np
import pytest

from dslam_mav import Flight, Leg, Medium, estimate
from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.field import field
from dslam_mav.records import Verdict
from missions.patterns import star

CLIMB_RAD = np.deg2rad(35.0)
LEG_M = 3.5


def _flown(seed, k_sources, *, known=True, ambient=0.0, directions=None):
    """Star {8/3} climbing and falling by turns, at 40 dB; truth in the canonical gauge."""
    rng = np.random.default_rng(seed)
    if directions is None:
        heading = np.arctan2(*np.diff(star(8, 3, 1.0), axis=0).T[::-1])
        climb = CLIMB_RAD * (-1.0) ** np.arange(8)
        directions = np.stack([np.cos(climb) * np.cos(heading), np.cos(climb) * np.sin(heading), np.sin(climb)], 1)
    path = LEG_M * np.vstack([np.zeros(3), np.cumsum(directions, axis=0)])
    while True:
        sources = path[:-1].mean(axis=0) + rng.uniform(-1.0, 1.0, (k_sources, 3))
        if all(np.linalg.norm(a - b) > 1.0 for i, a in enumerate(sources) for b in sources[:i]):
            break
    amplitude = 50.0 * 2.0 ** rng.random(k_sources)
    s = LEG_M * np.arange(48) / 48
    clean = [field(a + np.outer(s, b - a) / LEG_M, 1.0, sources, amplitude) for a, b in pairwise(path)]
    sd = 0.01 * float(np.sqrt(np.mean(np.square(clean))))
    legs = tuple(
        Leg(LEG_M, s, LEG_M * j + s, y + ambient + sd * rng.standard_normal(48), rise_m=(b - a)[2] if known else None)
        for j, ((a, b), y) in enumerate(zip(pairwise(path), clean, strict=True))
    )
    return Flight(legs), to_canonical(path).apply(sources), sd


def _off(position, truth):
    orders = permutations(range(len(truth)))
    return min(float(np.linalg.norm(position[list(order)] - truth, axis=1).max()) for order in orders)


@pytest.mark.parametrize("k_sources", [2, 3])
def test_known_climbs_are_enough(k_sources):
    for seed in range(2):
        flight, truth, sd = _flown((41, seed), k_sources)
        result = estimate(flight, Medium(spread_m=1.0, static=True, dimensions=3), k_sources)
        assert result.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
        assert 0.85 * sd < result.noise_sd < 1.15 * sd
        answers = [result, *result.alternatives]
        nearest = min(answers, key=lambda e: _off(e.sources.position_m, truth))
        assert _off(nearest.sources.position_m, truth) < 6.0 * nearest.sd_m.max()
        assert _off(nearest.sources.position_m, truth) < 0.3


def test_an_unknown_spread_and_ambient_level_are_found_in_space():
    flight, truth, _ = _flown((42, 0), 2, ambient=3.0)
    result = estimate(flight, Medium(static=True, ambient=None, dimensions=3), 2)
    assert result.spread_m == pytest.approx(1.0, abs=0.1)
    assert result.medium.ambient == pytest.approx(3.0, abs=0.1)
    assert min(_off(e.sources.position_m, truth) for e in (result, *result.alternatives)) < 0.3


def test_the_same_seed_gives_the_same_bits():
    flight, _, _ = _flown((43, 0), 2)
    medium = Medium(spread_m=1.0, static=True, dimensions=3)
    first, again = (estimate(flight, medium, 2, seed=5) for _ in range(2))
    np.testing.assert_array_equal(first.sources.position_m, again.sources.position_m)


def test_free_climbs_over_a_plane_are_never_called_identified():
    heading = np.arctan2(*np.diff(star(8, 3, 1.0), axis=0).T[::-1])
    flat = np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=1)
    flight, _, _ = _flown((44, 0), 2, known=False, directions=flat)
    result = estimate(flight, Medium(spread_m=1.0, static=True, dimensions=3), 2)
    assert result.verdict in (Verdict.NOT_IDENTIFIABLE, Verdict.AMBIGUOUS, Verdict.NOT_CONVERGED)
