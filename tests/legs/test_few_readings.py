"""Legs without enough readings for an estimate: the longest run of others is the flight, and it is said which."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pytest
from collecting import collect
from flown import fly, reading

from dslam_mav.assumed import whole
from dslam_mav.dslam.certify import MIN_REACH, MIN_READINGS_PER_LEG
from dslam_mav.legs import LegCollector, PlanFacts
from dslam_mav.legs.assembly import LEAST_REACH, LEAST_READINGS

SEVEN = [(20.0 * math.cos(k * 2.7), 20.0 * math.sin(k * 2.7)) for k in range(8)]
FLOWN = fly(SEVEN)
HERE = ", leg 1 here is its leg {}"
PLAN = PlanFacts(tuple(range(1, 9)), tuple(FLOWN.lengths_m))


def heard(left: Mapping[int, int], plan: PlanFacts | None = PLAN) -> LegCollector:
    """The flight with so many readings `left` of these legs (from 1), the first ones, and all of the others."""
    seen: dict[int, int] = {}
    frames = []
    for frame in FLOWN.frames:
        if frame.message.get_type() == "NAMED_VALUE_FLOAT":
            leg = FLOWN.distance_m[frame.message.time_boot_ms][0] + 1
            seen[leg] = seen.get(leg, 0) + 1
            if leg in left and not 1 < seen[leg] <= left[leg] + 1:  # a corner's own reading is of the leg before too
                continue
        frames.append(frame)
    return collect(frames, plan=plan)


def numbers(collector: LegCollector) -> list[int]:
    return [leg.number for leg in collector.legs(final=True)]


def test_what_is_too_little_is_what_the_estimator_says():
    assert (LEAST_READINGS, LEAST_REACH) == (MIN_READINGS_PER_LEG, MIN_REACH)


@pytest.mark.parametrize(
    ("left", "used", "note"),
    [
        ({2: 0}, [3, 4, 5, 6, 7], "leg 2 of the mission has 0 readings: legs 3 to 7 are used" + HERE.format(3)),
        ({2: 3}, [3, 4, 5, 6, 7], "leg 2 of the mission has 3 readings: legs 3 to 7 are used" + HERE.format(3)),
        ({1: 0}, [2, 3, 4, 5, 6, 7], "leg 1 of the mission has 0 readings: legs 2 to 7 are used" + HERE.format(2)),
        ({5: 1}, [1, 2, 3, 4], "leg 5 of the mission has 1 reading: legs 1 to 4 are used"),
        ({7: 0}, [1, 2, 3, 4, 5, 6], "leg 7 of the mission has 0 readings: legs 1 to 6 are used"),
        (
            {2: 0, 6: 3, 7: 0},
            [3, 4, 5],
            "legs 2, 6 and 7 of the mission have 0, 3 and 0 readings: legs 3 to 5 are used, leg 1 here is its leg 3",
        ),
    ],
)  # fmt: skip
def test_the_longest_run_is_used_and_it_is_said_why(left, used, note):
    collector = heard(left)
    legs = collector.legs(final=True)
    assert [leg.number for leg in legs] == used
    assert [leg.start_seq for leg in legs] == used
    assert collector.notes(legs) == (note,)
    assert not whole(legs, collector.plan)


def test_the_legs_used_are_those_of_the_whole_flight():
    every = heard({}).flight(final=True)
    some = heard({2: 0}).flight(final=True)
    assert len(every.legs) == 7
    for used, same in zip(some.legs, every.legs[2:], strict=True):
        assert used.time_s.tobytes() == same.time_s.tobytes()
        assert used.distance_m.tobytes() == same.distance_m.tobytes()
        assert used.reading.tobytes() == same.reading.tobytes()


def test_legs_with_enough_for_the_estimator_stay():
    assert numbers(heard({2: 4})) == [1, 2, 3, 4, 5, 6, 7]
    collector = heard({})
    legs = collector.legs(final=True)
    assert (numbers(collector), collector.notes(legs), whole(legs, collector.plan)) == ([1, 2, 3, 4, 5, 6, 7], (), True)


def test_without_a_plan_the_legs_flown_count():
    collector = heard({2: 2}, None)
    legs = collector.legs(final=True)
    assert collector.notes(legs) == ("leg 2 has 2 readings: legs 3 to 7 are used, leg 1 here is leg 3",)
    assert not whole(legs, None)
    late = heard({1: 0}, None)  # whatever was flown before the first reading is no part of the path
    assert (numbers(late), late.notes(late.legs(final=True))) == ([1, 2, 3, 4, 5, 6], ())
    assert whole(late.legs(final=True), None)


def test_where_no_two_legs_are_left_the_flight_stays_as_it_is():
    collector = heard({2: 0, 4: 0, 6: 0})
    legs = collector.legs(final=True)
    assert numbers(collector) == [1, 2, 3, 4, 5, 6, 7]
    assert collector.notes(legs) == tuple(f"leg {j} of 7 has no readings" for j in (2, 4, 6))


def test_readings_of_one_place_are_no_leg_read():
    flown = fly(SEVEN, hold_ms=3000)
    at_corner = [reading(t, 20.0, t) for t in range(flown.corner_ms[2] - 2000, flown.corner_ms[2] - 100, 100)]
    frames = [
        f for f in flown.frames
        if f.message.get_type() != "NAMED_VALUE_FLOAT" or flown.distance_m[f.message.time_boot_ms][0] != 1
    ]  # fmt: skip
    collector = collect(sorted([*frames, *at_corner], key=lambda f: f.received_ns), plan=PLAN)
    notes = collector.notes(collector.legs(final=True))
    assert numbers(collector) == [3, 4, 5, 6, 7]
    assert notes[0].startswith("leg 2 of the mission has 19 readings at one place: legs 3 to 7 are used")
