"""A plan made fit for the vehicle that will fly it."""

from __future__ import annotations

import math

import pytest
from fakes import mission

from dslam_mav.mav.mission.suit import suited
from dslam_mav.mav.profile import profile_named
from dslam_mav.mission import CMD_LAND, CMD_TAKEOFF, Home, MissionItem, leg_plan, moved_to, with_home_item

QUADROTOR, ROVER = 2, 10


def test_ardupilot_holds_at_corners_and_says_so() -> None:
    held, notes = suited(with_home_item(mission()), profile_named("ardupilot"), QUADROTOR)
    assert [item.params[0] for _, item in held.waypoints()] == [1.0] * 8
    assert held.items[0].params[0] == 0.0  # home is no corner
    assert notes == ("8 waypoints get a hold of 1 s: without, their corners are cut",)
    longer, none = suited(mission(hold_s=3.0), profile_named("ardupilot"), QUADROTOR)
    assert ([i.params[0] for _, i in longer.waypoints()], none) == ([3.0] * 8, ())


def test_px4_gets_a_small_acceptance_radius() -> None:
    held, notes = suited(mission(), profile_named("px4"), QUADROTOR)
    assert {item.params[1] for _, item in held.waypoints()} == {0.5}
    assert "PX4's own is 10 m" in notes[1]


def test_others_fly_what_was_drawn() -> None:
    plan = mission()
    assert suited(plan, profile_named("generic"), QUADROTOR) == (plan, ())


def test_a_rover_neither_takes_off_nor_lands() -> None:
    plan = mission()
    land = MissionItem(CMD_LAND, 3, (0.0, 0.0, 0.0, math.nan), 0, 0, 0.0)
    held, notes = suited(type(plan)((*plan.items, land), plan.home), profile_named("ardupilot"), ROVER)
    assert not {CMD_TAKEOFF, CMD_LAND} & {item.command for item in held.items}
    assert "stays on the ground" in notes[0]
    assert len(leg_plan(held).lengths_m) == 7


def test_a_plan_moved_to_the_other_side_of_the_world_keeps_its_shape() -> None:
    plan = with_home_item(mission())
    there = Home(-35.363262, 149.165237, 584.0)
    moved = moved_to(plan, there)
    assert leg_plan(moved).vertices_m == pytest.approx(leg_plan(plan).vertices_m, abs=0.02)
    assert (moved.items[0].x, moved.items[0].z, moved.home) == (-353632620, 584.0, there)
