"""Several senders on one connection: what each hears, and what happens when it is gone."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from fakes import flying

from dslam_mav.errors import LinkError
from dslam_mav.mav.frames import Encoder, Parser, messages
from dslam_mav.mav.hub import Hub, Role
from dslam_mav.mav.link import wait_for_vehicle
from dslam_mav.mav.readings import to_message
from dslam_mav.mav.signing import Signing
from dslam_mav.observations import Reading

M = messages()


@contextmanager
def one_place() -> Iterator[tuple[str, socket.socket]]:
    """A TCP server with a single place, as ArduPilot's simulator has at each port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"tcp:127.0.0.1:{server.getsockname()[1]}", server


def hear(role: Role, kind: str, timeout_s: float = 5.0) -> Any:
    until_s = time.monotonic() + timeout_s
    while (left_s := until_s - time.monotonic()) > 0:
        frame = role.receive(left_s)
        if frame is not None and frame.message.get_type() == kind:
            return frame.message
    return None


def test_three_roles_share_one_connection_and_each_keeps_its_own_numbers() -> None:
    with one_place() as (url, server), Hub(url) as hub:
        roles = [hub.join(255, 190), hub.join(1, 191), hub.join(1, 158)]
        far, _ = server.accept()
        with far:
            for _ in range(2):
                for role in roles:
                    role.send_heartbeat()
            parser, got = Parser(), []
            while len(got) < 6:
                got += parser.feed(far.recv(4096), 0)
            heads = [(f.message.get_srcSystem(), f.message.get_srcComponent(), f.raw[4]) for f in got]
            assert heads == [(255, 190, 0), (1, 191, 0), (1, 158, 0), (255, 190, 1), (1, 191, 1), (1, 158, 1)]
            far.sendall(Encoder(1, 1).pack(M.MAVLink_vfr_hud_message(0, 3.5, 0, 0, 0, 0)))
            assert [hear(role, "VFR_HUD").groundspeed for role in roles] == [3.5] * 3


def test_roles_hear_each_other_as_over_a_vehicle_that_forwards() -> None:
    with one_place() as (url, server), Hub(url) as hub:
        ground, estimator, bridge = hub.join(255, 190), hub.join(1, 191), hub.join(1, 158)
        far, _ = server.accept()
        with far:
            bridge.send(to_message(Reading(1234, 7.5)))
            for role in (ground, estimator):
                heard = hear(role, "NAMED_VALUE_FLOAT")
                assert (heard.time_boot_ms, heard.value, heard.get_srcComponent()) == (1234, 7.5, 158)
            assert bridge.receive(0.05) is None  # no echo
            ground.send(M.MAVLink_param_request_read_message(1, 158, b"X", -1))
            assert hear(bridge, "PARAM_REQUEST_READ") is not None
            assert estimator.receive(0.05) is None  # meant for another


def test_signed_roles_are_heard_by_a_signing_vehicle() -> None:
    key = Signing(bytes(range(32)))
    with flying(signing=Signing(bytes(range(32)))) as (url,), Hub(url, signing=key) as hub:
        ground, bridge = hub.join(255, 190), hub.join(1, 158)
        assert wait_for_vehicle(ground, 5.0) == 1
        bridge.send(to_message(Reading(5, 1.0)))
        assert hear(ground, "NAMED_VALUE_FLOAT").value == 1.0


def test_everybody_is_told_when_the_other_end_leaves() -> None:
    with one_place() as (url, server), Hub(url) as hub:
        roles = [hub.join(255, 190), hub.join(1, 191)]
        server.accept()[0].close()
        for role in roles:
            with pytest.raises(LinkError, match="closed the connection"):
                hear(role, "HEARTBEAT")
