"""The loopback vehicle with ArduPilot's ways, as measured on ArduCopter 4.7, and our side living with each of them."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from fakes import flying, mission

from dslam_mav.errors import LinkError, MissionError
from dslam_mav.mav.frames import messages
from dslam_mav.mav.hub import Hub
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.messages import to_message
from dslam_mav.mav.mission.protocol import Item
from dslam_mav.mav.mission.transfer import download, start, upload
from dslam_mav.mav.position import stands_at
from dslam_mav.mav.readings import to_message as reading_message
from dslam_mav.mav.streams import stream_request
from dslam_mav.mission import Home, Mission, leg_plan, with_home_item
from dslam_mav.observations import Reading
from sim_bridge.odometry_feed import OdometryFeed
from sim_bridge.vehicle import DEFAULT_HOME

M = messages()
SQUARE = [(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0), (0.0, 0.0)]


@contextmanager
def vehicle(**options: Any) -> Iterator[Link]:
    """An ArduPilot of ours, and a ground station that has met it."""
    with flying(profile="ardupilot", **options) as (url,), Link(url, system=255, component=190) as link:
        wait_for_vehicle(link, 5.0)
        yield link


def hear(link: Link, kind: str, timeout_s: float = 5.0) -> Any:
    until_s = time.monotonic() + timeout_s
    while (left_s := until_s - time.monotonic()) > 0:
        frame = link.receive(left_s)
        if frame is not None and frame.message.get_type() == kind:
            return frame.message
    return None


def all_heard(link: Link, seconds: float) -> list[str]:
    until_s, kinds = time.monotonic() + seconds, []
    while (left_s := until_s - time.monotonic()) > 0:
        frame = link.receive(left_s)
        if frame is not None:
            kinds.append(frame.message.get_type())
    return kinds


def test_nothing_is_streamed_unasked_and_only_to_who_asked() -> None:
    with flying(profile="ardupilot", speedup=10.0) as (url,):
        with Link(url, system=255, component=190) as one, Link(url, system=255, component=191) as other:
            for link in (one, other):
                wait_for_vehicle(link, 5.0)
            assert set(all_heard(one, 0.5)) <= {"HEARTBEAT", "STATUSTEXT", "PARAM_VALUE"}
            one.send(stream_request(1, "SIM_STATE", 50_000))
            assert hear(one, "SIM_STATE") is not None
            assert "SIM_STATE" not in all_heard(other, 0.3)


def test_readings_are_forwarded_to_those_only_who_sent_something() -> None:
    with flying("udpin:127.0.0.1:0", profile="ardupilot") as (url,):
        with Link(url, system=1, component=158) as bridge, Link(url, system=1, component=191) as deaf:
            wait_for_vehicle(bridge, 5.0)
            bridge.send(reading_message(Reading(1, 1.0)))
            assert "NAMED_VALUE_FLOAT" not in all_heard(deaf, 0.3)
            deaf.send_heartbeat()
            assert hear(deaf, "HEARTBEAT") is not None
            bridge.send(reading_message(Reading(2, 2.0)))
            assert hear(deaf, "NAMED_VALUE_FLOAT").value == 2.0


def test_home_comes_in_item_0_nothing_unset_is_sent_and_roundings_are_no_difference() -> None:
    plan = mission(hold_s=2.7)  # with NaN in its take-off, which ArduPilot refuses
    plan = Mission(
        tuple(i if i.command != 16 else type(i)(16, 6, i.params, i.x, i.y, 10.004) for i in plan.items), plan.home
    )
    with vehicle() as link:
        held = upload(link, 1, plan)
        assert len(held.items) == len(plan.items) + 1
        assert (held.items[0].frame, held.home) == (0, DEFAULT_HOME)
        first = held.waypoints()[0][1]
        assert (first.frame, first.params[0], first.z) == (3, 2.0, pytest.approx(10.0))
        assert leg_plan(held).vertices_m == pytest.approx(leg_plan(plan).vertices_m, abs=0.03)
        assert download(link, 1).home == DEFAULT_HOME


def test_a_take_off_put_first_would_be_swallowed() -> None:
    with vehicle() as link:
        items = mission().items
        link.send(M.MAVLink_mission_count_message(1, 1, len(items)))
        for seq, item in enumerate(items):
            assert hear(link, "MISSION_REQUEST").seq == seq
            params = tuple(0.0 if math.isnan(p) else p for p in item.params)
            link.send(to_message(Item(seq, type(item)(item.command, item.frame, params, item.x, item.y, item.z)), 1, 1))
        assert hear(link, "MISSION_ACK").type == 0
        assert download(link, 1).items[0].command == 16


def test_13_in_the_middle_is_not_the_end() -> None:
    """A duplicate is answered with 13, and the upload goes on: what our uploader must sit through."""
    plan = with_home_item(mission(hold_s=1.0))
    with vehicle() as link:
        send, doubled = link.send, []

        def twice(message: Any) -> None:
            send(message)
            if message.get_type() == "MISSION_ITEM_INT" and message.seq in (3, 7):
                doubled.append(message.seq)
                send(message)

        link.send = twice  # type: ignore[method-assign]
        assert len(upload(link, 1, plan).items) == len(plan.items)
        assert doubled == [3, 7]


def test_an_upload_it_waited_too_long_for_is_begun_again() -> None:
    """The item that is lost until 15 comes: what our uploader must not take for a refusal."""
    plan = with_home_item(mission(hold_s=1.0))
    with vehicle(speedup=20.0) as link:
        send, receive, acks = link.send, link.receive, []

        def lossy(message: Any) -> None:
            if acks or message.get_type() != "MISSION_ITEM_INT" or message.seq != 3:
                send(message)

        def heard(timeout_s: float) -> Any:
            frame = receive(timeout_s)
            if frame is not None and frame.message.get_type() == "MISSION_ACK":
                acks.append(frame.message.type)
            return frame

        link.send, link.receive = lossy, heard  # type: ignore[method-assign]
        assert len(upload(link, 1, plan).items) == len(plan.items)
        assert acks[:2] == [15, 0]


def test_an_upload_broken_off_leaves_a_mixture_that_reading_back_finds_out() -> None:
    with vehicle(speedup=20.0) as link:
        upload(link, 1, mission(hold_s=1.0))
        link.send(M.MAVLink_mission_count_message(1, 1, 11))
        assert hear(link, "MISSION_REQUEST").seq == 0
        assert hear(link, "MISSION_ACK").type == 15  # after 8 s of silence by its own time
        assert len(download(link, 1).items) == 11  # of 12: truncated by the mere offer


def test_arming_waits_with_the_reason_shown_and_guided_comes_first() -> None:
    with vehicle(speedup=20.0, feed="gps") as link:
        upload(link, 1, mission(hold_s=1.0))
        with pytest.raises(MissionError, match=r'refused to arm: \w+: "PreArm: '):
            start(link, 1)
        why: list[str] = []
        start(link, 1, 20.0, why.append)
        assert "PreArm" in why[0]
        until_s = time.monotonic() + 5.0
        while time.monotonic() < until_s and link.autopilots[1][0] == 3:
            beat = hear(link, "HEARTBEAT")
            if beat.custom_mode == 3:
                break
        assert (beat.custom_mode, bool(beat.base_mode & 128)) == (3, True)


def test_a_start_that_is_accepted_and_not_flown_is_found_out() -> None:
    with vehicle(speedup=20.0) as link:
        upload(link, 1, mission(hold_s=1.0))
        link.send(M.MAVLink_command_long_message(1, 1, 300, 0, *(0.0,) * 7))
        assert hear(link, "COMMAND_ACK").result == 0
        assert not hear(link, "HEARTBEAT").base_mode & 128


def test_without_gps_it_is_told_where_it_stands() -> None:
    there = Home(-35.363262, 149.165237, 584.0)
    with vehicle(feed="flow", speedup=20.0, home=there) as link:
        link.send(stream_request(1, "GLOBAL_POSITION_INT", 100_000))
        assert hear(link, "GLOBAL_POSITION_INT").lat == 0
        place = stands_at(link, 1, Home(47.0, 8.0, 400.0), 20.0)
        assert (place.latitude_deg, place.longitude_deg) == pytest.approx((-35.363262, 149.165237), abs=1e-6)


def test_a_feed_that_stops_lands_it() -> None:
    with flying("tcpin:127.0.0.1:0", profile="ardupilot", feed="odometry", speedup=20.0) as (url,):
        with Hub(url) as hub:
            ground = hub.join(255, 190)
            assert wait_for_vehicle(ground, 5.0) == 1
            stands_at(ground, 1, None, 20.0)
            upload(ground, 1, mission(hold_s=1.0))
            with pytest.raises(MissionError, match=r"VisOdom: not healthy|still initialising"):
                start(ground, 1)
            feed, stop = OdometryFeed(hub.join(1, 197), 1), threading.Event()
            feeding = threading.Thread(target=feed.run, args=(stop,))
            feeding.start()
            try:
                start(ground, 1, 20.0)
            finally:
                stop.set()
                feeding.join()
            assert feed.sent > 0
            until_s, said = time.monotonic() + 10.0, ""
            while time.monotonic() < until_s and "Failsafe" not in said:
                frame = ground.receive(1.0)
                if frame is not None and frame.message.get_type() == "STATUSTEXT":
                    said = frame.message.text
            assert "LAND" in said


def test_a_tcp_port_serves_one_at_a_time() -> None:
    with flying("tcpin:127.0.0.1:0", profile="ardupilot") as (url,):
        with Link(url, system=255, component=190) as first:
            wait_for_vehicle(first, 5.0)
            with Link(url, system=255, component=191) as second:
                with pytest.raises(LinkError, match=r"no vehicle answered .*serves one at a time"):
                    wait_for_vehicle(second, 0.5)
        with Link(url, system=255, component=190) as third:
            assert wait_for_vehicle(third, 5.0) == 1
