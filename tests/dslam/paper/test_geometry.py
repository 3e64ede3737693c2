"""III-B, III-C, Appendices C, D, E on exact projections: known layouts, and what each step says when it has none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paper_scenes import pairwise_distances, projections

from dslam_mav.dslam.paper import closed, distances, factorise, pairing
from dslam_mav.dslam.paper.geometry import layouts
from dslam_mav.dslam.paper.layout import Failure, vertices
from missions.patterns import from_turns, star

AMPLITUDE = np.array([100.0, 70.0, 150.0, 90.0])
SOURCES = np.array([[1.0, 0.4], [2.1, 1.6], [0.4, 2.0], [2.6, 0.2]])
PATH = from_turns(np.array([4.0, 3.5, 4.2, 3.8, 3.0]), np.deg2rad([140.0, 95.0, 150.0, -120.0]))


def off(layout, path, position):
    found = pairwise_distances(vertices(layout.direction, np.linalg.norm(np.diff(path, axis=0), axis=1)), layout.source)
    return np.abs(found - pairwise_distances(path, position)).max()


def nearest(found, path, position):
    return min(off(layout, path, position) for layout in found)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_pairing_puts_every_shuffled_centre_back_to_its_source(seed):
    rng = np.random.default_rng(seed)
    p = projections(PATH, SOURCES, AMPLITUDE)
    order = [np.arange(4), *(rng.permutation(4) for _ in range(4))]
    small = np.tile(1e-18 * np.eye(2), (4, 1, 1))
    legs = [
        pairing.LegPeaks(p.y[o, j], p.a[o, j], np.ones(4), small, np.ones(4), np.zeros(4)) for j, o in enumerate(order)
    ]
    found = pairing.chains(legs, p.length, 2)
    assert np.abs(found[0].y - p.y).max() == 0.0


def test_a_coincidence_of_footnote_1_keeps_both_pairings():
    """Two sources equally far from b_2 and equally strong: (11) holds for either pairing."""
    corner = np.array([4.0, 0.0])
    path = np.array([[0.0, 0.0], corner, [2.0, 3.5], [0.5, -0.5]])
    sources = corner + 2.0 * np.array([[-0.6, 0.8], [-0.96, 0.28]])
    p = projections(path, sources, [100.0, 100.0])
    small = np.tile(1e-16 * np.eye(2), (2, 1, 1))
    legs = [pairing.LegPeaks(p.y[:, j], p.a[:, j], np.ones(2), small, np.ones(2), np.zeros(2)) for j in range(3)]
    found = pairing.chains(legs, p.length, 2)
    assert len(found) == 2
    assert min(np.abs(f.y - p.y).max() for f in found) == 0.0


def test_pairing_of_an_evolving_field_finds_each_sources_own_amplitude():
    c = 1.0 + 0.08 * np.arange(5)
    p = projections(PATH, SOURCES, AMPLITUDE)
    d2 = -np.log(p.a * np.pi / AMPLITUDE[:, None])  # C = 1 there
    small = np.tile(1e-12 * np.eye(2), (4, 1, 1))
    legs = [
        pairing.LegPeaks(
            np.roll(p.y[:, j], j),
            np.roll(AMPLITUDE / (np.pi * c[j]) * np.exp(-d2[:, j] / c[j]), j),
            np.full(4, c[j]),
            small,
            np.ones(4),
            np.zeros(4),
        )
        for j in range(5)
    ]
    found = pairing.chains(legs, p.length, 2)
    assert min(np.abs(f.y - p.y).max() for f in found) == 0.0


@pytest.mark.parametrize(("k", "legs"), [(3, 3), (3, 5), (4, 3), (4, 5)])
def test_factorisation_finds_the_layout(k, legs):
    path = PATH[: legs + 1]
    found = factorise.factorise(projections(path, SOURCES[:k], AMPLITUDE[:k]))
    assert off(found, path, SOURCES[:k]) < 1e-12
    assert found.ln_amplitude == pytest.approx(np.log(AMPLITUDE[:k]), abs=1e-11)


@settings(max_examples=30, deadline=None)
@given(st.permutations(range(4)), st.floats(0.0, 6.28), st.booleans(), st.floats(0.01, 100.0))
def test_no_turn_mirror_order_or_unit_changes_the_shape(order, angle, mirrored, unit):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turn = turn @ np.diag([1.0, -1.0 if mirrored else 1.0]) * unit
    path, sources = PATH @ turn.T + 7.0, (SOURCES @ turn.T + 7.0)[list(order)]
    found = factorise.factorise(projections(path, sources, AMPLITUDE[list(order)], c=unit**2))
    assert off(found, path, sources) < 1e-10 * unit
    assert found.ln_amplitude == pytest.approx(np.log(AMPLITUDE[list(order)]), abs=1e-9)


def test_factorisation_in_space():
    rng = np.random.default_rng(1)
    path, sources = rng.normal(size=(8, 3)) * 2.0, rng.uniform(-1.5, 1.5, (4, 3))
    found = factorise.factorise(projections(path, sources, AMPLITUDE))
    assert off(found, path, sources) < 1e-9
    assert found.ln_amplitude == pytest.approx(np.log(AMPLITUDE), abs=1e-8)


def test_factorisation_says_why_it_fails():
    line = np.array([[0.0, 0.0], [1.0, 0.5], [2.0, 1.0]])
    assert "a line" in factorise.factorise(projections(PATH, line, AMPLITUDE[:3])).reason
    two_axes = from_turns(np.full(4, 3.0), np.deg2rad([120.0, -120.0, 120.0]))
    assert "Fewer than three leg axes" in factorise.factorise(projections(two_axes, SOURCES[:3], AMPLITUDE[:3])).reason
    assert "needs 3 sources and 3 legs" in factorise.factorise(projections(PATH[:3], SOURCES[:3], AMPLITUDE[:3])).reason
    rng = np.random.default_rng(2)
    on_cone = np.vstack((np.zeros(3), np.cumsum([[np.cos(a), np.sin(a), 0.7] for a in rng.uniform(0, 6, 7)], axis=0)))
    assert "cone" in factorise.factorise(projections(on_cone, rng.normal(size=(4, 3)), AMPLITUDE)).reason
    p = projections(PATH[:4], SOURCES[:3], AMPLITUDE[:3])
    wrong = p._replace(y=p.y * np.array([1.0, 1.0, 6.0]))
    assert "not positive definite" in factorise.factorise(wrong).reason


def test_three_sources_on_a_line_fall_back_on_pairs():
    line = np.array([[0.0, 0.3], [1.0, 0.8], [2.4, 1.5]])
    found = layouts(projections(PATH, line, AMPLITUDE[:3]), closed=False)
    assert nearest(found, PATH, line) < 1e-9
    assert "distances of sources" in found[0].how


def test_the_determinants_vanish_at_the_true_distances():
    """The form b_j p + a_j q − 2 g_j r + a_j b_j − g_j² = 0, with p, q, r from the scene itself."""
    p = projections(PATH, SOURCES[:2], AMPLITUDE[:2])
    normal = np.array([-(PATH[1] - PATH[0])[1], (PATH[1] - PATH[0])[0]]) / p.length[0]
    d = (SOURCES[:2] - PATH[0]) @ normal
    a, b, g = distances.cumulative_sums(p).T
    left = b * d[0] ** 2 + a * d[1] ** 2 - 2.0 * g * d[0] * d[1] + a * b - g**2
    assert np.abs(left).max() < 1e-11


@pytest.mark.parametrize("legs", [4, 5])
def test_two_sources_on_four_legs_have_one_layout(legs):
    path = PATH[: legs + 1]
    found = distances.by_distances(projections(path, SOURCES[:2], AMPLITUDE[:2]))
    assert len(found) == 1
    assert off(found[0], path, SOURCES[:2]) < 1e-10


def test_two_sources_on_three_legs_have_one_or_two_layouts_the_truth_among_them():
    rng = np.random.default_rng(3)
    count = []
    for _ in range(200):
        path = from_turns(np.full(3, 4.0), np.deg2rad(rng.uniform(60.0, 160.0, 2)))
        sources = path.mean(axis=0) + rng.uniform(-1.5, 1.5, (2, 2))
        found = distances.by_distances(projections(path, sources, AMPLITUDE[:2]))
        count.append(len(found))
        assert nearest(found, path, sources) < 1e-6
    assert set(count) == {1, 2}
    assert 0.3 < count.count(2) / 200.0 < 0.85  # "both in about half of random cases" (theory, section 5)


def test_a_source_on_a_leg_keeps_its_digits():
    """d_1j = 0: its square's root would lose half of them."""
    sources = np.array([PATH[2] + 0.4 * (PATH[3] - PATH[2]), SOURCES[1]])
    found = distances.by_distances(projections(PATH, sources, AMPLITUDE[:2]))
    assert nearest(found, PATH, sources) < 1e-9


def test_footnote_4_with_four_legs_still_has_the_truth_among_its_layouts():
    """Legs 1, 2 at a right angle, both sources on the bisector of their corner: row 2 of (30) is zero."""
    path = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.3, 1.0], [3.4, 0.9]])
    sources = np.array([[2.0, 1.0], [1.2, 1.8]])
    p = projections(path, sources, AMPLITUDE[:2])
    assert np.abs(distances.cumulative_sums(p)[1]).max() < 1e-14
    assert nearest(distances.by_distances(p), path, sources) < 1e-7


def test_a_path_to_and_fro_is_degenerate_and_said_so():
    path = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 0.0], [3.0, 0.0], [0.0, 0.0]])
    found = distances.by_distances(projections(path, SOURCES[:2], AMPLITUDE[:2]))
    assert isinstance(found, Failure)
    assert "degenerate" in found.reason


def closed_triangle(a, b, c):
    cosine = (c**2 - a**2 - b**2) / (2.0 * a * b)
    return np.vstack((from_turns(np.array([a, b]), np.array([np.arccos(cosine)])), [0.0, 0.0]))


@pytest.mark.parametrize("sides", [(3.0, 3.0, 3.0), (4.0, 5.0, 3.5), (2.0, 4.0, 5.0)])
def test_one_source_in_a_closed_triangle(sides):
    path = closed_triangle(*sides)
    p = projections(path, [[1.2, 0.9]], [100.0])
    (found,) = closed.by_closure(p)
    assert off(found, path, [[1.2, 0.9]]) < 1e-13
    assert abs(closed.defect(p)) < 1e-12
    assert closed.defect(p._replace(y=p.y + np.array([0.0, 0.0, 0.3]))) == pytest.approx(0.3)


@pytest.mark.parametrize(
    "path",
    [star(5, 2, 4.0), star(7, 3, 3.2), np.array([[0.0, 0.0], [4.0, 0.0], [5.0, 3.0], [1.0, 4.0], [0.0, 0.0]])],
)
def test_one_source_on_a_closed_path_of_many_legs(path):
    source = path[:-1].mean(axis=0)[None] + np.array([[0.31, -0.17]])
    found = closed.by_closure(projections(path, source, [100.0]))
    assert nearest(found, path, source) < 1e-9
    for layout in found:
        length = np.linalg.norm(np.diff(path, axis=0), axis=1)
        assert np.linalg.norm(vertices(layout.direction, length)[-1]) < 1e-6


def test_what_closes_no_triangle_is_said():
    p = projections(closed_triangle(3.0, 3.0, 3.0), [[1.0, 1.0]], [100.0])
    assert "close no triangle" in closed.by_closure(p._replace(length=np.array([1.0, 1.0, 3.0]))).reason
    assert "open path" in layouts(p, closed=False).reason
