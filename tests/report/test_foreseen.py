"""What was predicted beside what came of it, and how sure each leg made the flight: figures, marks, words."""

from __future__ import annotations

import math
import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_flights import expected, known_before, page_of, without_positions
from test_report_page import outline

from dslam_mav.dslam.scoring import score
from dslam_mav.records import Verdict
from dslam_mav.report import page as rendering
from dslam_mav.report.data import ReportData
from dslam_mav.report.data import page_of as data_of
from dslam_mav.report.log_axis import log_axis
from dslam_mav.report.numbers import significant

# V. Machado, Oliveira and Fernandes, 2009, at full severity, on linear RGB
DEFICIENCIES = {
    "none": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def shown(case, **changes):
    """What the page of the case holds, with its background."""
    truth, flight, estimate = case
    given = {"truth": truth, "estimate": estimate, "background": known_before(case)} | changes
    return data_of(ReportData(flight, given["estimate"], given["truth"], "A flight", background=given["background"]))


def test_predicted_and_realised_stand_side_by_side(case):
    truth, _, estimate = case
    page = shown(case)
    result = score(estimate, truth)
    assert page.foreseen is not None
    assert result is not None
    rows = {(row.name, row.note): (row.source_m, row.path_m) for row in page.foreseen.rows}
    assert rows["Predicted", "half of all flights"] == ("0.40", "0.30")
    assert rows["", "nine of ten"] == ("0.90", "0.70")
    assert rows["Realised", "error against truth"][0] == significant(result.source_error_rms_m, 2)
    own = math.sqrt(np.trace(estimate.position_covariance_m2, axis1=1, axis2=2).mean())
    assert rows["Realised", "the result’s own ±"][0] == significant(own, 2)
    assert ("Bound", "at the sources found") in rows
    assert [bar.name for bar in page.foreseen.bars] == ["Sources", "Corners"]  # the path's error is of all its length
    assert rows["Realised", "error against truth"][1] == significant(np.sqrt(np.mean(result.vertex_error_m**2)), 2)
    assert page.foreseen.basis.startswith("Recorded before take-off: for 3 sources anywhere in 32.0 × 31.2 m")


@pytest.mark.parametrize(
    ("predicted_m", "words"),
    [
        ((5.0, 9.0), "as good as expected or better"),
        ((0.3, 9.0), "within what nine of ten flights"),
        ((0.1, 0.2), "worse than nine of ten flights"),
        ((math.inf, math.inf), "was expected to see no sources"),
    ],
)
def test_the_sentence_weighs_what_came_against_what_was_expected(case, predicted_m, words):
    background = known_before(case, prediction=expected(source_error_m=predicted_m))
    text = outline(page_of(case, background=background)).text
    assert words in text
    assert not re.search(r"(?<![a-z])(nan|inf)(?![a-z])", text, re.IGNORECASE)


def test_what_lies_further_right_is_the_greater_error(case):
    seen = shown(case).foreseen
    assert seen is not None
    for bar, i in zip(seen.bars, ("source_m", "path_m"), strict=True):
        texts = {row.mark: getattr(row, i) for row in seen.rows}
        places = dict(bar.marks)
        by_place = sorted(places, key=lambda mark: places[mark])
        assert [float(texts[mark]) for mark in by_place] == sorted(float(texts[mark]) for mark in places)
        assert bar.range_x is not None
        assert bar.range_x[0] < bar.range_x[1]


def test_without_truth_the_results_own_word_is_weighed(case):
    text = outline(page_of(case, truth=None, background=known_before(case))).text
    assert "What the result says of its own error" in text
    assert "error against truth" not in text


def test_a_prediction_made_now_is_said_to_be(case):
    text = outline(page_of(case, background=known_before(case, predicted_then=False))).text
    assert "Worked out now, the log says nothing: for 3 sources" in text
    without = known_before(case, prediction=None)
    assert "Errors to expect" not in outline(page_of(case, background=without)).text


def test_without_positions_only_the_prediction_stands(case):
    _, _, estimate = case
    lost = without_positions(estimate, Verdict.NOT_CONVERGED, "No.")
    page = shown(case, estimate=lost)
    assert page.growth is None
    assert page.foreseen is not None
    assert page.foreseen.sentence.startswith("No position came of the flight")
    assert {row.mark for row in page.foreseen.rows} == {"range", ""}


def test_growth_draws_the_bound_and_what_was_known_then(case):
    _, _, estimate = case
    plot = shown(case).growth
    assert plot is not None
    assert [series.name for series in plot.series] == ["S1", "S2", "S3", "path"]
    assert [n for n, _ in plot.columns] == [3, 4, 5, 6, 7]
    assert [n for n, _ in plot.unanswered] == [3]
    for k, series in enumerate(plot.series[:3]):
        assert [point.leg for point in series.points] == [5, 7]
        five, seven = series.points
        assert five.y < seven.y, "less sure is further up"
        assert f"± {significant(float(estimate.sd_m[k]), 2)} m" in seven.text
        assert seven.unsure, "another answer fitted too"
        assert not five.unsure
        assert series.line.count("L") >= 3
    labels = sorted(series.label_y for series in plot.series)
    assert np.diff(labels).min() >= 14.9, "no label hides another"
    rows = {row.legs: row for row in plot.rows}
    assert rows[7].realised[0] == significant(float(estimate.sd_m[0]), 2)
    assert rows[3].realised == ("–",) * 4
    assert rows[3].verdict == "NOT_IDENTIFIABLE"


def test_sources_found_in_another_order_on_the_way_stay_themselves(case):
    from dataclasses import replace

    _, _, estimate = case
    back = [2, 1, 0]
    sources = estimate.sources
    turned = replace(
        estimate,
        sources=type(sources)(
            *(getattr(sources, n)[back] for n in ("position_m", "amplitude", "peak_reading", "activation_s"))
        ),
        position_covariance_m2=estimate.position_covariance_m2[back],
    )
    plot = shown(case, background=known_before(case, under_way=((6, turned),))).growth
    assert plot is not None
    assert {row.legs: row.realised for row in plot.rows}[6] == {row.legs: row.realised for row in plot.rows}[7]


def test_series_differ_for_colour_blind_eyes_and_by_their_marks_and_stand_out_from_paper():
    css = (Path(rendering.__file__).parent / "report.css").read_text()
    colours = {"path": "#000000", **dict(re.findall(r"\.(c[1-5]) \{ color: (#[0-9a-f]{6})", css))}
    assert len(colours) == 6
    linear = {name: to_linear(colour) for name, colour in colours.items()}
    for kind, matrix in DEFICIENCIES.items():
        lab = {name: to_lab(np.clip(np.asarray(matrix) @ rgb, 0.0, 1.0)) for name, rgb in linear.items()}
        near = {(a, b): float(np.linalg.norm(lab[a] - lab[b])) for a, b in combinations(lab, 2)}
        assert min(near.values()) > 10.0, (kind, min(near, key=lambda pair: near[pair]), min(near.values()))
    for name, rgb in linear.items():
        luminance = float(rgb @ [0.2126, 0.7152, 0.0722])
        assert 1.05 / (luminance + 0.05) >= 4.5, name
    shapes = re.findall(r'id="shape-\d"[^>]*', (Path(rendering.__file__).parent / "growth.jinja").read_text())
    assert len({shape.split(" ", 1)[1] for shape in shapes}) == 6


def to_linear(colour):
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def to_lab(rgb):
    """CIE L*a*b* under D65."""
    xyz = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
    )
    x, y, z = np.cbrt(xyz @ rgb / [0.95047, 1.0, 1.08883])
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


@given(st.lists(st.floats(1e-12, 1e12), min_size=1, max_size=8))
def test_a_logarithmic_axis_keeps_order_and_has_ticks(values):
    axis = log_axis([*values, math.inf, math.nan, 0.0], 10.0, 400.0)
    assert axis is not None
    assert len(axis.ticks) >= 2
    places = [axis.units(value) for value in sorted(values)]
    assert places == sorted(places)
    assert all(10.0 <= place <= 410.0 for place in [*places, *(place for place, _ in axis.ticks)])
    assert len({label for _, label in axis.ticks}) == len(axis.ticks)


def test_nothing_has_no_axis():
    assert log_axis([math.nan, math.inf, 0.0, -1.0], 0.0, 1.0) is None
