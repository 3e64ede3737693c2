"""Somebody else's client against our vehicle, and our client against somebody else's vehicle."""

from __future__ import annotations

import json
import math
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from fakes import flying, mission

from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.compare import first_difference
from dslam_mav.mav.mission.transfer import download, start, upload
from dslam_mav.mav.readings import to_message
from dslam_mav.mission import MissionItem, leg_plan, with_home_item
from dslam_mav.observations import Reading
from missions.plan_file import plan_bytes

mavsdk = pytest.importorskip("mavsdk.mavsdk", reason="needs the mavsdk package")
component_type = pytest.importorskip("mavsdk.component_type")
mission_raw = pytest.importorskip("mavsdk.plugins.mission_raw.mission_raw")
mission_raw_server = pytest.importorskip("mavsdk.plugins.mission_raw_server.mission_raw_server")
action = pytest.importorskip("mavsdk.plugins.action.action")
mavlink_direct = pytest.importorskip("mavsdk.plugins.mavlink_direct.mavlink_direct")


@pytest.fixture
def client(request: pytest.FixtureRequest) -> Iterator[Any]:
    kind = getattr(component_type.ComponentType, request.param)
    sdk = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
    yield sdk
    sdk.destroy()


@pytest.mark.parametrize("client", ["GROUND_STATION"], indirect=True)
def test_mavsdk_uploads_reads_back_flies_and_hears_progress(client: Any) -> None:
    plan = mission()
    with flying(speedup=25.0) as (url,):
        client.add_any_connection("udpout://" + url.partition(":")[2])
        system = client.first_autopilot(10.0)
        raw, pilot = mission_raw.MissionRaw(system), action.Action(system)
        items = [
            mission_raw.MissionItem(q, i.frame, i.command, int(q == 0), 1, *i.params, i.x, i.y, i.z, 0)
            for q, i in enumerate(plan.items)
        ]
        raw.upload_mission(items)
        held = tuple(
            MissionItem(i.command, i.frame, (i.param1, i.param2, i.param3, i.param4), i.x, i.y, i.z)
            for i in raw.download_mission()
        )
        assert first_difference(plan.items, held) is None
        heard: list[tuple[int, int]] = []
        raw.subscribe_mission_progress(lambda progress, _: heard.append((progress.current, progress.total)))
        pilot.arm()
        raw.start_mission()
        until_s = time.monotonic() + 20.0
        while not raw.is_mission_finished() and time.monotonic() < until_s:
            time.sleep(0.1)
        assert raw.is_mission_finished()
        assert {(seq, 11) for seq in range(2, 11)} <= set(heard)
        raw.clear_mission()


@pytest.mark.parametrize("client", ["AUTOPILOT"], indirect=True)
def test_our_upload_to_mavsdks_vehicle(client: Any) -> None:
    plan = mission()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    client.add_any_connection(f"udpin://127.0.0.1:{port}")
    server = mission_raw_server.MissionRawServer(client.server_component())
    got: list[Any] = []
    arrived = threading.Event()

    def take(result: Any, incoming: Any, _: Any) -> None:
        got.append(incoming)
        arrived.set()

    server.subscribe_incoming_mission(take)
    with Link(f"udpout:127.0.0.1:{port}", system=255, component=190) as link:
        vehicle = wait_for_vehicle(link, 10.0)
        held = upload(link, vehicle, plan)
        assert first_difference(plan.items, held.items) is None
        assert arrived.wait(5.0)
        assert [item.command for item in got[0].mission_items] == [item.command for item in plan.items]


@pytest.mark.parametrize("client", ["GROUND_STATION"], indirect=True)
def test_mavsdk_hears_our_readings_through_the_vehicle(client: Any) -> None:
    with flying() as (url,):
        client.add_any_connection("udpout://" + url.partition(":")[2])
        direct = mavlink_direct.MavlinkDirect(client.first_autopilot(10.0))
        heard: list[dict[str, Any]] = []
        arrived = threading.Event()

        def take(message: Any, _: Any) -> None:
            heard.append(json.loads(message.fields_json))
            arrived.set()

        direct.subscribe_message("NAMED_VALUE_FLOAT", take)
        with Link(url, system=1, component=158) as bridge:
            wait_for_vehicle(bridge, 5.0)
            until_s = time.monotonic() + 10.0
            while not arrived.is_set() and time.monotonic() < until_s:
                bridge.send(to_message(Reading(1234, 21.5)))
                arrived.wait(0.2)
        assert heard, "no reading came"
        assert (heard[0]["name"], heard[0]["value"], heard[0]["time_boot_ms"]) == ("THERMAL", 21.5, 1234)


@pytest.mark.parametrize("client", ["GROUND_STATION"], indirect=True)
@pytest.mark.parametrize(("ending", "profile"), [(".plan", "ardupilot"), (".waypoints", "strict")])
def test_mavsdk_uploads_our_files_and_they_are_flown(client: Any, ending: str, profile: str) -> None:
    """Read by MAVSDK from our file, uploaded by it, and held by the vehicle as our own reader has it.

    Not a text file to an ArduPilot: MAVSDK puts a home of its own before the file's.
    """
    plan = with_home_item(mission(hold_s=1.0))
    with flying(profile=profile, speedup=25.0) as (url,):
        client.add_any_connection("udpout://" + url.partition(":")[2])
        raw = mission_raw.MissionRaw(client.first_autopilot(10.0))
        text = plan_bytes(plan, ending).decode()
        if ending == ".plan":
            items = raw.import_qgroundcontrol_mission_from_string(text).mission_items
        else:
            items = raw.import_mission_planner_mission_from_string(text).mission_items
        for item in items:  # as MAVSDK's own users must: ArduPilot refuses parameters that are not set
            for name in ("param1", "param2", "param3", "param4"):
                value = getattr(item, name)
                setattr(item, name, 0.0 if math.isnan(value) else value)
        raw.upload_mission(items)
        with Link(url, system=255, component=190) as ground:
            wait_for_vehicle(ground, 5.0)
            held = download(ground, 1)
            assert leg_plan(held).vertices_m == pytest.approx(leg_plan(plan).vertices_m, abs=0.03)
            start(ground, 1, 20.0)
