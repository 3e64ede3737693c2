"""What is known of a leg before it ends."""

from __future__ import annotations

import flown as frames_of
import numpy as np
import pytest
from collecting import collect, of_type
from flown import Flown, repack

from dslam_mav.legs import LegCollector, PlanFacts


@pytest.fixture(scope="module")
def flight() -> Flown:
    return frames_of.fly()


def plan(flight: Flown) -> PlanFacts:
    return PlanFacts(tuple(range(1, len(flight.lengths_m) + 2)), tuple(flight.lengths_m))


def until(flight: Flown, leg: int, share: float, **options) -> LegCollector:
    begin, end = flight.corner_ms[leg : leg + 2]
    last_ms = begin + share * (end - begin)
    frames = [f for f in flight.frames if f.received_ns <= last_ms * 1e6]
    return collect(frames, plan=plan(flight), **options)


@pytest.mark.parametrize("leg", [0, 1, 3])
@pytest.mark.parametrize("share", [0.3, 0.8])
def test_the_leg_being_flown_is_as_long_as_it_has_been_flown(flight: Flown, leg: int, share: float) -> None:
    way = until(flight, leg, share).under_way()
    assert way is not None
    assert len(way.legs) == leg + 1
    assert way.end_seq == leg + 2
    assert way.planned_m == flight.lengths_m[leg]
    assert abs(way.share - share) < 0.03
    seconds = 1e-3 * (flight.corner_ms[leg + 1] - flight.corner_ms[leg])
    assert abs(way.left_s - (1.0 - share) * seconds) < 0.3
    for time_ms, along_m in zip(way.legs[-1].time_ms, way.legs[-1].distance_m, strict=True):
        assert abs(flight.distance_m[int(time_ms)][1] - along_m) < 0.05


def test_neither_before_the_first_vertex_nor_after_the_last_nor_without_a_plan(flight: Flown) -> None:
    assert collect(flight.frames[:3], plan=plan(flight)).under_way() is None
    assert collect(flight.frames, plan=plan(flight)).under_way() is None
    assert until(flight, 1, 0.5, distance="plan").under_way() is None
    begin = [f for f in flight.frames if f.received_ns <= (flight.corner_ms[1] + 2000) * 1e6]
    assert collect(begin).under_way() is None


def test_the_vehicles_frame_does_not_show(flight: Flown) -> None:
    own = until(flight, 2, 0.7).under_way()
    frames = [
        repack(f, x=-f.message.y, y=f.message.x, vx=-f.message.vy, vy=f.message.vx)
        if of_type([f], "LOCAL_POSITION_NED")
        else f
        for f in flight.frames
    ]
    other = until(Flown(frames, flight.lengths_m, flight.corner_ms, flight.distance_m), 2, 0.7).under_way()
    assert own is not None
    assert other is not None
    assert (own.share, own.left_s) == (other.share, other.left_s)
    np.testing.assert_array_equal(own.legs[-1].distance_m, other.legs[-1].distance_m)
