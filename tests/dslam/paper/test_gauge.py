"""Remark 3 and Appendix F: what the readings leave open, and how it is fixed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paper_scenes import fly

from dslam_mav import Medium
from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.paper import gauge
from dslam_mav.dslam.paper.method import estimate_by_paper
from missions.patterns import from_turns

PATH = from_turns(np.full(4, 5.0), np.deg2rad([136.0, 151.0, 154.0]))
SOURCES, AMPLITUDE = np.array([[2.81, 1.24], [3.92, -0.45], [0.93, 2.7]]), np.array([100.0, 70.0, 150.0])
STATIC = Medium(spread_m=1.0, static=True)


def moved(x, angle, mirrored, shift=(0.0, 0.0)):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.asarray(x) @ (turn @ np.diag([1.0, -1.0 if mirrored else 1.0])).T + np.asarray(shift)


@settings(max_examples=10, deadline=None)
@given(st.floats(0.0, 6.28), st.booleans(), st.floats(-50.0, 50.0), st.integers(2, 3))
def test_appendix_f_the_answer_does_not_change_with_an_orthogonal_transformation(angle, mirrored, shift, k):
    still = estimate_by_paper(fly(PATH, SOURCES[:k], AMPLITUDE[:k]), STATIC, k, 5)
    turned = fly(
        moved(PATH, angle, mirrored, (shift, -shift)),
        moved(SOURCES[:k], angle, mirrored, (shift, -shift)),
        AMPLITUDE[:k],
    )
    again = estimate_by_paper(turned, STATIC, k, 5)
    assert again.sources.position_m == pytest.approx(still.sources.position_m, abs=1e-8)
    assert again.path.vertices_m == pytest.approx(still.path.vertices_m, abs=1e-8)
    # (34): inner products between legs, and with sources, are the scene's.
    c = np.diff(again.path.vertices_m, axis=0)
    assert c @ c.T == pytest.approx(np.diff(PATH, axis=0) @ np.diff(PATH, axis=0).T, abs=1e-8)


def test_canonical_in_the_plane_is_the_projects():
    for turns in ([140.0, 95.0], [-140.0, 95.0], [0.0, -30.0]):
        path = moved(from_turns(np.full(3, 2.0), np.deg2rad(turns)), 1.1, False, (3.0, 4.0))
        direction = np.diff(path, axis=0) / 2.0
        assert gauge.canonical(direction).rotation == pytest.approx(to_canonical(path).rotation)


def test_canonical_in_space():
    rng = np.random.default_rng(1)
    direction = rng.normal(size=(6, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    turned = direction @ gauge.canonical(direction).rotation.T
    assert turned[0] == pytest.approx([1.0, 0.0, 0.0])
    assert turned[1, 2] == pytest.approx(0.0)
    assert turned[1, 1] > 0.0
    assert turned[2, 2] > 0.0
    assert turned @ turned.T == pytest.approx(direction @ direction.T)


@pytest.mark.parametrize("mirrored", [False, True])
def test_known_points_anchor_the_answer_mirror_image_included(mirrored):
    path, sources = moved(PATH, 0.7, mirrored, (10.0, 20.0)), moved(SOURCES, 0.7, mirrored, (10.0, 20.0))
    known = {i: path[i] for i in (0, 1, 2)}
    result = estimate_by_paper(fly(path, sources, AMPLITUDE), STATIC, 3, 5, known_points=known)
    assert result.gauge == "anchored"
    assert result.diagnostics["mirror_known"]
    assert result.path.vertices_m == pytest.approx(path, abs=1e-8)
    assert result.sources.position_m == pytest.approx(sources[np.argsort(-AMPLITUDE)], abs=1e-8)


def test_points_on_a_line_leave_the_mirror_image_open_and_say_so():
    known = {0: [0.0, 0.0], 1: [0.0, 5.0]}
    result = estimate_by_paper(fly(PATH, SOURCES, AMPLITUDE), STATIC, 3, 5, known_points=known)
    assert not result.diagnostics["mirror_known"]
    assert result.path.vertices_m[:2] == pytest.approx(np.array([[0.0, 0.0], [0.0, 5.0]]), abs=1e-9)
    c = np.diff(result.path.vertices_m, axis=0)
    assert c[0, 0] * c[1, 1] - c[0, 1] * c[1, 0] > 0.0, "left stays left"


def test_sources_come_by_amplitude_whatever_their_order():
    for order in ([0, 1, 2], [2, 0, 1]):
        result = estimate_by_paper(fly(PATH, SOURCES[order], AMPLITUDE[order]), STATIC, 3, 5)
        assert result.sources.amplitude == pytest.approx([150.0, 100.0, 70.0], rel=1e-8)
