"""What the benches call found, and when they fail."""

from __future__ import annotations

import numpy as np
from bench.__main__ import broken_limits
from random_scenes import judge, random_case

from dslam_mav import Verdict


def test_without_positions_the_truth_is_not_listed() -> None:
    judged = judge(random_case((5, 1), 1, 40.0), 1)
    assert judged.estimate.verdict is Verdict.NOT_IDENTIFIABLE
    assert np.isnan(judged.estimate.sources.position_m).all()
    assert not judged.truth_listed
    assert not judged.wrong


def test_the_answer_in_the_truths_basin_is_found() -> None:
    judged = judge(random_case((5, 2), 2, 40.0), 2)
    assert (judged.found, judged.truth_listed) == (True, True)


def test_a_row_breaks_its_limits_by_share_and_by_time() -> None:
    assert broken_limits("row", [True] * 97 + [False] * 3, [0.49]) == []
    (rare,) = broken_limits("row", [True] * 96 + [False] * 4, [0.49])
    assert "row: found 0.960" in rare
    (slow,) = broken_limits("row", [True], [0.1, 0.5, 0.9])
    assert "row: 0.50 s" in slow
