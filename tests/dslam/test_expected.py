"""What a path leaves to expect of many layouts is what the bound says of each, and its derivatives are derivatives."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from dslam_mav import Medium, bound
from dslam_mav.dslam import expected
from dslam_mav.dslam.expected import Sensing, errors_flown, errors_on, log_errors
from dslam_mav.dslam.inverses import inverses
from dslam_mav.dslam.layouts import Layouts, Prior, Region, drawn, noise_below
from dslam_mav.dslam.outlook import outlook, reason
from dslam_mav.records import Sources
from missions.patterns import centred, from_turns, lawnmower, star

BOX = Region((-1.6, -1.6), (1.6, 1.6))
STAR = centred(star(7, 3, 3.2))
CLIMBING = np.column_stack([centred(star(8, 3, 3.2)), 1.2 * (np.arange(9) % 2)])


def layouts(k: int, count: int, seed: int = 0, **given: object) -> Layouts:
    return drawn(replace(Prior((k, k), (1.0, 1.0), BOX), **given), count, np.random.default_rng(seed))[0]


@pytest.mark.parametrize(
    ("path", "known", "rate"),
    [
        (STAR, {}, 0.0),
        (STAR, {"heading_sd_rad": 0.05}, 0.0),
        (STAR, {"length_sd_m": 0.03}, 0.0),
        (STAR, {"ambient_unknown": True, "spread_unknown": True}, 0.0),
        (STAR, {"closed": True}, 0.0),
        (STAR, {}, 0.02),
        (CLIMBING, {}, 0.0),
    ],
)
def test_every_layout_gets_the_bound_of_its_own(path, known, rate):
    sensing = Sensing(0.01, 20.0, **known)
    region = BOX if path.shape[1] == 2 else Region((-1.6, -1.6, 0.0), (1.6, 1.6, 1.2))
    group = layouts(3, 4, region=region, rate_m2_s=rate)
    seen = errors_on(path, group, sensing)
    for i in range(len(group)):
        d = path.shape[1]
        medium = Medium(
            spread_m=None if sensing.spread_unknown else 1.0,
            static=True,
            ambient=None if sensing.ambient_unknown else 0.0,
            dimensions=d,
        )
        if rate:
            medium = Medium(diffusivity_m2_s=0.25 * rate, activation_s=-1.0 / rate)
        age = np.full(3, -1.0 / rate if rate else np.nan)
        here = bound(
            path, Sources(group.places[i], group.peak[i] * np.pi ** (0.5 * d), group.peak[i], age), medium,
            readings_per_leg=64 if d == 2 else 68, speed_m_s=1.0, noise_sd=0.01,
            heading_sd_rad=sensing.heading_sd_rad, length_sd_m=sensing.length_sd_m, closed=sensing.closed,
        )  # fmt: skip

        def rms(blocks):
            return np.sqrt(np.trace(blocks, axis1=1, axis2=2).mean())

        assert seen.source[i] == pytest.approx(rms(here.position_covariance_m2), rel=0.02)
        assert seen.path[i] == pytest.approx(np.sqrt((here.vertex_sd_m**2).mean()), rel=0.02)
        if d == 2:
            assert seen.source_aligned[i] == pytest.approx(rms(here.aligned_covariance_m2), rel=0.02)
        assert here.identifiable != seen.blind[i]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(
    "known", [{}, {"length_sd_m": 0.03, "spread_unknown": True, "ambient_unknown": True, "heading_sd_rad": 0.1}]
)
def test_derivatives_by_the_vertices_are_those_of_differences(monkeypatch, known, d):
    rng = np.random.default_rng(1)
    region = BOX if d == 2 else Region((-1.6, -1.6, -0.5), (1.6, 1.6, 0.5))
    group, sensing = layouts(3, 5, region=region), Sensing(0.03, 20.0, **known)
    paths = np.broadcast_to(np.column_stack([STAR, np.zeros(8)])[:, :d], (5, 8, d))
    paths = paths + 0.1 * rng.standard_normal(paths.shape)
    points = expected._points(paths, group, sensing, 6.0)
    monkeypatch.setattr(expected, "_points", lambda *_: points)  # how many there are is no matter of degree
    moves = log_errors(paths, group, sensing)[1]
    for _ in range(3):
        way = 1e-5 * rng.standard_normal(paths.shape)
        change = log_errors(paths + way, group, sensing)[0] - log_errors(paths - way, group, sensing)[0]
        assert 0.5 * change == pytest.approx((moves * way).sum(axis=(1, 2)), rel=1e-4)


def test_two_hundred_layouts_of_three_take_well_under_two_seconds():
    group, sensing = layouts(3, 200), Sensing(0.1, 20.0)
    errors_on(STAR, group, sensing)
    begun = time.perf_counter()
    outlook(STAR, [group], sensing)
    assert time.perf_counter() - begun < 1.0


def test_flights_scatter_as_the_bound_says():
    group, sensing = layouts(3, 200), Sensing(0.05, 20.0)
    bounds, flights = errors_on(STAR, group, sensing), errors_flown(STAR, group, sensing, np.random.default_rng(0))
    kept = ~bounds.blind
    share = (flights.source.reshape(200, -1)[kept] / bounds.source[kept, None]) ** 2
    assert share.mean() == pytest.approx(1.0, abs=0.1)
    assert np.median(flights.source) < np.median(bounds.source)


def test_a_star_sees_and_a_path_that_marches_out_of_the_area_does_not():
    groups = [layouts(2, 60), layouts(3, 60)]
    sensing = Sensing(noise_below(groups, BOX, 20.0), 20.0)
    assert not outlook(STAR, groups, sensing).poor
    blind = outlook(centred(lawnmower(3.2, 7), (6.0, 0.0)), groups, sensing)
    assert blind.blind
    assert blind.unidentifiable_share == pytest.approx(1.0, abs=0.02)


def test_one_source_is_seen_with_a_compass_only():
    group, path = layouts(1, 60), from_turns(np.full(6, 4.0), np.full(5, 2.5))
    path = centred(path)
    without = outlook(path, [group], Sensing(0.05, 20.0))
    assert without.blind
    assert "compass" in reason(path, [group], Sensing(0.05, 20.0))
    assert not outlook(path, [group], Sensing(0.05, 20.0, heading_sd_rad=0.05)).poor


@pytest.mark.parametrize(
    ("path", "words"),
    [
        (centred(star(3, 1, 4.0)), "3 legs"),
        (centred(lawnmower(3.2, 7)), "2 directions"),
        (centred(star(5, 2, 1.0), (3.0, 3.0)), "from every leg"),
    ],
)
def test_the_reason_names_what_is_wrong(path, words):
    assert words in reason(path, [layouts(2, 60)], Sensing(0.05, 20.0))


def test_layouts_keep_to_what_is_known():
    prior = Prior((2, 4), (0.8, 1.2), Region((0.0, -2.0), (6.0, 2.0), lambda p: p[:, 0] > p[:, 1] + 1.0))
    groups = drawn(prior, 100, np.random.default_rng(0))
    assert [group.k_sources for group in groups] == [2, 3, 4]
    assert sum(len(group) for group in groups) == 100
    for group in groups:
        assert ((group.spread_m >= 0.8) & (group.spread_m <= 1.2)).all()
        places = group.places.reshape(-1, 2)
        assert (places >= [0.0, -2.0]).all()
        assert (places <= [6.0, 2.0]).all()
        assert (places[:, 0] > places[:, 1] + 1.0).all()
        gaps = np.linalg.norm(group.places[:, :, None] - group.places[:, None], axis=3) + 10.0 * np.eye(group.k_sources)
        assert (gaps.min(axis=(1, 2)) >= 0.8 * group.spread_m).all()


def test_what_cannot_be_is_a_value_error():
    with pytest.raises(ValueError, match="8 sources"):
        layouts(8, 1, region=Region((0.0, 0.0), (1.0, 1.0)))
    with pytest.raises(ValueError, match="√C long"):
        errors_on(1e4 * STAR, layouts(2, 1), Sensing(0.1, 20.0))


def test_a_matrix_without_an_inverse_is_a_layout_that_is_not_seen():
    good, known = np.diag([2.0, 4.0]), np.full((3, 2), 0.25)
    found = inverses(np.array([good, np.ones((2, 2)), np.full((2, 2), np.nan)]), known)
    assert found[0] == pytest.approx(np.diag([0.5, 0.25]))
    assert found[1:] == pytest.approx(np.broadcast_to(4.0 * np.eye(2), (2, 2, 2)))
    assert errors_on(STAR, layouts(3, 4), Sensing(1e-160, 20.0)).blind.all()
