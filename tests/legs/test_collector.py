"""Observations become legs: boundaries, times, distances, what is set aside."""

import math
import threading

import numpy as np
import pytest
from flown import Flown, fly, heartbeat, pack, reading
from hypothesis import given
from hypothesis import strategies as st

from dslam_mav.legs import FlownLeg, PlanFacts
from dslam_mav.legs.clock import VehicleClock
from dslam_mav.legs.collector import LegCollector
from dslam_mav.mav.decode import decode
from dslam_mav.mav.frames import Frame, messages
from dslam_mav.observations import Odometry, Progress, Reading, Yaw

M = messages()


def collect(frames: list[Frame], **options) -> LegCollector:
    collector = LegCollector(options.pop("plan", None), distance=options.pop("distance", None))
    for frame in frames:
        observation = decode(frame, 1, **options)
        if observation is not None:
            collector.add(observation)
    return collector


def distance_error_m(flown: Flown, collector: LegCollector) -> float:
    errors = []
    for j, leg in enumerate(collector.legs(final=True)):
        for t, s in zip(leg.time_ms, leg.distance_m, strict=True):
            truly_on, truth_m = flown.distance_m[int(t) % 2**32]
            # the reading at a corner may count to either leg
            errors.append(abs(s - truth_m if truly_on == j else s - truth_m + flown.lengths_m[truly_on]))
    assert errors
    return max(errors)


def of_type(frames: list[Frame], *kinds: str) -> list[Frame]:
    return [f for f in frames if f.message.get_type() in kinds]


def without(frames: list[Frame], *kinds: str) -> list[Frame]:
    return [f for f in frames if f.message.get_type() not in kinds]


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


def test_a_lost_item_reached_is_replaced_by_the_item_flown_to():
    frames = without(fly().frames, "MISSION_ITEM_REACHED")
    assert collect(frames).flight(final=True).lengths_m == pytest.approx(fly().lengths_m, abs=0.01)


def test_item_reached_alone_is_enough():
    frames = without(fly().frames, "MISSION_CURRENT")
    assert len(collect(frames).flight(final=True).legs) == 4


def test_item_reached_repeated_as_px4_does_counts_once():
    frames = [copy for f in fly().frames for copy in ([f] * 10 if f in of_type([f], "MISSION_ITEM_REACHED") else [f])]
    assert len(collect(frames).flight(final=True).legs) == 4


@pytest.mark.parametrize("plan", [None, PlanFacts((1, 2, 3, 4, 5), (30.0,) * 4)])
def test_a_corner_nobody_reported_is_no_straight_leg(plan):
    def lost(frame: Frame) -> bool:
        kind = frame.message.get_type()
        return (kind == "MISSION_ITEM_REACHED" and frame.message.seq == 3) or (
            kind == "MISSION_CURRENT" and frame.message.seq in (3, 4)
        )

    collector = collect([f for f in fly().frames if not lost(f)], plan=plan)
    # item 3 was never heard of: 1-2 stands alone, 2-4 is bent, 4-5 stands alone
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


def test_an_item_passed_before_any_vehicle_time_is_passed_at_the_first():
    collector = LegCollector()
    collector.add(Progress(1, reached=True))
    collector.add(Yaw(0, math.nan))
    assert collector.last_event is None
    collector.add(Reading(5_000, 20.0))
    assert collector.last_event == (1, 5_000)


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


@pytest.mark.parametrize(("plan", "zero"), [(None, 2), (PlanFacts((1, 2, 3, 4, 5), (30.0,) * 4), 0)])
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


def test_a_flight_joined_midway_says_which_legs_are_missing():
    collector = LegCollector(PlanFacts((2, 3, 4, 5), (10.0, 10.0, 10.0)))
    s, t = np.array([0.0, 9.0]), np.array([0, 1000])
    last = FlownLeg(4, 5, 0, 1000, 10.0, s, t, np.array([1.0, 2.0]), "odometry")
    first = FlownLeg(2, 3, 0, 1000, 10.0, s, t, np.array([1.0, 2.0]), "odometry")
    assert "legs 1 to 2 of the mission are missing: leg 1 here is its leg 3" in collector.notes((last,))
    assert not any("missing" in note for note in collector.notes((first,)))
