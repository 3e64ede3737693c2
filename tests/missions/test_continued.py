"""The part flown is kept, and turns mean the same in whatever frame the vehicle has."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fakes import mission
from hypothesis import given
from hypothesis import strategies as st

from dslam_mav.mission import CMD_CHANGE_SPEED, CMD_JUMP, Mission, MissionItem, leg_plan, with_home_item
from missions.continued import continued, first_turn, lost_item, turns_so_far

CORNERS = [(0.0, 0.0), (60.0, 0.0), (10.0, 30.0), (50.0, -20.0), (50.0, 40.0)]
turns = st.floats(-3.1, 3.1)
lengths = st.floats(5.0, 80.0)
legs = st.lists(st.tuples(turns, lengths), max_size=5)


def bend(path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    step = np.diff(path, axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    return np.linalg.norm(step, axis=1), np.remainder(np.diff(heading) + math.pi, 2.0 * math.pi) - math.pi


def turned(corners: list[tuple[float, float]], angle: float, side: float) -> list[tuple[float, float]]:
    c, s = math.cos(angle), math.sin(angle)
    return [(c * x - s * side * y, s * x + c * side * y) for x, y in corners]


@given(legs=legs, angle=st.floats(0.0, 6.3), side=st.sampled_from([1.0, -1.0]), end=st.integers(1, 4))
def test_legs_to_come_turn_as_told_whatever_frame_the_vehicle_has(
    legs: list[tuple[float, float]], angle: float, side: float, end: int
) -> None:
    plan = mission(turned(CORNERS, angle, side))
    sequence = leg_plan(plan).sequence
    turn, length = [side * t for t, _ in legs], [m for _, m in legs]
    new = continued(plan, sequence[end], turn, length)
    path = leg_plan(new).vertices_m
    np.testing.assert_allclose(path[: end + 1], leg_plan(plan).vertices_m[: end + 1])
    found_m, found_turn = bend(path[end - 1 :])
    np.testing.assert_allclose(found_m[1:], length, atol=0.03)
    off = np.remainder(found_turn - turn + math.pi, 2.0 * math.pi) - math.pi
    np.testing.assert_allclose(off, 0.0, atol=0.03 / 5.0 * 2.0)


@pytest.mark.parametrize("plan", [mission(CORNERS), with_home_item(mission(CORNERS))])
def test_what_was_flown_and_the_way_home_stay(plan: Mission) -> None:
    sequence = leg_plan(plan).sequence
    new = continued(plan, sequence[2], [2.0, -1.0, 0.5], [10.0, 20.0, 30.0])
    assert new.items[: sequence[2] + 1] == plan.items[: sequence[2] + 1]
    assert new.items[-1] == plan.items[-1]
    assert leg_plan(new).sequence == (*sequence[:3], *range(sequence[2] + 1, sequence[2] + 4))
    assert {i.z for _, i in new.waypoints()} == {10.0}
    ended = continued(plan, sequence[2], [], [])
    assert ended.items == (*plan.items[: sequence[2] + 1], plan.items[-1])


def test_the_sense_of_the_first_turn() -> None:
    assert first_turn(mission(CORNERS)) == 1.0
    assert first_turn(mission(turned(CORNERS, 1.0, -1.0))) == -1.0
    assert first_turn(mission(CORNERS[:2])) == 0.0


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_turns_so_far_are_seen_from_the_side_of_the_first(sense: float) -> None:
    turn, start = [2.5, -2.0, 2.8], mission(turned(CORNERS, 0.7, sense))
    new = continued(start, leg_plan(start).sequence[1], [sense * t for t in turn], [30.0, 20.0, 25.0])
    for j, seq in enumerate(leg_plan(new).sequence[1:]):
        np.testing.assert_allclose(turns_so_far(new, seq), turn[:j], atol=1e-3)


def test_only_the_end_of_a_leg_can_be_gone_on_from() -> None:
    plan = mission(CORNERS)
    with pytest.raises(ValueError, match="end_seq: expected the end of a leg of the mission"):
        continued(plan, leg_plan(plan).sequence[0], [1.0], [10.0])
    with pytest.raises(ValueError, match="turn_rad: expected one for each of 2 lengths, got 1"):
        continued(plan, leg_plan(plan).sequence[1], [1.0], [10.0, 10.0])


@pytest.mark.parametrize("home", [False, True])
@pytest.mark.parametrize("command", [CMD_CHANGE_SPEED, CMD_JUMP, 93, 206])
@given(place=st.integers(0, 8))
def test_what_would_be_lost_or_point_astray_is_known_beforehand(command: int, home: bool, place: int) -> None:
    """An item anywhere: it is named, or it is still there behind the same waypoint after any leg."""
    bare = mission(CORNERS)
    item = MissionItem(command, 2, (1.0, 3.0, 0.0, 0.0), 0, 0, 0.0)
    plan = Mission((*bare.items[:place], item, *bare.items[place:]), bare.home)
    if home:
        plan = with_home_item(plan)
    sequence, own = leg_plan(plan).sequence, place + home
    between = sequence[1] < own < sequence[-1]
    assert lost_item(plan) == (own if between or command == CMD_JUMP else None)
    if not between:
        for end_seq in sequence[1:]:
            new = continued(plan, end_seq, [1.0], [10.0])
            assert sum(i.command == command and i.params[1] == 3.0 for i in new.items) == 1
    assert lost_item(bare) is None
