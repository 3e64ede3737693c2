from __future__ import annotations

import os
import socket
import time

import pytest
from fakes import flying

from dslam_mav.errors import BadInputError, LinkError
from dslam_mav.mav.frames import Encoder, messages
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.readings import to_message
from dslam_mav.observations import Reading


def connected(link: Link, component: int = 191) -> Link:
    """The other end of a `udpin` link, heard already."""
    other = Link(link.url.replace("udpin", "udpout"), system=1, component=component)
    other.send_heartbeat()
    frame = link.receive(2.0)
    assert frame is not None
    assert frame.message.get_srcComponent() == component
    return other


def test_a_burst_waits_for_an_owner_who_is_busy() -> None:
    with Link("udpin:127.0.0.1:0", system=1, component=1) as vehicle, connected(vehicle) as owner:
        for k in range(6000):
            vehicle.send(to_message(Reading(k, 1.0)))
            if k % 100 == 99:
                time.sleep(0.005)
        got = [frame.message.time_boot_ms for frame in iter(lambda: owner.receive(0.2), None)]
        assert got == list(range(6000))
        assert owner.bad_bytes == 0


def test_udpin_answers_everybody_it_heard() -> None:
    with Link("udpin:127.0.0.1:0", system=1, component=1) as vehicle:
        with connected(vehicle, 191) as a, connected(vehicle, 190) as b:
            vehicle.send_heartbeat()
            for end in (a, b):
                frame = end.receive(2.0)
                assert frame is not None
                assert frame.message.get_type() == "HEARTBEAT"


def test_a_packet_cut_over_two_datagrams_arrives() -> None:
    raw = Encoder(1, 1).pack(to_message(Reading(5, 2.0)))
    with (
        Link("udpin:127.0.0.1:0", system=1, component=191) as link,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock,
    ):
        address = ("127.0.0.1", int(link.url.rpartition(":")[2]))
        sock.sendto(b"junk" + raw[:9], address)
        sock.sendto(raw[9:], address)
        frame = link.receive(2.0)
        assert frame is not None
        assert frame.raw == raw
        assert link.bad_bytes == 4


def test_tcp_both_ways_and_its_end_is_an_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with Link(f"tcp:127.0.0.1:{port}", system=1, component=191) as link:
            conn, _ = server.accept()
            with conn:
                conn.sendall(Encoder(1, 1).pack(to_message(Reading(5, 2.0))))
                frame = link.receive(2.0)
                assert frame is not None
                link.send_heartbeat()
                assert conn.recv(100)[:1] == b"\xfd"
            with pytest.raises(LinkError, match="closed the connection"):
                link.receive(2.0)


def test_serial_port() -> None:
    master, slave = os.openpty()
    try:
        with Link(f"{os.ttyname(slave)},57600", system=1, component=191) as link:
            os.write(master, Encoder(1, 1).pack(to_message(Reading(5, 2.0))))
            frame = link.receive(2.0)
            assert frame is not None
            assert frame.message.value == 2.0
            link.send_heartbeat()
            assert os.read(master, 100)[:1] == b"\xfd"
    finally:
        os.close(master)
        os.close(slave)


def test_receive_times_out_and_system_can_be_set() -> None:
    with Link("udpin:127.0.0.1:0", system=1, component=158) as link, connected(link) as other:
        began_s = time.monotonic()
        assert link.receive(0.1) is None
        assert 0.05 < time.monotonic() - began_s < 1.0
        link.system = 42
        link.send_heartbeat()
        frame = other.receive(2.0)
        assert frame is not None
        assert (frame.message.get_srcSystem(), frame.message.get_srcComponent()) == (42, 158)


def test_sending_on_a_closed_link_is_an_error_and_closing_twice_is_none() -> None:
    link = Link("udpin:127.0.0.1:0", system=1, component=191)
    link.close()
    link.close()
    with pytest.raises(LinkError, match="closed"):
        link.send_heartbeat()


def test_nobody_listening_yet_is_no_error() -> None:
    with Link("udpin:127.0.0.1:0", system=1, component=1) as free:
        url = free.url.replace("udpin", "udpout")
    with Link(url, system=1, component=191) as link:
        for _ in range(3):
            link.send_heartbeat()
            assert link.receive(0.02) is None


@pytest.mark.parametrize(
    ("url", "part"),
    [
        ("udpin:127.0.0.1", "host ''"),
        ("udpin:127.0.0.1:99999", "port '99999'"),
        ("udpin:127.0.0.1:abc", "port 'abc'"),
        ("udpout:127.0.0.1:0", "port '0'"),
        ("http:127.0.0.1:80", "kind 'http'"),
        ("tcpin:127.0.0.1:80", "kind 'tcpin'"),
        ("", "kind ''"),
        ("/dev/ttyACM0,fast", "baud 'fast'"),
    ],
)
def test_malformed_url_names_the_part(url: str, part: str) -> None:
    with pytest.raises(BadInputError) as caught:
        Link(url, system=1, component=191)
    assert part in str(caught.value)
    assert "\n" not in str(caught.value)


def test_port_in_use_unknown_host_and_refused_connection_are_one_line() -> None:
    with Link("udpin:127.0.0.1:0", system=1, component=1) as link:
        with pytest.raises(LinkError, match=r"port [0-9]+ is in use"):
            Link(link.url, system=1, component=1)
    with pytest.raises(LinkError, match=r"host .nowhere\.invalid. is unknown"):
        Link("udpout:nowhere.invalid:5", system=1, component=1)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(LinkError, match="connection refused"):
        Link(f"tcp:127.0.0.1:{port}", system=1, component=1)
    with pytest.raises(LinkError, match="no such file"):
        Link("/dev/no-such-port,57600", system=1, component=1)


def test_wait_for_vehicle_passes_over_companions_and_stations() -> None:
    dialect = messages()
    with Link("udpin:127.0.0.1:0", system=9, component=1) as vehicle, connected(vehicle) as owner:
        for system, component, kind, autopilot in ((255, 190, 6, 8), (9, 191, 18, 8), (9, 1, 2, 3)):
            raw = Encoder(system, component).pack(dialect.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3))
            vehicle._write(raw)
        assert wait_for_vehicle(owner, 2.0) == 9
        assert owner.autopilots == {9: (3, 2)}


def test_no_vehicle_is_one_line() -> None:
    with Link("udpin:127.0.0.1:0", system=255, component=190) as link:
        with pytest.raises(LinkError, match=r"no vehicle answered on udpin:127.0.0.1:[0-9]+ within 0.3 s"):
            wait_for_vehicle(link, 0.3)


def test_a_vehicle_over_tcp_answers_at_once() -> None:
    with flying("tcpin:127.0.0.1:0") as (url,), Link(url, system=255, component=190) as link:
        began_s = time.monotonic()
        assert wait_for_vehicle(link, 5.0) == 1
        assert time.monotonic() - began_s < 0.8
