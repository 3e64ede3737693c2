"""The loopback vehicle given another mission, or another item, while it flies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from fakes import mission

from dslam_mav.mission import CMD_WAYPOINT, Mission, enu_to_e7
from sim_bridge.loopback.autopilot import Autopilot
from sim_bridge.loopback.manners import manners
from sim_bridge.loopback.telemetry import Mode
from sim_bridge.vehicle import DEFAULT_HOME

CORNERS = [(0.0, 0.0), (40.0, 0.0), (0.0, 30.0), (40.0, 30.0)]
FIRST = 2  # sequence number of the first corner
ONTO_SECOND_LEG_MS = 11_000


def autopilot(plan: Mission) -> Autopilot:
    own = Autopilot(DEFAULT_HOME)
    own.set_items(plan.items)
    own.arm()
    own.set_mode(Mode.MISSION)
    return own


def moved(plan: Mission, seq: int, east_m: float, north_m: float) -> Mission:
    x, y = enu_to_e7(east_m, north_m, DEFAULT_HOME)
    items = list(plan.items)
    items[seq] = replace(items[seq], x=x, y=y)
    return replace(plan, items=tuple(items))


def flight(own: Autopilot, to_ms: int = 60_000) -> dict[str, list]:
    heard: dict[str, list] = {}
    for outgoing in own.advance(to_ms):
        heard.setdefault(outgoing.message.get_type(), []).append(outgoing.message)
    return heard


def places(heard: dict[str, list]) -> np.ndarray:
    return np.array([(m.time_boot_ms, m.x, m.y) for m in heard["LOCAL_POSITION_NED"]])


def test_items_to_come_change_and_the_leg_under_way_does_not() -> None:
    plan = mission(CORNERS)
    untouched, changed = autopilot(plan), autopilot(plan)
    before = [places(flight(own, ONTO_SECOND_LEG_MS)) for own in (untouched, changed)]
    np.testing.assert_array_equal(*before)
    changed.set_items(moved(plan, FIRST + 3, -25.0, -10.0).items)
    heard = flight(changed)
    assert [m.seq for m in heard["MISSION_ITEM_REACHED"]] == [FIRST + 2, FIRST + 3]
    same = places(flight(untouched))[: np.argmax(places(heard)[:, 0] > 15_000)]
    np.testing.assert_array_equal(same, places(heard)[: len(same)])
    assert np.abs(places(heard)[:, 1:] - (-10.0, -25.0)).sum(axis=1).min() < 0.02


def test_where_the_item_under_way_changes_the_vehicle_turns_to_it_at_its_speed() -> None:
    plan = mission(CORNERS)
    own = autopilot(plan)
    flight(own, ONTO_SECOND_LEG_MS)
    here = own.snapshot()
    own.set_items(moved(plan, FIRST + 2, 60.0, 60.0).items)
    heard = flight(own)
    assert heard["MISSION_ITEM_REACHED"][0].seq == FIRST + 2
    first = heard["LOCAL_POSITION_NED"][1]
    assert np.hypot(first.vx, first.vy) == np.float32(8.0)
    assert np.hypot(first.x - here.place_m[0], first.y - here.place_m[1]) < 1.0
    assert np.abs(places(heard)[:, 1:] - (60.0, 60.0)).sum(axis=1).min() < 0.02


def test_another_item_may_be_chosen_in_flight_and_the_same_one_changes_nothing() -> None:
    plan = mission(CORNERS)
    one, other = autopilot(plan), autopilot(plan)
    for own in (one, other):
        flight(own, ONTO_SECOND_LEG_MS)
    assert one.choose_first(FIRST + 2) == ""
    assert other.choose_first(FIRST + 3) == ""
    assert [m.seq for m in flight(one)["MISSION_ITEM_REACHED"]] == [FIRST + 2, FIRST + 3]
    assert [m.seq for m in flight(other)["MISSION_ITEM_REACHED"]] == [FIRST + 3]
    assert "refused" in one.choose_first(99)


def test_a_shorter_mission_ends_where_it_now_ends() -> None:
    plan = mission(CORNERS)
    own = autopilot(plan)
    flight(own, ONTO_SECOND_LEG_MS)
    own.set_items((*plan.items[: FIRST + 3], plan.items[-1]))
    heard = flight(own)
    assert [m.seq for m in heard["MISSION_ITEM_REACHED"]] == [FIRST + 2]
    assert not own.armed


def copter(plan: Mission) -> Autopilot:
    """With PX4's ways and inertia, under way on its second leg."""
    own = Autopilot(DEFAULT_HOME, manners=manners("px4"))
    own.set_items(plan.items)
    own.advance(20_000)
    assert own.start_mission() == ""
    own.advance(40_000)
    return own


def holding(plan: Mission) -> Mission:
    """It stops at its corners."""
    items = (replace(i, params=(1.0, *i.params[1:])) if i.command == CMD_WAYPOINT else i for i in plan.items)
    return replace(plan, items=tuple(items))


def test_with_inertia_too_the_leg_under_way_is_flown_as_it_would_have_been() -> None:
    plan = holding(mission(CORNERS))
    untouched, changed = copter(plan), copter(plan)
    here = untouched.snapshot()
    assert here.seq == FIRST + 2
    changed.set_items(moved(plan, FIRST + 3, -25.0, -10.0).items)
    heard = flight(changed, 140_000)
    reached = dict.fromkeys(m.seq for m in heard["MISSION_ITEM_REACHED"])  # PX4 repeats them
    assert [seq for seq in reached if FIRST + 2 <= seq <= FIRST + 3] == [FIRST + 2, FIRST + 3]
    same = places(flight(untouched, 42_000))
    np.testing.assert_array_equal(same, places(heard)[: len(same)])
    assert np.abs(places(heard)[:, 1:] - (-10.0, -25.0)).sum(axis=1).min() < 0.5


def test_with_inertia_it_turns_without_a_jolt() -> None:
    plan = holding(mission(CORNERS))
    own = copter(plan)
    here = own.snapshot()
    assert np.hypot(*here.velocity_m_s[:2]) > 1.0
    assert own.choose_first(FIRST + 3) == ""
    after = flight(own, own.time_ms + 40)["LOCAL_POSITION_NED"][-1]
    assert np.hypot(after.vx - here.velocity_m_s[0], after.vy - here.velocity_m_s[1]) < 0.6


def test_a_mission_that_it_will_not_fly_leaves_it_where_it_is() -> None:
    plan = holding(mission(CORNERS))
    own = copter(plan)
    here = own.snapshot()
    own.set_items(plan.items, flyable=False)
    flight(own, own.time_ms + 5_000)
    assert own.snapshot().place_m == here.place_m
    assert (own.armed, own.mode, own.in_mission) == (True, Mode.HOLD, False)
