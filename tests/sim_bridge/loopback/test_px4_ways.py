"""The loopback vehicle with PX4's ways, as its source has them, and our side living with each of them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from fakes import flying, mission

from dslam_mav.errors import MissionError
from dslam_mav.legs import LegCollector
from dslam_mav.mav.decode import decode
from dslam_mav.mav.frames import messages
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.messages import to_message
from dslam_mav.mav.mission.protocol import Item
from dslam_mav.mav.mission.transfer import download, start, upload
from dslam_mav.mav.readings import to_message as reading_message
from dslam_mav.mission import Mission, leg_plan, with_home_item
from dslam_mav.observations import Reading
from sim_bridge.loopback.autopilot import Autopilot
from sim_bridge.loopback.manners import manners
from sim_bridge.vehicle import DEFAULT_HOME

M = messages()


@contextmanager
def vehicle(**options: Any) -> Iterator[Link]:
    with flying(profile="px4", **options) as (url,), Link(url, system=255, component=190) as link:
        wait_for_vehicle(link, 5.0)
        yield link


def hear(link: Link, *kinds: str, timeout_s: float = 5.0) -> Any:
    until_s = time.monotonic() + timeout_s
    while (left_s := until_s - time.monotonic()) > 0:
        frame = link.receive(left_s)
        if frame is not None and frame.message.get_type() in kinds:
            return frame.message
    return None


def test_a_plan_with_home_goes_up_without_it_and_flies() -> None:
    plan = with_home_item(mission(hold_s=1.0))
    with vehicle(speedup=20.0) as link:
        held = upload(link, 1, plan)
        assert len(held.items) == len(plan.items) - 1
        assert leg_plan(held).vertices_m == pytest.approx(leg_plan(plan).vertices_m, abs=0.02)
        start(link, 1, 10.0)  # MISSION_START switches the mode and arms
        beat = hear(link, "HEARTBEAT")
        assert (beat.custom_mode, bool(beat.base_mode & 128)) == (67371008, True)


def test_accepted_is_not_flyable() -> None:
    takeoff, speed, *rest = mission(hold_s=1.0).items
    with vehicle() as link, pytest.raises(MissionError, match=r"took the mission but will not fly it.*takeoff is not"):
        upload(link, 1, Mission((rest[0], takeoff, speed, *rest[1:])))


def test_a_wrong_number_is_ignored_and_the_old_mission_survives_a_timeout_said_in_words() -> None:
    plan = mission(hold_s=1.0)
    with vehicle(speedup=20.0) as link:
        upload(link, 1, plan)
        link.send(M.MAVLink_mission_count_message(1, 1, 3))
        assert hear(link, "MISSION_REQUEST").seq == 0
        link.send(to_message(Item(2, plan.items[2]), 1, 1))
        assert hear(link, "MISSION_REQUEST", "MISSION_ACK").get_type() == "MISSION_REQUEST"  # asks on, no ACK
        link.send(to_message(Item(0, plan.items[0]), 1, 1))
        assert hear(link, "MISSION_REQUEST_INT").seq == 1  # _INT from the first item on
        texts = [hear(link, "STATUSTEXT", "MISSION_ACK")]
        while texts[-1] is not None and texts[-1].get_type() == "STATUSTEXT" and "timeout" not in texts[-1].text:
            texts.append(hear(link, "STATUSTEXT", "MISSION_ACK"))
        assert texts[-1].text == "Operation timeout"
        assert len(download(link, 1).items) == len(plan.items)


def test_an_item_that_comes_too_late_is_an_error_and_the_upload_is_begun_again() -> None:
    plan = mission(hold_s=1.0)
    with vehicle(speedup=20.0) as link:
        send, receive, late, acks = link.send, link.receive, [], []

        def slow(message: Any) -> None:
            if acks or message.get_type() != "MISSION_ITEM_INT" or message.seq != 3:
                send(message)
            else:
                late.append(message)

        def heard(timeout_s: float) -> Any:
            frame = receive(timeout_s)
            if frame is not None and frame.message.get_type() == "MISSION_ACK":
                acks.append(frame.message.type)
            elif frame is not None and frame.message.get_type() == "STATUSTEXT" and "timeout" in frame.message.text:
                send(late[-1])
            return frame

        link.send, link.receive = slow, heard  # type: ignore[method-assign]
        assert len(upload(link, 1, plan).items) == len(plan.items)
        assert acks[:2] == [1, 0]


def test_its_place_comes_back_exactly_and_its_frames_renamed() -> None:
    with vehicle() as link:
        held = upload(link, 1, mission(hold_s=1.0))
        assert {item.frame for _, item in held.waypoints()} == {6}
        assert all(item.params[2] == 0.0 for _, item in held.waypoints())


def test_without_a_mission_a_start_is_denied() -> None:
    with vehicle(speedup=20.0) as link, pytest.raises(MissionError, match="refused the start of its mission: denied"):
        start(link, 1)


def test_readings_come_again_as_its_own_late_cut_and_some_only() -> None:
    """And the collector takes each once: those of who read them."""
    with flying(profile="px4") as (url,), Link(url, system=1, component=158) as bridge:
        with Link(url, system=1, component=191) as estimator:
            wait_for_vehicle(bridge, 5.0)
            estimator.send_heartbeat()
            assert hear(estimator, "HEARTBEAT") is not None
            collector, seen = LegCollector(), []
            for k in range(20):
                bridge.send(reading_message(Reading(1000 + k, 20.0 + k, "THERMAL_AB")))
            until_s = time.monotonic() + 0.5
            while time.monotonic() < until_s:
                frame = estimator.receive(0.05)
                if frame is not None and isinstance(observation := decode(frame, 1), Reading):
                    seen.append((observation.component, observation.name))
                    collector.add(observation)
    assert seen.count((158, "THERMAL_AB")) == 20
    assert 1 <= seen.count((1, "THERMAL_A")) < 10
    assert collector.readings()[1].tolist() == [20.0 + k for k in range(20)]


def test_an_item_reached_is_told_ten_times_more_and_landing_too() -> None:
    autopilot = Autopilot(DEFAULT_HOME, manners=manners("px4"))
    items = mission([(0.0, 0.0), (60.0, 0.0)], hold_s=1.0, speed_m_s=4.0).items
    autopilot.set_items(items)
    autopilot.advance(20_000)
    assert autopilot.start_mission() == ""
    told = [out.message for out in autopilot.advance(120_000)]
    seqs = [m.seq for m in told if m.get_type() == "MISSION_ITEM_REACHED"]
    assert seqs.count(2) == 11, "the last waypoint but one: 15 s until the next"
    assert seqs[-1] == len(items) - 1
    assert not autopilot.armed
