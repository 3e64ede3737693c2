"""The estimator as it was set up: which legs' headings it is told, and from where it is anchored."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from flown import STAR, fly
from numpy.typing import ArrayLike

from dslam_mav import assumed
from dslam_mav.assumed import NOT_CLOSED, NOT_FROM_HOME, estimator, visible_plan
from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.outcome import truth_of
from dslam_mav.legs import FlownLeg, LegCollector, flight_of, plan_facts
from dslam_mav.mav.decode import decode
from dslam_mav.mav.frames import Frame
from dslam_mav.mission import Home, Mission, MissionItem, enu_to_e7, leg_plan
from dslam_mav.records import Estimate, Flight, Medium, Path, Sources, Truth, Verdict

HOME = Home(47.3, 8.5)


def mission() -> Mission:
    takeoff = MissionItem(22, 3, (0.0, 0.0, 0.0, math.nan), 0, 0, 10.0)
    shifted = [(north + 3.0, east + 5.0) for north, east in STAR]
    corners = [MissionItem(16, 3, (0.0,) * 4, *enu_to_e7(e, n, HOME), 10.0) for n, e in shifted]
    return Mission((takeoff, *corners), HOME)


def unmeasured(frames: list[Frame], seq: int) -> list[Frame]:
    """Without any word of where the vehicle was, or how fast, until an item was reached: legs until there are lost."""
    reached = next(
        i for i, f in enumerate(frames) if f.message.get_type() == "MISSION_ITEM_REACHED" and f.message.seq == seq
    )
    silent = ("LOCAL_POSITION_NED", "VFR_HUD")
    first = next(i for i, f in enumerate(frames) if f.message.get_type() == silent[0])  # the clock is known by it
    return [f for i, f in enumerate(frames) if i == first or i >= reached or f.message.get_type() not in silent]


def collected(frames: list[Frame]) -> LegCollector:
    collector = LegCollector(plan_facts(mission()), distance="odometry")
    for frame in frames:
        observation = decode(frame, 1)
        if observation is not None:
            collector.add(observation)
    return collector


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The headings that the estimator was told, flight by flight; its answers begin at (0, 0)."""
    heard: list[Any] = []

    def stand_in(flight: Flight, *_: Any, heading_prior: tuple[ArrayLike, float] | None, **__: Any) -> Estimate:
        heard.append(None if heading_prior is None else heading_prior[0])
        n = len(flight.legs)
        return Estimate(
            sources=Sources([[1.0, 2.0]], [3.0], [4.0], [-1.0]), path=Path(np.zeros((n + 1, 2)), np.zeros(n)),
            medium=Medium(), verdict=Verdict.IDENTIFIED, reason="", spread_m=1.0,
            position_covariance_m2=np.eye(2)[None], path_aligned_covariance_m2=np.eye(2)[None],
            parameter_covariance=np.zeros((0, 0)), parameter_names=(), noise_sd=0.1, log_likelihood=0.0,
            residual=np.zeros(0),
        )  # fmt: skip

    monkeypatch.setattr(assumed, "estimate", stand_in)
    return heard


def answer(collector: LegCollector, legs: tuple[FlownLeg, ...]) -> Estimate:
    return estimator(Assumptions(heading="plan"), collector, mission())(flight_of(legs), legs)


def test_an_anchored_answer_begins_where_the_legs_used_begin(told: list[Any]) -> None:
    vertices_m = leg_plan(mission()).vertices_m
    for frames, first in ((fly().frames, 0), (unmeasured(fly().frames, 3), 2)):
        collector = collected(frames)
        legs = collector.legs(final=True)
        assert legs[0].start_seq == first + 1
        result = answer(collector, legs)
        assert result.path.vertices_m[0].tolist() == vertices_m[first].tolist()
        assert (result.sources.position_m - vertices_m[first]).tolist() == pytest.approx(np.array([[1.0, 2.0]]))


def test_headings_are_of_the_very_legs_that_are_estimated(told: list[Any]) -> None:
    collector = collected(fly().frames)
    legs = collector.legs(final=True)
    answer(collector, legs[1:3])  # more was flown since, and the chain began elsewhere then
    assert told[-1].tolist() == leg_plan(mission()).headings_rad[1:3].tolist()


def test_truth_begins_and_ends_with_the_legs_used() -> None:
    vertices_m = leg_plan(mission()).vertices_m
    truth = Truth(np.array([[1.0, 2.0]]), np.array([3.0]), vertices_m)
    legs = collected(unmeasured(fly().frames, 3)).legs(final=True)
    cut = truth_of(truth, mission(), legs)
    assert cut is not None
    assert cut.vertices_m.tolist() == vertices_m[2:].tolist()
    assert cut.source_position_m.tolist() == truth.source_position_m.tolist()
    assert truth_of(truth, None, legs) is truth
    assert truth_of(truth, mission(), ()) is truth
    assert truth_of(None, mission(), legs) is None


def test_the_plan_is_not_given_to_an_estimator_that_may_not_see_headings() -> None:
    assert visible_plan(Assumptions(), mission()) is None
    assert visible_plan(Assumptions(heading="vehicle"), mission()) == mission()
    assert visible_plan(Assumptions(heading="plan"), mission()) == mission()


def test_without_a_plan_it_is_said_that_places_are_not_from_home(
    told: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    flown = fly()
    frames = [
        f for f in flown.frames
        if f.message.get_type() != "NAMED_VALUE_FLOAT" or flown.distance_m[f.message.time_boot_ms][0] != 1
    ]  # fmt: skip
    monkeypatch.setattr(LegCollector, "headings_rad", lambda _, legs: np.zeros(len(legs)))
    compass = Assumptions(heading="vehicle", closed=True)
    for heard, said in ((frames, f"{NOT_CLOSED} {NOT_FROM_HOME.format(3)}"), (flown.frames, "")):
        collector = LegCollector()
        collector.add_all(o for f in heard if (o := decode(f, 1)) is not None)
        legs = collector.legs(final=True)
        result = estimator(compass, collector, None)(flight_of(legs), legs)
        assert result.reason == said
    collector = collected(frames)
    legs = collector.legs(final=True)
    result = estimator(compass, collector, mission())(flight_of(legs), legs)
    assert result.reason == NOT_CLOSED
    assert result.path.vertices_m[0].tolist() == leg_plan(mission()).vertices_m[2].tolist()
