"""The vehicle's clock as the collector keeps it: it wraps, restarts, and other clocks do not move it."""

from __future__ import annotations

import math

import pytest
from collecting import collect, without
from flown import fly, pack, reading
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.legs import PlanFacts
from dslam_mav.legs.clock import VehicleClock
from dslam_mav.legs.collector import LegCollector
from dslam_mav.mav.frames import Frame, messages
from dslam_mav.observations import Progress, Reading, Yaw

M = messages()


def test_the_clock_wraps():
    flown = fly(start_ms=2**32 - 9_000)
    collector = collect(flown.frames)
    plain = collect(fly(start_ms=9_000).frames)
    a, b = collector.flight(final=True), plain.flight(final=True)
    assert len(a.legs) == 4
    for p, q in zip(a.legs, b.legs, strict=True):
        assert (p.distance_m == q.distance_m).all()
        assert (p.time_s == q.time_s).all()
        assert (p.reading == q.reading).all()


@settings(deadline=None)
@given(st.lists(st.integers(1, 2_000), min_size=1, max_size=30), st.integers(0, 2**32 - 1))
def test_unwrapped_time_rises_with_the_vehicles(steps, start):
    clock = VehicleClock()
    clock.take(start)
    total = start
    for step in steps:
        total += step
        assert clock.take(total % 2**32) == (total, False)


def test_a_restarted_autopilot_begins_a_new_flight():
    first, second = fly(start_ms=3_000_000), fly(start_ms=5_000)
    collector = collect([*first.frames[: len(first.frames) // 3], *second.frames])
    assert collector.counts["restarts"] == 1
    assert len(collector.flight(final=True).legs) == 4
    assert collector.flight(final=True).lengths_m == pytest.approx(second.lengths_m, abs=0.01)


def test_an_item_passed_before_any_vehicle_time_is_passed_at_the_first():
    collector = LegCollector()
    collector.add(Progress(1, reached=True))
    collector.add(Yaw(0, math.nan))
    assert collector.last_event is None
    collector.add(Reading(5_000, 20.0))
    assert collector.last_event == (1, 5_000)


@pytest.mark.parametrize(("plan", "zero"), [(None, 2), (PlanFacts((1, 2, 3, 4, 5), (60.0,) * 4), 0)])
def test_time_zero_is_where_the_flight_began_though_its_first_legs_are_lost(plan, zero):
    def lost(frame: Frame) -> bool:
        kind = frame.message.get_type()
        return (kind == "MISSION_ITEM_REACHED" and frame.message.seq == 2) or (
            kind == "MISSION_CURRENT" and frame.message.seq in (2, 3)
        )

    flown = fly()
    collector = collect([f for f in flown.frames if not lost(f)], plan=plan)
    legs = collector.legs(final=True)
    assert [(leg.start_seq, leg.end_seq) for leg in legs] == [(3, 4), (4, 5)]
    assert {leg.zero_ms for leg in legs} == {flown.corner_ms[zero]}
    first = collector.flight(final=True).legs[0].time_s[0]
    assert first == (flown.corner_ms[2] - flown.corner_ms[zero]) / 1000.0


def test_time_zero_is_not_of_the_clock_before_a_restart():
    first, second = fly(start_ms=3_000_000), fly(start_ms=5_000)
    plan = PlanFacts((1, 2, 3, 4, 5), (30.0,) * 4)
    collector = collect([*first.frames[: len(first.frames) // 2], *second.frames], plan=plan)
    assert collector.flight(final=True).legs[0].time_s[0] == 0.0
    assert any("started again 1 time" in note for note in collector.notes(collector.legs(final=True)))


@pytest.mark.parametrize("foreign_ms", [-100_000, 20_000, 10**9])
def test_a_sensor_with_a_clock_of_its_own_changes_nothing_and_is_told(foreign_ms):
    flown = fly(start_ms=500_000)
    stray = [reading(t + foreign_ms, 90.0, t + 1, name="THERMAL2") for t in flown.distance_m]
    frames = sorted([*flown.frames, *stray], key=lambda f: f.received_ns)
    collector, plain = collect(frames), collect(flown.frames).flight(final=True)
    for a, b in zip(collector.flight(final=True).legs, plain.legs, strict=True):
        assert a.distance_m.tobytes() == b.distance_m.tobytes()
        assert a.time_s.tobytes() == b.time_s.tobytes()
        assert a.reading.tobytes() == b.reading.tobytes()
    note = f"{len(stray)} readings had times that are not of the vehicle's clock and were dropped"
    assert note in collector.notes(collector.legs(final=True))


def test_readings_slightly_ahead_do_not_move_the_moment_an_item_is_reached():
    flown = fly()
    ahead = [reading(t + 2_000, 90.0, t, name="THERMAL2") for t in flown.distance_m]
    legs = collect(sorted([*flown.frames, *ahead], key=lambda f: f.received_ns)).legs(final=True)
    assert [leg.start_ms for leg in legs] == [leg.start_ms for leg in collect(flown.frames).legs(final=True)]


@pytest.mark.parametrize("foreign_ms", [-400_000, 10**9])
def test_readings_before_the_autopilots_first_time_do_not_set_its_clock(foreign_ms):
    flown = fly(start_ms=500_000)
    early = [
        reading(500_000 + foreign_ms, 90.0, 0),
        pack(M.MAVLink_mission_item_reached_message(0), 0),
        reading(500_000 + foreign_ms + 10, 90.0, 0),
    ]
    collector = collect([*early, *flown.frames])
    assert collector.counts["off the clock"] == 2
    assert collector.counts["readings"] == len(flown.distance_m)
    assert [leg.start_ms for leg in collector.legs(final=True)] == flown.corner_ms[:-1]
    assert len(collector.flight().legs) == 3


def test_readings_alone_keep_the_clock_where_no_autopilot_tells_the_time():
    flown = fly()
    plan = PlanFacts((1, 2, 3, 4, 5), tuple(flown.lengths_m))
    collector = collect(without(flown.frames, "LOCAL_POSITION_NED", "VFR_HUD"), plan=plan, distance="plan")
    assert collector.counts["off the clock"] == 0
    assert collector.flight(final=True).n_readings == len(flown.distance_m) - 1  # none is past the last item
