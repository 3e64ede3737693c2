"""Errors against truth: proper alignment, best matching, the paper's relative errors in the scene's frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from report_flights import estimate_near, star_flight, star_truth, without_positions

from dslam_mav.dslam import scoring
from dslam_mav.dslam.align import to_canonical
from dslam_mav.records import Path, Sources, Truth, Verdict


def exact(truth, gauge="canonical"):
    flight, clean = star_flight(truth, readings=4)
    estimate = estimate_near(truth, flight, clean)
    to = to_canonical(truth.vertices_m)
    place = to.apply if gauge == "canonical" else np.asarray
    order = np.argsort(-truth.amplitude)
    return replace(
        estimate,
        sources=Sources(
            place(truth.source_position_m[order]),
            truth.amplitude[order],
            truth.amplitude[order],
            np.full(len(order), np.nan),
        ),
        path=Path(place(truth.vertices_m), estimate.path.heading_rad),
        gauge=gauge,
    )


@settings(max_examples=25, deadline=None)
@given(
    turn=st.floats(-np.pi, np.pi),
    mirror=st.booleans(),
    shift=st.tuples(st.floats(-500, 500), st.floats(-500, 500)),
)
def test_perfect_estimate_has_no_error_wherever_the_scene_lies(turn, mirror, shift):
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    if mirror:
        rotation = rotation @ np.diag([1.0, -1.0])
    star = star_truth(3)
    truth = Truth(
        star.source_position_m @ rotation.T + shift,
        star.amplitude[[2, 0, 1]],
        star.vertices_m @ rotation.T + shift,
    )
    result = scoring.score(exact(truth), truth)
    assert result is not None
    assert np.allclose(result.source_error_m, 0.0, atol=1e-9)
    assert result.path_error_rms_m < 1e-9
    assert result.paper_sources < 1e-9
    assert result.paper_lines < 1e-6
    assert result.paper_amplitudes == 0.0
    assert result.matching == (1, 2, 0), "sources are matched by place, not by order"


def test_mirrored_estimate_is_wrong_and_not_aligned_away():
    truth = star_truth(2)
    estimate = exact(truth)
    flipped = replace(
        estimate,
        sources=replace(estimate.sources, position_m=estimate.sources.position_m * [1.0, -1.0]),
        path=Path(estimate.path.vertices_m * [1.0, -1.0], -estimate.path.heading_rad),
    )
    result = scoring.score(flipped, truth)
    assert result is not None
    assert result.path_error_rms_m > 5.0
    assert result.source_error_rms_m > 1.0


def test_known_offsets_give_known_errors():
    truth = Truth([[3.0, 4.0]], [10.0], [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]])
    estimate = exact_two_legs(truth)
    moved = replace(
        estimate,
        sources=Sources([[3.0, 4.5]], [11.0], [1.0], [np.nan]),
        path=Path([[0.0, 0.0], [2.0, 0.0], [2.3, 2.0]], [0.0, 1.4]),
    )
    result = scoring.score(moved, truth)
    assert result is not None
    assert result.source_error_m == pytest.approx([0.5])
    assert result.paper_sources == pytest.approx(0.1), "|S̃ − S| / |S| = 0.5 / 5"
    assert result.paper_amplitudes == pytest.approx(0.1)
    assert result.vertex_error_m == pytest.approx([0.0, 0.0, 0.3])
    # leg 1 is right; on leg 2 the offset grows from 0 to 0.3: mean square 0.03 over half of the path
    assert result.path_error_rms_m == pytest.approx(np.sqrt(0.5 * 0.09 / 3.0))
    s = (np.arange(200_000) + 0.5) / 200_000
    by_hand = 0.5 * np.mean(0.3 * s / np.hypot(2.0, 2.0 * s))
    assert result.paper_lines == pytest.approx(by_hand, rel=1e-6)


def exact_two_legs(truth):
    star = star_truth(1)
    flight, clean = star_flight(star, readings=4)
    estimate = estimate_near(star, flight, clean)
    return replace(
        estimate, sources=Sources(truth.source_position_m, truth.amplitude, [1.0], [np.nan]),
        path=Path(truth.vertices_m, [0.0, np.pi / 2]),
    )  # fmt: skip


def test_paper_lines_is_infinite_where_only_truth_meets_home():
    assert scoring.paper_line_error(np.array([[-1.0, 0.1], [1.0, 0.1]]), np.array([[-1.0, 0.0], [1.0, 0.0]])) == float(
        "inf"
    )
    both = scoring.paper_line_error(np.array([[0.0, 0.0], [0.0, 2.0]]), np.array([[0.0, 0.0], [2.0, 0.0]]))
    assert both == pytest.approx(np.sqrt(2.0)), "both start at home: a constant quotient"


def test_another_number_of_sources_is_matched_as_far_as_it_goes():
    truth = star_truth(3)
    flight, clean = star_flight(truth, readings=4)
    two = estimate_near(star_truth(2), flight, clean)
    result = scoring.score(two, truth)
    assert result is not None
    assert not result.same_number
    assert result.matching == (0, 1)
    few = scoring.score(estimate_near(truth, flight, clean), star_truth(2))
    assert few is not None
    assert few.matching.count(None) == 1
    assert np.isnan(few.source_error_m).sum() == 1
    assert np.isfinite(few.source_error_rms_m)


def test_anchored_estimates_are_compared_as_they_are():
    truth = star_truth(2)
    result = scoring.score(exact(truth, "anchored"), truth)
    assert result is not None
    assert result.source_error_rms_m == 0.0
    shifted = Truth(truth.source_position_m + 3.0, truth.amplitude, truth.vertices_m + 3.0)
    result = scoring.score(exact(truth, "anchored"), shifted)
    assert result is not None
    assert result.source_error_m == pytest.approx([3.0 * np.sqrt(2.0)] * 2)


def test_nothing_to_compare_is_none(case):
    truth, _, estimate = case
    assert scoring.score(without_positions(estimate, Verdict.NOT_CONVERGED, ""), truth) is None
    standing = Truth(truth.source_position_m, truth.amplitude, np.zeros((8, 2)))
    assert scoring.score(estimate, standing) is None
