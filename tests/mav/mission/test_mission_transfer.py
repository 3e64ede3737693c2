from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from fakes import LossyRadio, ScriptedVehicle, flying, mission

from dslam_mav.errors import LinkError, MissionError
from dslam_mav.mav.frames import messages
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission import protocol, talk
from dslam_mav.mav.mission.compare import first_difference
from dslam_mav.mav.mission.transfer import clear, download, upload
from dslam_mav.mission import CMD_WAYPOINT, Mission, MissionItem
from sim_bridge.vehicle import DEFAULT_HOME

M = messages()


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """The standard's patience, in a fifth of its time."""
    monkeypatch.setattr(talk, "SILENCE_S", 1.0)
    monkeypatch.setattr(protocol, "TIMEOUT_S", 0.3)


def ground(url: str) -> Link:
    return Link(url, system=255, component=190)


def test_upload_reads_back_what_was_sent_and_clear_forgets_it() -> None:
    plan = mission()
    with flying() as (url,), ground(url) as link:
        system = wait_for_vehicle(link, 5.0)
        heard: list[tuple[int, int]] = []
        held = upload(link, system, plan, lambda done, n: heard.append((done, n)))
        assert first_difference(plan.items, held.items) is None
        assert held.home == plan.home
        assert heard[-1] == (11, 11)
        down = download(link, system)
        assert first_difference(plan.items, down.items) is None
        assert down.home == DEFAULT_HOME
        clear(link, system)
        assert download(link, system).items == ()


def test_an_empty_mission_can_be_uploaded() -> None:
    with flying() as (url,), ground(url) as link:
        upload(link, 1, mission())
        assert upload(link, 1, Mission(())).items == ()


def test_a_radio_that_loses_three_packets_in_ten() -> None:
    plan = mission([(0.0, 5.0 * k) for k in range(3)])
    with flying() as (url,), LossyRadio(url, loss=0.3, double=0.1, seed=4) as radio:
        with ground(radio.url) as link:
            held = upload(link, wait_for_vehicle(link, 10.0), plan)
            assert first_difference(plan.items, held.items) is None
            assert radio.lost > 0


@pytest.mark.parametrize(
    ("item", "words"),
    [
        (MissionItem(31, 6, (0.0,) * 4, 473977420, 85455940, 10.0), "unsupported command.*command 31 is not"),
        (MissionItem(CMD_WAYPOINT, 1, (0.0,) * 4, 1, 1, 10.0), "unsupported frame"),
        (MissionItem(CMD_WAYPOINT, 6, (0.0,) * 4, 2_000_000_000, 1, 10.0), "invalid latitude"),
        (MissionItem(CMD_WAYPOINT, 6, (0.0,) * 4, 473977420, 2_000_000_000, 10.0), "invalid longitude"),
        (MissionItem(CMD_WAYPOINT, 6, (0.0,) * 4, 473977420, 85455940, float("nan")), "invalid altitude"),
        (MissionItem(CMD_WAYPOINT, 6, (-3.0, 0, 0, 0), 473977420, 85455940, 9.0), "invalid parameter 1"),
        (MissionItem(CMD_WAYPOINT, 6, (0.0,) * 4, 0, 85455940, 9.0), "km away"),
    ],
)
def test_a_refused_item_is_named_and_the_old_mission_stays(item: MissionItem, words: str) -> None:
    plan = mission()
    bad = Mission((*plan.items[:3], item, *plan.items[3:]), plan.home)
    with flying() as (url,), ground(url) as link:
        upload(link, 1, plan)
        with pytest.raises(MissionError, match=rf"refused item 3 \(NAV_\w+\): .*{words}|item 3.*{words}") as caught:
            upload(link, 1, bad)
        assert "\n" not in str(caught.value)
        assert first_difference(plan.items, download(link, 1).items) is None


def test_a_vehicle_that_is_not_there(impatient: None) -> None:
    with ScriptedVehicle(lambda message: []) as fake, ground(fake.url) as link:
        fake.vanish()
        with pytest.raises(LinkError, match=r"vehicle 1 on udpout.* does not answer"):
            upload(link, 1, mission())


def test_a_vehicle_that_answers_nothing_but_heartbeats(impatient: None) -> None:
    with ScriptedVehicle(lambda message: []) as fake, ground(fake.url) as link:
        began_s = time.monotonic()
        with pytest.raises(LinkError, match="does not answer the mission protocol"):
            download(link, 1)
        assert time.monotonic() - began_s < 5.0


def test_a_vehicle_that_vanishes_midway(impatient: None) -> None:
    def answer(message: Any) -> list[Any]:
        kind = message.get_type()
        if kind == "MISSION_COUNT":
            return [M.MAVLink_mission_request_int_message(255, 190, 0)]
        if kind == "MISSION_ITEM_INT":
            if message.seq == 3:
                fake.vanish()
            return [M.MAVLink_mission_request_int_message(255, 190, message.seq + 1)]
        return []

    with ScriptedVehicle(answer) as fake, ground(fake.url) as link:
        with pytest.raises(LinkError, match="disappeared during the upload, at item 3 of 11"):
            upload(link, 1, mission())


def taking(result: int, text: bytes = b"") -> Any:
    """Takes a mission by MISSION_REQUEST, the old question, then says `result`."""

    def answer(message: Any) -> list[Any]:
        kind = message.get_type()
        if kind == "MISSION_COUNT":
            return [M.MAVLink_mission_request_message(255, 190, 0)]
        if kind == "MISSION_ITEM_INT" and message.seq < 10:
            return [M.MAVLink_mission_request_message(255, 190, message.seq + 1)]
        if kind == "MISSION_ITEM_INT":
            words = [M.MAVLink_statustext_message(4, text)] if text else []
            return [*words, M.MAVLink_mission_ack_message(255, 190, result)]
        if kind == "MISSION_REQUEST_LIST":
            return [M.MAVLink_mission_count_message(255, 190, 5)]
        if kind in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            item = mission().items[message.seq]
            return [
                M.MAVLink_mission_item_int_message(
                    255,
                    190,
                    message.seq,
                    item.frame,
                    item.command,
                    0,
                    1,
                    *item.params,
                    item.x,
                    item.y,
                    item.z,
                )
            ]
        return []

    return answer


def test_a_vehicle_without_room() -> None:
    with ScriptedVehicle(taking(4, b"memory full")) as fake, ground(fake.url) as link:
        with pytest.raises(MissionError, match='too many items for its memory: "memory full"'):
            upload(link, 1, mission())


def test_a_vehicle_that_keeps_half_of_it_is_found_out_by_reading_back() -> None:
    with ScriptedVehicle(taking(0)) as fake, ground(fake.url) as link:
        with pytest.raises(MissionError, match="11 items were sent, the vehicle holds 5"):
            upload(link, 1, mission())


@pytest.mark.parametrize(("stragglers", "reads"), [(1, True), (9, False)])
def test_a_late_word_on_the_upload_before_does_not_end_reading_back(stragglers: int, reads: bool) -> None:
    """A doubled item that came late is answered with an error, while the mission is read already."""
    told: list[int] = []

    def answer(message: Any) -> list[Any]:
        if message.get_type() == "MISSION_REQUEST_LIST" and len(told) < stragglers:
            told.append(protocol.ERROR)
            return [M.MAVLink_mission_ack_message(255, 190, protocol.ERROR)]
        return list(held(message))

    held = taking(0)
    with ScriptedVehicle(answer) as fake, ground(fake.url) as link:
        if reads:
            assert len(download(link, 1).items) == 5
        else:
            with pytest.raises(MissionError, match="refused to give its mission: error"):
                download(link, 1)


def test_ardupilot_gets_its_home_in_item_0() -> None:
    got: dict[int, Any] = {}

    def answer(message: Any) -> list[Any]:
        kind = message.get_type()
        if kind == "MISSION_COUNT":
            answer.n = message.count  # type: ignore[attr-defined]
            return [M.MAVLink_mission_request_message(255, 190, 0)]
        if kind == "MISSION_ITEM_INT":
            got[message.seq] = message
            if message.seq + 1 < answer.n:  # type: ignore[attr-defined]
                return [M.MAVLink_mission_request_message(255, 190, message.seq + 1)]
            return [M.MAVLink_mission_ack_message(255, 190, 0)]
        if kind == "MISSION_REQUEST_LIST":
            return [M.MAVLink_mission_count_message(255, 190, len(got))]
        if kind != "MISSION_REQUEST_INT":
            return []
        item = got[message.seq]
        item.target_system, item.target_component = 255, 190
        return [item]

    plan = mission()
    with ScriptedVehicle(answer, autopilot=3) as fake, ground(fake.url) as link:
        held = upload(link, 1, plan)
    assert len(held.items) == 12
    assert (held.items[0].command, held.items[0].frame, held.items[0].z) == (16, 0, 488.0)
    assert held.items[1].command == plan.items[0].command


def test_two_stations_at_once_one_wins_and_the_mission_is_whole() -> None:
    plans = [mission(), mission([(0.0, 4.0), (8.0, 4.0), (8.0, 9.0)])]
    ends: list[object] = [None, None]

    def send(index: int, url: str) -> None:
        with Link(url, system=250 + index, component=190) as link:
            try:
                ends[index] = upload(link, 1, plans[index])
            except MissionError as problem:
                ends[index] = problem

    with flying() as (url,):
        threads = [threading.Thread(target=send, args=(k, url)) for k in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        with ground(url) as link:
            held = download(link, 1).items
    assert any(first_difference(plan.items, held) is None for plan in plans)
    assert any(isinstance(end, Mission) for end in ends) or all(isinstance(e, MissionError) for e in ends)
