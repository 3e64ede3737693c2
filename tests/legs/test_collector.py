"""Observations become legs: boundaries, distances, what is set aside."""

from __future__ import annotations

import math
import threading

import numpy as np
import pytest
from collecting import collect, distance_error_m, of_type, without
from flown import fly, heartbeat, pack, reading

from dslam_mav.legs import FlownLeg, PlanFacts
from dslam_mav.legs.collector import LegCollector
from dslam_mav.mav.decode import decode
from dslam_mav.mav.frames import Frame, messages
from dslam_mav.observations import Odometry, Reading

M = messages()


def test_every_leg_has_its_length_its_readings_and_their_distances():
    flown = fly()
    collector = collect(flown.frames)
    flight = collector.flight(final=True)
    assert flight.lengths_m == pytest.approx(flown.lengths_m, abs=0.01)
    assert flight.n_readings == len(flown.distance_m)
    assert distance_error_m(flown, collector) < 0.01
    assert flight.legs[0].time_s[0] == 0.0
    assert flight.legs[0].reading[0] == pytest.approx(20.0 + 5 * math.exp(-2.25), abs=1e-5)
    assert not flight.closed


def test_readings_that_come_late_belong_to_the_leg_they_were_taken_on():
    in_time, late = fly(), fly(late_ms=900)
    a, b = collect(in_time.frames).flight(final=True), collect(late.frames).flight(final=True)
    assert [leg.reading.size for leg in a.legs] == [leg.reading.size for leg in b.legs]
    assert all((p.reading == q.reading).all() for p, q in zip(a.legs, b.legs, strict=True))


def test_a_leg_waits_for_a_reading_past_its_end():
    flown = fly(late_ms=900)
    collector = LegCollector()
    completed_at = []
    for frame in flown.frames:
        observation = decode(frame, 1)
        if observation is not None and collector.add(observation):
            completed_at.append(observation)
    assert completed_at  # the last leg has no reading past its end: it is there only at the end
    assert all(isinstance(o, Reading) for o in completed_at)
    assert [o.time_boot_ms >= t for o, t in zip(completed_at, flown.corner_ms[1:], strict=False)] == [True] * 3
    assert len(collector.flight().legs) == 3
    assert len(collector.flight(final=True).legs) == 4


def test_dead_reckoning_well_past_the_end_completes_a_leg_without_later_readings():
    collector = collect(fly().frames)
    collector.add(Odometry(10**6, 0.0, 0.0, 0.0, 0.0))
    assert len(collector.flight().legs) == 4


def test_a_lost_item_reached_is_replaced_by_the_item_flown_to():
    frames = without(fly().frames, "MISSION_ITEM_REACHED")
    assert collect(frames).flight(final=True).lengths_m == pytest.approx(fly().lengths_m, abs=0.01)


def test_item_reached_alone_is_enough():
    frames = without(fly().frames, "MISSION_CURRENT")
    assert len(collect(frames).flight(final=True).legs) == 4


def test_item_reached_repeated_as_px4_does_counts_once():
    frames = [copy for f in fly().frames for copy in ([f] * 10 if f in of_type([f], "MISSION_ITEM_REACHED") else [f])]
    assert len(collect(frames).flight(final=True).legs) == 4


def third_lost(frame: Frame) -> bool:
    kind = frame.message.get_type()
    return (kind == "MISSION_ITEM_REACHED" and frame.message.seq == 3) or (
        kind == "MISSION_CURRENT" and frame.message.seq in (3, 4)
    )


def test_a_corner_nobody_reported_is_where_the_plan_has_it_by_the_way_flown():
    flown = fly()
    frames = [f for f in flown.frames if not third_lost(f)]
    collector = collect(frames, plan=PlanFacts((1, 2, 3, 4, 5), tuple(flown.lengths_m)))
    legs = collector.legs(final=True)
    assert [(leg.start_seq, leg.end_seq) for leg in legs] == [(1, 2), (2, 3), (3, 4), (4, 5)]
    assert legs[2].start_ms == pytest.approx(flown.corner_ms[2], abs=20)
    assert distance_error_m(flown, collector) < 0.1


@pytest.mark.parametrize("plan", [None, PlanFacts((1, 2, 3, 4, 5), (60.0,) * 4)])
def test_a_corner_nobody_reported_is_no_straight_leg(plan):
    collector = collect([f for f in fly().frames if not third_lost(f)], plan=plan)
    # item 3 was never heard of, nor is 2-4 as long as planned: 1-2 stands alone, 2-4 is bent, 4-5 stands alone
    assert [(leg.start_seq, leg.end_seq) for leg in collector.legs(final=True)] == [(1, 2)]
    assert collector.legs_counts["legs lost"] == 1
    assert any("longest unbroken" in note for note in collector.notes(collector.legs(final=True)))


def test_items_that_are_no_vertices_do_not_cut_a_leg():
    """DO_CHANGE_SPEED in the middle: MISSION_CURRENT steps over it."""
    frames = fly().frames
    at = next(i for i, f in enumerate(frames) if f.message.get_type() == "MISSION_ITEM_REACHED" and f.message.seq == 2)
    renamed = []
    for i, f in enumerate(frames):
        kind = f.message.get_type()
        if i > at and kind.startswith("MISSION"):
            renamed.append(pack(type(f.message)(f.message.seq + 1), f.received_ns))
        else:
            renamed.append(f)
    for plan in (None, PlanFacts((1, 2, 4, 5, 6), (30.0,) * 4)):
        legs = collect(renamed, plan=plan).legs(final=True)
        assert [(leg.start_seq, leg.end_seq) for leg in legs] == [(1, 2), (2, 4), (4, 5), (5, 6)]


def test_with_a_plan_only_legs_between_its_vertices_count():
    legs = collect(fly().frames, plan=PlanFacts((2, 3, 4), (30.0, 30.0))).legs(final=True)
    assert [(leg.start_seq, leg.end_seq) for leg in legs] == [(2, 3), (3, 4)]


def test_hovering_is_no_leg_and_no_gap():
    hover = [(0.0, 0.0), (0.1, 0.0), (30.0, 6.0), (30.1, 6.0), (2.0, 20.0), (12.0, -9.0)]
    collector = collect(fly(hover, speed_m_s=2.0, position_ms=20, reading_ms=10).frames)
    legs = collector.legs(final=True)
    assert [(leg.start_seq, leg.end_seq) for leg in legs] == [(2, 3), (4, 5), (5, 6)]
    assert collector.legs_counts["legs short"] == 2


def test_duplicates_and_unfinite_readings_are_dropped_and_counted():
    flown = fly()
    extra = [reading(25_000, math.nan, 25_000), reading(25_010, math.inf, 25_010)]
    frames = [copy for f in flown.frames for copy in [f, *of_type([f], "NAMED_VALUE_FLOAT")]]
    collector = collect([*frames[:200], *extra, *frames[200:]])
    assert collector.counts["duplicate"] == len(flown.distance_m)
    assert collector.counts["not finite"] == 2
    plain = collect(flown.frames).flight(final=True)
    assert all(
        (a.reading == b.reading).all() for a, b in zip(collector.flight(final=True).legs, plain.legs, strict=True)
    )
    assert "2 readings were not finite and were dropped" in collector.notes(collector.legs(final=True))


def test_copies_an_autopilot_makes_of_readings_do_not_count_twice():
    flown = fly()
    copies = [reading(t + 3, 999.0, t + 4, component=1) for t in flown.distance_m]
    frames = sorted([*flown.frames, *copies], key=lambda f: f.received_ns)
    assert collect(frames).flight(final=True).n_readings == len(flown.distance_m)
    own = [pack(f.message, f.received_ns) if f in of_type([f], "NAMED_VALUE_FLOAT") else f for f in flown.frames]
    assert collect(own).flight(final=True).n_readings == len(flown.distance_m)  # an autopilot's own sensor


def test_copies_under_a_name_cut_short_do_not_count_as_another_sensor():
    flown = fly()
    own = [reading(t, 21.0, t, name="THERMAL_AB") for t in flown.distance_m]
    copies = [reading(t + 3, 999.0, t + 4, name="THERMAL_A", component=1) for t in flown.distance_m]
    frames = sorted([*without(flown.frames, "NAMED_VALUE_FLOAT"), *own, *copies], key=lambda f: f.received_ns)
    assert max(leg.reading.max() for leg in collect(frames).flight(final=True).legs) < 100.0


def test_two_sensors_are_read_together_and_averaged_where_they_agree_in_time():
    flown = fly()
    second = [reading(t, 40.0, t, name="THERMAL2") for t in flown.distance_m]
    third = [reading(t + 7, 30.0, t + 7, name="THERMAL3") for t in flown.distance_m]
    frames = sorted([*flown.frames, *second, *third], key=lambda f: f.received_ns)
    flight = collect(frames).flight(final=True)
    one = collect(flown.frames).flight(final=True)
    assert flight.n_readings == 2 * one.n_readings
    assert flight.legs[0].reading[0] == pytest.approx(0.5 * (one.legs[0].reading[0] + 40.0))
    assert flight.legs[0].reading[1] == 30.0


def test_a_leg_between_others_stays_even_without_readings():
    flown = fly()
    frames = [
        f for f in flown.frames
        if f.message.get_type() != "NAMED_VALUE_FLOAT"
        or flown.distance_m[f.message.time_boot_ms][0] not in (0, 2)
    ]  # fmt: skip
    collector = collect(frames)
    legs = collector.legs(final=True)
    assert [leg.value.size > 0 for leg in legs] == [True, False, True]
    assert collector.flight(final=True).legs[1].length_m == pytest.approx(flown.lengths_m[2], abs=0.01)
    assert "leg 2 of 3 has no readings" in collector.notes(legs)


def test_constant_readings_are_pointed_out():
    collector = collect(fly(value=lambda n, e: 21.5).frames)
    assert "leg 1 of 4: all 153 readings are 21.5" in collector.notes(collector.legs(final=True))


@pytest.mark.parametrize(
    ("mode", "dropped", "tolerance_m"),
    [("odometry", (), 0.01), ("speed", (), 0.5), ("speed", ("LOCAL_POSITION_NED",), 0.5), ("plan", (), 0.01)],
)
def test_every_distance_mode(mode, dropped, tolerance_m):
    flown = fly()
    plan = PlanFacts((1, 2, 3, 4, 5), tuple(flown.lengths_m)) if mode == "plan" else None
    collector = collect(without(flown.frames, *dropped), distance=mode, plan=plan)
    legs = collector.legs(final=True)
    assert [leg.mode for leg in legs] == [mode] * 4
    assert distance_error_m(flown, collector) < tolerance_m


def test_the_first_distance_the_vehicle_offers_is_taken():
    flown = fly()
    plan = PlanFacts((1, 2, 3, 4, 5), tuple(flown.lengths_m))
    modes = []
    for dropped in ((), ("LOCAL_POSITION_NED",), ("LOCAL_POSITION_NED", "VFR_HUD")):
        modes += {leg.mode for leg in collect(without(flown.frames, *dropped), plan=plan).legs(final=True)}
    assert modes == ["odometry", "speed", "plan"]
    nothing = collect(without(flown.frames, "LOCAL_POSITION_NED", "VFR_HUD"))
    assert nothing.flight(final=True).legs == ()
    assert nothing.legs_counts["legs lost"] == 4


def test_yaw_gives_the_heading_of_each_leg_and_leaves_the_flight_alone():
    flown = fly()
    frames = list(flown.frames)
    corners = np.array([(0.0, 0.0), (30.0, 6.0), (2.0, 20.0), (12.0, -9.0), (28.0, 22.0)])
    course = np.arctan2(*np.diff(corners, axis=0).T[::-1])  # clockwise from north
    for j, (begin, end) in enumerate(zip(flown.corner_ms, flown.corner_ms[1:], strict=False)):
        for t in range(begin, end, 100):
            turning = 1.0 if t - begin < 500 else 0.0  # the first half second still turns
            wire = M.MAVLink_attitude_message(t, 0.0, 0.0, math.remainder(course[j] + turning, 2 * math.pi), 0, 0, 0)
            frames.append(pack(wire, t * 1_000_000))
    frames.sort(key=lambda f: f.received_ns)
    collector = collect(frames, yaw=True)
    legs = collector.legs(final=True)
    error = collector.headings_rad(legs) - (0.5 * math.pi - course)
    assert np.abs(np.sin(error)).max() < 1e-6
    assert np.cos(error).min() > 0.0
    plain = collect(frames).flight(final=True)
    assert all(
        (a.distance_m == b.distance_m).all() for a, b in zip(plain.legs, collector.flight(final=True).legs, strict=True)
    )
    assert np.isnan(collect(frames).headings_rad(legs)).all()


def test_nothing_at_all_is_an_empty_flight():
    assert LegCollector().flight(final=True).legs == ()
    assert collect([heartbeat(1)]).flight().legs == ()


def test_another_thread_may_ask_while_readings_come_in():
    collector = collect(fly().frames)
    problems = []
    over = threading.Event()

    def ask() -> None:
        while not over.is_set():
            try:
                collector.flight(final=True)
            except RuntimeError as problem:
                problems.append(problem)

    asking = threading.Thread(target=ask)
    asking.start()
    for i in range(20_000):
        collector.add(Odometry(60_000 + i, 0.0, 0.0, 0.0, 0.0))
        collector.add(Reading(60_000 + i, 20.0))
    over.set()
    asking.join()
    assert not problems


def test_a_flight_joined_midway_or_ended_early_says_which_legs_are_missing():
    collector = LegCollector(PlanFacts((2, 3, 4, 5), (10.0, 10.0, 10.0)))
    s, t = np.array([0.0, 9.0]), np.array([0, 1000])
    first, middle, last = (FlownLeg(q, q + 1, 0, 1000, 10.0, s, t, np.array([1.0, 2.0]), "odometry") for q in (2, 3, 4))
    assert "legs 1 to 2 of the mission are missing: leg 1 here is its leg 3" in collector.notes((last,))
    assert "the last leg of the mission is missing: 2 legs are used" in collector.notes((first, middle))
    assert "the last 2 legs of the mission are missing: 1 leg is used" in collector.notes((first,))
    assert not any("missing" in note for note in collector.notes((first, middle, last)))
