"""Answers beside each other: which row stands where."""

from __future__ import annotations

from report_flights import estimate_near, star_flight, star_truth, without_positions

from dslam_mav.records import Verdict
from dslam_mav.report.beside import EMPTY, beside


def of(k):
    truth = star_truth(k)
    return estimate_near(truth, *star_flight(truth))


def names(*answers):
    return [name for name, _ in beside(answers, None, ("before", "after")).rows]


def test_sources_that_one_answer_has_alone_stand_with_the_others():
    for answers in ((of(2), of(3)), (of(3), of(2))):
        assert names(*answers)[:6] == ["verdict", "sources", "S1", "S2", "S3", "spread √C"]
    (row,) = [cells for name, cells in beside((of(2), of(3)), None, ("before", "after")).rows if name == "S3"]
    assert row[0] == EMPTY
    assert "peak" in row[1]


def test_why_there_is_no_answer_stands_below_the_verdict():
    nothing = without_positions(of(2), Verdict.TOO_FEW_DATA, "Too few legs.")
    for answers in ((nothing, of(2)), (of(2), nothing)):
        assert names(*answers)[:3] == ["verdict", "why", "sources"]
