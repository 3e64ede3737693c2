"""K left open: what many readings, or few, say of the number of sources."""

from __future__ import annotations

from dataclasses import replace

import pytest
from random_scenes import random_case

from dslam_mav import Flight, estimate
from dslam_mav.dslam import counting

FLIGHTS = 8


@pytest.mark.parametrize("k_sources", [2, 3])
def test_many_noisy_readings_name_as_many_sources_as_few_good_ones(k_sources: int) -> None:
    """8192 readings a leg at 0 dB say what 64 say at 21 dB: noise outside of what sources can do hides none of them."""
    named = []
    for seed in range(FLIGHTS):
        case = random_case((4410 + seed, k_sources), k_sources, 0.0, readings_per_leg=8192)
        named.append(len(estimate(replace(case.flight, closed=True), case.medium).sources))
    assert named.count(k_sources) >= FLIGHTS - 2, named


def test_where_nothing_is_left_to_explain_no_search_is_made_for_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """… and the answer is the same as with it."""
    asked: list[int] = []
    answered, spared = counting.answered, 0

    def noted(question: counting.Question, k: int, *patience: counting.Patience) -> counting.Found:
        asked.append(k)
        return answered(question, k, *patience)

    monkeypatch.setattr(counting, "answered", noted)
    for seed in range(FLIGHTS):
        case = random_case((4400 + seed, 2), 2, 10.0, readings_per_leg=4096)
        asked.clear()
        sparing = estimate(replace(case.flight, closed=True), case.medium)
        spared += max(asked) == 2
        with monkeypatch.context() as thorough:
            thorough.setattr(counting, "_room_for_more", lambda _: True)
            other = estimate(replace(case.flight, closed=True), case.medium)
        assert max(asked) == 3
        assert (sparing.sources.position_m == other.sources.position_m).all()
    assert spared >= FLIGHTS // 2


def test_a_number_that_was_found_answers_as_one_that_was_given() -> None:
    """Legs that may begin beside their corners: bit for bit, though the search is not made again."""
    case = random_case((4420, 2), 2, 30.0)
    flight = Flight(tuple(replace(leg, corner_sd_m=0.03) for leg in case.flight.legs), closed=True)
    found, given = estimate(flight, case.medium), estimate(flight, case.medium, 2)
    assert (found.sources.position_m == given.sources.position_m).all()
    assert (found.path.vertices_m == given.path.vertices_m).all()
    assert (found.position_covariance_m2 == given.position_covariance_m2).all()
