"""Many flights on one page: every log a row, figures that agree, pictures that leave out what is not known."""

from __future__ import annotations

import math
import re

import pytest
from test_report_page import HOSTILE, outline

from dslam_mav.records import Verdict
from dslam_mav.report.compare import Flown, comparison
from dslam_mav.report.foreseen import Realised
from dslam_mav.report.page import render_comparison

NONE = (math.nan, math.nan)


def flown(log, start_s, own_m, error_m=math.nan, predicted_m=(0.4, 0.9), **more):
    """A flight of three sources."""
    realised = Realised(NONE, (own_m, own_m), (error_m, error_m))
    given = {
        "verdict": Verdict.IDENTIFIED, "n_sources": 3, "length_m": 224.0, "noise_sd": 0.25, "predicted_m": predicted_m,
        "realised": realised, "duration_s": 44.7,
    }  # fmt: skip
    return Flown(log, start_s=start_s, **given | more)


def flights():
    """Two with truth, one without, one that cannot be read."""
    return [
        flown("a", 2000.0, 0.3, 0.5, link="a/report.html"),
        flown("b", 1000.0, 0.2, 0.1, verdict=Verdict.AMBIGUOUS),
        flown("c", None, 0.35, predicted_m=(math.inf, math.inf)),
        Flown("broken", problem="broken.mcap: is no MCAP log"),
    ]


def test_every_log_has_a_row_with_its_figures_or_why_not():
    page = render_comparison(flights(), "4 logs compared")
    parsed = outline(page)
    rows = [a for t, a in parsed.tags if t == "tr" and "data-flight" in a]
    assert len(rows) == 4
    for expected in ("1970-01-01 00:33:20", "Ambiguous", "224", "0.25", "0.30", "0.40", "0.50", "44.7", "none"):
        assert expected in parsed.text, expected
    assert "cannot be read: broken.mcap: is no MCAP log" in parsed.text
    assert "4 logs, 3 read." in parsed.text
    assert "2 identified, 1 ambiguous" in parsed.text
    assert "Of 2 with a prediction, 2 came out within" in parsed.text
    assert [a["href"] for t, a in parsed.tags if t == "a"] == ["a/report.html"]


def test_the_page_asks_the_network_for_nothing_and_obeys_no_text():
    page = render_comparison([flown(HOSTILE, 1.0, 0.1), Flown(HOSTILE, problem=HOSTILE)], HOSTILE)
    parsed = outline(page)
    assert [t for t, _ in parsed.tags].count("script") == 1
    assert not any(name.startswith("on") for _, a in parsed.tags for name in a)
    assert not re.search(r"https?://|@import", page)
    policy = next(a["content"] for t, a in parsed.tags if t == "meta" and "http-equiv" in a)
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    assert not re.search(r"(?<![a-z])nan(?![a-z])", page.split("<body>")[1].split("<script>")[0], re.IGNORECASE)


def test_equals_lie_on_the_diagonal_and_truth_counts_before_what_a_result_says():
    page = comparison([flown("even", 1.0, 0.2, 0.4), flown("own", 2.0, 0.8)], "two")
    assert page.scatter is not None
    even, own = page.scatter.marks
    x, y = page.scatter.x_axis, page.scatter.y_axis
    assert even.x - x.start == pytest.approx(y.start - even.y)
    assert even.true
    assert not own.true
    assert y.start - own.y == pytest.approx(own.x - x.start + (y.start - y.units(y.low * 2.0)))
    assert even.x_90 == pytest.approx(x.units(0.9))


def test_trends_run_from_the_oldest_to_the_newest():
    page = comparison(flights(), "four")
    errors = page.trends[0]
    assert [mark[0] for line in errors.lines for mark in line.marks if line.mark == "own"] == [2, 1, 3]
    assert errors.dates[0][1] == "1970-01-01 00:16"
    assert errors.dates[-1][1] == "–", "a flight of unknown date comes last"
    assert page.trends[1].title.startswith("Noise")


def test_what_cannot_be_drawn_is_left_out_and_said():
    page = comparison([flown("blind", 1.0, math.nan, predicted_m=(math.inf, math.inf)), *flights()[3:]], "two")
    assert page.scatter is None
    assert page.trends == ()
    assert comparison(flights(), "four").scatter.left_out == 2
    text = outline(render_comparison(flights(), "four")).text
    assert "2 without a result or a finite prediction are not drawn." in text


def test_rows_sort_by_numbers_and_the_unknown_by_nothing():
    rows = comparison(flights(), "four").rows
    assert [row.cells[7].order for row in rows[:3]] == ["0.5", "0.1", ""]
    assert rows[2].cells[6].order == "1e999"
    assert rows[2].cells[0].order == ""
    assert rows[3].cells == ()
