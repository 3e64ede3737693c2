"""The best mission sees better than stars of its length, keeps to its limits, and holds off its prior too."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dslam_mav.dslam.expected import Sensing, errors_on
from dslam_mav.dslam.layouts import Prior, Region, drawn, noise_below
from missions import best as searching
from missions.best import STARS, Wish, best_path
from missions.fence import Fence, box
from missions.patterns import centred, from_turns, star

BOX = Region((-1.6, -1.6), (1.6, 1.6))
LENGTH = 22.4
PRIOR = Prior((2, 4), (1.0, 1.0), BOX)
SENSING = Sensing(noise_below(drawn(PRIOR, 300, np.random.default_rng(9)), BOX, 20.0), 20.0)


def median(path, spread=1.0, count=450, prior=PRIOR):
    """Over layouts that no search has seen."""
    fresh = Prior(prior.k_sources, (spread, spread), prior.region)
    groups = drawn(fresh, count, np.random.default_rng(77))
    return float(np.median(np.concatenate([errors_on(path, group, SENSING).source for group in groups])))


def turns_of(path):
    step = np.diff(path, axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    return np.linalg.norm(step, axis=1), (np.diff(heading) + math.pi) % (2 * math.pi) - math.pi


@pytest.fixture(scope="module")
def best():
    told = []
    path = best_path(Wish(LENGTH), PRIOR, SENSING, np.random.default_rng(0), lambda done, of: told.append((done, of)))
    assert told[-1][0] == told[-1][1]
    assert [done for done, _ in told] == sorted(done for done, _ in told)
    return path


def test_it_sees_a_quarter_better_than_star_7_3(best):
    assert turns_of(best)[0].sum() == pytest.approx(LENGTH)
    assert median(centred(star(7, 3, LENGTH / 7))) > 1.25 * median(best)


def test_no_star_of_its_length_sees_better(best):
    stars = [centred(star(n, k, LENGTH / n)) for n, k in STARS]
    assert min(median(path) for path in stars) > median(best)


def test_it_holds_with_the_spread_misjudged_and_its_turns_off(best):
    seven = centred(star(7, 3, LENGTH / 7))
    for spread in (1.0 / 1.5, 1.5):
        assert median(best, spread) < median(seven, spread)
    lengths, turns = turns_of(best)
    heading = math.atan2(*(best[1] - best[0])[::-1])
    rng = np.random.default_rng(5)
    off = [best[0] + from_turns(lengths, turns + math.radians(5.0) * rng.standard_normal(turns.size), heading)
           for _ in range(5)]  # fmt: skip
    assert np.median([median(path) for path in off]) < 1.15 * median(best)


@pytest.fixture
def quick(monkeypatch):
    """A search with less care, where only its limits matter."""
    for name, value in {"STARTS": 8, "FINALISTS": 2, "ROUGHLY": 30, "TRAINING": 40, "CHOOSING": 60}.items():
        monkeypatch.setattr(searching, name, value)


def test_it_repeats_with_its_seed(quick):
    prior = Prior((2, 2), (1.0, 1.0), BOX)
    first, again = (best_path(Wish(12.0, legs=4), prior, SENSING, np.random.default_rng(3)) for _ in range(2))
    assert np.array_equal(first, again)


def test_fence_keep_out_zones_legs_and_turns_are_kept(quick):
    fence = Fence(
        (np.array([[-2.5, -2.5], [2.5, -2.5], [2.5, 2.5], [0.5, 2.5], [0.0, 0.8], [-2.5, 0.8]]),),
        (box((0.8, 0.8), (1.3, -0.6)),),
    )
    prior = Prior((2, 2), (1.0, 1.0), Region((-2.5, -2.5), (2.5, 2.5)))
    wish = Wish(20.0, 6, fence, 0.05, (math.radians(20.0), math.radians(150.0)))
    path = best_path(wish, prior, SENSING, np.random.default_rng(0))
    lengths, turns = turns_of(path)
    assert len(lengths) == 6
    assert lengths.sum() == pytest.approx(20.0)
    assert fence.lets_pass(path, 0.05)
    assert (np.abs(turns) <= math.radians(150.0) + 1e-9).all()
    assert (np.abs(turns) >= math.radians(20.0) - 1e-9).all()


def test_a_room_too_small_for_legs_so_long_gives_none(quick):
    wish = Wish(40.0, 3, Fence((box((3.0, 3.0)),)))
    assert best_path(wish, Prior((2, 2), (1.0, 1.0), BOX), SENSING, np.random.default_rng(0)) is None
