from __future__ import annotations

import time
from itertools import pairwise
from typing import Any

import pytest
from fakes import flying, mission

from dslam_mav.mav.frames import Encoder, messages
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.transfer import download, upload
from dslam_mav.mav.readings import to_message
from dslam_mav.observations import Reading
from sim_bridge.loopback.router import Router

M = messages()


def expect(link: Link, kind: str, timeout_s: float = 3.0, **fields: object) -> Any:
    """The next message of that kind with those fields."""
    until_s = time.monotonic() + timeout_s
    while (left_s := until_s - time.monotonic()) > 0:
        frame = link.receive(left_s)
        if frame is None:
            break
        m = frame.message
        if m.get_type() == kind and all(getattr(m, name) == value for name, value in fields.items()):
            return m
    return None


def command(link: Link, number: int, *params: float) -> int:
    link.send(M.MAVLink_command_long_message(1, 1, number, 0, *params, *(0.0,) * (7 - len(params))))
    ack = expect(link, "COMMAND_ACK", command=number)
    assert ack is not None
    return int(ack.result)


def test_readings_pass_between_peers_of_one_port_unchanged_and_all() -> None:
    with flying() as (url,):
        with Link(url, system=1, component=158) as bridge, Link(url, system=1, component=191) as estimator:
            for link in (bridge, estimator):
                wait_for_vehicle(link, 5.0)
            sent = [Reading(k, k / 3) for k in range(500)]
            for reading in sent:
                bridge.send(to_message(reading))
                time.sleep(0.0002)
            got = [expect(estimator, "NAMED_VALUE_FLOAT") for _ in sent]
            assert [m.time_boot_ms for m in got] == [r.time_boot_ms for r in sent]
            assert {(m.get_srcSystem(), m.get_srcComponent()) for m in got} == {(1, 158)}
            assert expect(bridge, "NAMED_VALUE_FLOAT", 0.3) is None  # no echo


def test_udp_and_tcp_peers_hear_each_other() -> None:
    with flying("udpin:127.0.0.1:0", "tcpin:127.0.0.1:0") as (udp, tcp):
        with Link(udp, system=1, component=158) as bridge, Link(tcp, system=1, component=191) as estimator:
            for link in (bridge, estimator):
                wait_for_vehicle(link, 5.0)
            bridge.send(to_message(Reading(1, 2.5)))
            assert expect(estimator, "NAMED_VALUE_FLOAT").value == 2.5


def test_who_never_said_anything_hears_nothing() -> None:
    with flying() as (url,), Link(url, system=1, component=191) as mute:
        assert mute.receive(0.5) is None


def test_a_targeted_message_goes_only_where_its_target_is() -> None:
    with flying() as (url,):
        with (
            Link(url, system=255, component=190) as station,
            Link(url, system=1, component=191) as estimator,
            Link(url, system=1, component=158) as bridge,
        ):
            for link in (station, estimator, bridge):
                wait_for_vehicle(link, 5.0)
            station.send(M.MAVLink_command_long_message(1, 191, 31010, 0, *(0.0,) * 7))
            assert expect(estimator, "COMMAND_LONG") is not None
            assert expect(bridge, "COMMAND_LONG", 0.3) is None


def test_an_impostor_is_not_passed_on() -> None:
    with flying() as (url,):
        with Link(url, system=1, component=1) as impostor, Link(url, system=1, component=191) as estimator:
            wait_for_vehicle(estimator, 5.0)
            impostor.send(to_message(Reading(1, 2.5)))
            assert expect(estimator, "NAMED_VALUE_FLOAT", 0.4) is None


def routed(router: Router, peer: str, source: tuple[int, int], message: Any) -> tuple[bool, set[object]]:
    Encoder(*source).pack(message)  # writes the source into the message
    ours, others = router.route(peer, message)
    return ours, set(others)


def test_routing_rules() -> None:
    router = Router(1, 1)
    beat = M.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    assert routed(router, "a", (255, 190), beat) == (True, set())
    assert routed(router, "b", (1, 191), beat) == (True, {"a"})
    assert routed(router, "c", (1, 158), beat) == (True, {"a", "b"})
    to = M.MAVLink_command_long_message
    zeros = (0.0,) * 7
    assert routed(router, "a", (255, 190), to(1, 1, 400, 0, *zeros)) == (True, set())
    assert routed(router, "a", (255, 190), to(1, 0, 400, 0, *zeros)) == (True, {"b", "c"})
    assert routed(router, "a", (255, 190), to(1, 191, 400, 0, *zeros)) == (False, {"b"})
    assert routed(router, "b", (1, 191), to(255, 190, 400, 0, *zeros)) == (False, {"a"})
    assert routed(router, "a", (255, 190), to(7, 1, 400, 0, *zeros)) == (False, set())
    assert routed(router, "b", (1, 1), beat) == (False, set())
    # several components behind one peer: told once
    assert routed(router, "b", (1, 192), beat) == (True, {"a", "c"})
    assert routed(router, "a", (255, 190), beat) == (True, {"b", "c"})
    router.forget("c")
    assert routed(router, "a", (255, 190), beat) == (True, {"b"})


def test_a_message_rate_is_each_peers_own() -> None:
    with flying() as (url,):
        with Link(url, system=255, component=190) as one, Link(url, system=254, component=190) as two:
            for link in (one, two):
                wait_for_vehicle(link, 5.0)
            assert command(one, 511, 32, -1) == 0
            while expect(one, "LOCAL_POSITION_NED", 0.3) is not None:
                pass
            assert expect(two, "LOCAL_POSITION_NED", 0.5) is not None
            assert command(one, 511, 32, 100_000) == 0
            times = [expect(one, "LOCAL_POSITION_NED").time_boot_ms for _ in range(4)]
            assert [b - a for a, b in pairwise(times)] == [100, 100, 100]
            assert command(one, 510, 32) == 0
            assert expect(one, "MESSAGE_INTERVAL", message_id=32).interval_us == 100_000
            assert command(one, 511, 999_999, 1000) == 2


def test_what_a_station_asks_for() -> None:
    with flying(cruise_speed_m_s=7.0) as (url,), Link(url, system=255, component=190) as link:
        wait_for_vehicle(link, 5.0)
        assert command(link, 512, 148) == 0
        version = expect(link, "AUTOPILOT_VERSION")
        assert version.capabilities & M.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        assert command(link, 512, 242) == 0
        assert expect(link, "HOME_POSITION").latitude == 473977420
        assert command(link, 31000) == 3  # unsupported
        link.send(M.MAVLink_param_request_list_message(1, 1))
        assert expect(link, "PARAM_VALUE", param_index=0).param_value == 7.0
        assert expect(link, "PARAM_VALUE", param_index=1).param_count == 2
        link.send(M.MAVLink_mission_request_list_message(1, 1, 1))
        assert expect(link, "MISSION_COUNT").mission_type == 1


def test_arming_and_starting_without_a_mission_are_answered() -> None:
    with flying() as (url,), Link(url, system=255, component=190) as link:
        wait_for_vehicle(link, 5.0)
        assert command(link, 300) == 2
        assert command(link, 400, 1) == 0
        assert expect(link, "HEARTBEAT").base_mode & M.MAV_MODE_FLAG_SAFETY_ARMED
        assert command(link, 300) == 2
        assert expect(link, "STATUSTEXT") is not None
        assert command(link, 400, 0) == 0


@pytest.mark.parametrize("junk", [b"", b"\xfd", b"\xfe" * 300, b"\xfd\xff" * 200])
def test_junk_does_not_disturb(junk: bytes) -> None:
    with flying() as (url,), Link(url, system=255, component=190) as link:
        assert link._sock is not None
        link._sock.send(junk)
        wait_for_vehicle(link, 5.0)
        upload(link, 1, mission())
        assert len(download(link, 1).items) == 11


def test_it_keeps_up_at_fifty_fold_with_three_peers() -> None:
    with flying(speedup=50.0) as (url,):
        links = [Link(url, system=1, component=c) for c in (158, 191, 190)]
        try:
            for link in links:
                wait_for_vehicle(link, 5.0)
            first_ms = expect(links[0], "SYSTEM_TIME").time_boot_ms
            began_s = time.monotonic()
            time.sleep(1.0)
            last_ms, count = first_ms, 0
            while (frame := links[0].receive(0.0)) is not None:
                if frame.message.get_type() == "LOCAL_POSITION_NED":
                    last_ms, count = frame.message.time_boot_ms, count + 1
            simulated_s = (last_ms - first_ms) / 1000.0
            assert simulated_s > 25.0 * (time.monotonic() - began_s)  # a busy machine may halve it
            assert count == pytest.approx(50 * simulated_s, rel=0.02)  # none lost
        finally:
            for link in links:
                link.close()
