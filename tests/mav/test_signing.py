"""Signed links: unsigned, forged, replayed and old packets change nothing, whatever their date."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest
from fakes import flying, mission

from dslam_mav.errors import LinkError
from dslam_mav.mav import signing as signing_module
from dslam_mav.mav.frames import Encoder, Parser, messages
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.compare import first_difference
from dslam_mav.mav.mission.transfer import clear, download, upload
from dslam_mav.mav.readings import to_message
from dslam_mav.mav.signing import MOST_LATE, Signing, Verifier
from dslam_mav.observations import Reading

os.environ["MAVLINK20"] = "1"  # else pymavlink's links speak MAVLink 1
from pymavlink import mavutil

M = messages()
KEY, OTHER = bytes(range(1, 33)), bytes(range(2, 34))
GROUND = (255, 190)


class Dated(Signing):
    """Signs with a date of its own."""

    def __init__(self, key: bytes, timestamp: int) -> None:
        super().__init__(key)
        self._fixed = timestamp

    def next_timestamp(self) -> int:
        self._fixed += 1
        return self._fixed


def clear_all(signing: Signing | None, sender: tuple[int, int] = GROUND) -> bytes:
    return Encoder(*sender, signing).pack(M.MAVLink_mission_clear_all_message(1, 1))


def forged(timestamp: int, sender: tuple[int, int] = GROUND) -> bytes:
    """A packet of somebody who knows everything but the key, dated as he likes."""
    return clear_all(Dated(OTHER, timestamp), sender)


def now() -> int:
    return Signing(KEY).now()


def accepted(parser: Parser, raw: bytes) -> bool:
    return len(parser.feed(raw, 0)) == 1


def test_a_signed_packet_is_heard_once_and_only_with_its_key() -> None:
    raw = clear_all(Signing(KEY))
    verifiers = {key: Verifier(Signing(key)) for key in (KEY, OTHER)}
    assert accepted(Parser(verifiers[KEY]), raw)
    assert not accepted(Parser(verifiers[KEY]), raw)
    assert not accepted(Parser(verifiers[OTHER]), raw)
    assert accepted(Parser(), raw)  # without a key signatures are not looked at
    assert (verifiers[KEY].refused, verifiers[OTHER].refused) == ({"replayed": 1}, {"forged": 1})


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (clear_all(None), "unsigned"),
        (clear_all(Signing(OTHER)), "forged"),
        (clear_all(Signing(KEY))[:-1] + b"\0", "forged"),
        (clear_all(Dated(KEY, now() - MOST_LATE - 10**6)), "old"),
    ],
    ids=["unsigned", "another key", "signature cut", "old"],
)
def test_what_is_refused_and_why(raw: bytes, reason: str) -> None:
    verifier = Verifier(Signing(KEY))
    assert not accepted(Parser(verifier), raw)
    assert verifier.refused == {reason: 1}


def test_no_byte_of_a_signed_packet_can_be_changed() -> None:
    raw = clear_all(Signing(KEY))
    for at in range(len(raw)):
        changed = raw[:at] + bytes([raw[at] ^ 1]) + raw[at + 1 :]
        assert not accepted(Parser(Verifier(Signing(KEY))), changed)


def test_one_forged_packet_dated_in_the_future_does_not_lock_the_genuine_sender_out() -> None:
    attack = forged(now() + 10**12)
    assert accepted(Parser(), attack)  # nothing is wrong with it but the signature
    sender, parser = Signing(KEY), Parser(Verifier(Signing(KEY)))
    assert accepted(parser, clear_all(sender))
    assert not accepted(parser, attack)
    assert accepted(parser, clear_all(sender))


def test_times_rise_though_the_clock_steps_back_and_follow_a_peer_whose_clock_is_ahead(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    signing = Signing(KEY)
    first = signing.next_timestamp()
    assert first == pytest.approx((time.time() - 1_420_070_400) * 1e5, abs=1e6)
    monkeypatch.setattr(signing_module.time, "time", lambda: 1_500_000_000.0)
    assert signing.next_timestamp() == first + 1
    ahead = clear_all(Dated(KEY, first + 10**9), (1, 1))
    assert accepted(Parser(Verifier(signing)), ahead)
    assert signing.next_timestamp() > first + 10**9


@pytest.fixture
def signed_vehicle() -> Iterator[str]:
    with flying(signing=Signing(KEY)) as (url,):
        yield url


def address(url: str) -> tuple[str, int]:
    return "127.0.0.1", int(url.rpartition(":")[2])


def test_nobody_without_the_key_changes_a_vehicles_mission_and_its_owner_can(signed_vehicle: str) -> None:
    plan = mission()
    signing = Signing(KEY)
    with (
        Link(signed_vehicle, system=255, component=190, signing=signing) as link,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker,
    ):
        wait_for_vehicle(link, 5.0)
        recorded = clear_all(signing)  # was sent once, before the upload, and is recorded on its way
        assert link._sock is not None
        link._sock.send(recorded)
        upload(link, 1, plan)
        for raw in (
            clear_all(None),
            clear_all(Signing(OTHER)),
            recorded,
            clear_all(Dated(KEY, now() - 2 * MOST_LATE), (254, 190)),
            forged(now() + 10**12),  # dated in the future, as every sender there is
            forged(now() + 10**12, (1, 158)),
        ):
            attacker.sendto(raw, address(signed_vehicle))
        assert first_difference(plan.items, download(link, 1).items) is None
        attacker.settimeout(0.3)
        with pytest.raises(TimeoutError):
            attacker.recv(1000)  # nor is anything told to him
        clear(link, 1)
        assert download(link, 1).items == ()


def test_a_station_hears_only_its_vehicle() -> None:
    signing = Signing(KEY)
    with Link("udpin:127.0.0.1:0", system=255, component=190, signing=signing) as link:
        beat = M.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            for raw in (Encoder(1, 1).pack(beat), Encoder(1, 1, Dated(OTHER, now() + 10**12)).pack(beat)):
                sock.sendto(raw, address(link.url))
            with pytest.raises(LinkError, match=r"within 0.3 s; 2 packets were refused: 1 forged, 1 unsigned"):
                wait_for_vehicle(link, 0.3)
            sock.sendto(Encoder(1, 1, Signing(KEY)).pack(beat), address(link.url))
            assert wait_for_vehicle(link, 2.0) == 1


def test_a_station_with_another_key_or_none_is_not_answered(signed_vehicle: str) -> None:
    for signing in (None, Signing(OTHER)):
        with Link(signed_vehicle, system=255, component=190, signing=signing) as link:
            with pytest.raises(LinkError, match="no vehicle answered"):
                wait_for_vehicle(link, 0.3)


def test_readings_pass_through_a_signed_vehicle_with_their_signatures(signed_vehicle: str) -> None:
    with (
        Link(signed_vehicle, system=1, component=158, signing=Signing(KEY)) as bridge,
        Link(signed_vehicle, system=1, component=191, signing=Signing(KEY)) as estimator,
        Link(signed_vehicle, system=1, component=158) as stranger,
    ):
        for link in (bridge, estimator):
            wait_for_vehicle(link, 5.0)
        for k in range(50):
            stranger.send(to_message(Reading(k, 99.0)))
            bridge.send(to_message(Reading(k, 1.0)))
        got: list[Any] = []
        while (frame := estimator.receive(0.5)) is not None:
            if frame.message.get_type() == "NAMED_VALUE_FLOAT":
                got.append((frame.message.time_boot_ms, frame.message.value))
            if len(got) == 50:
                break
        assert got == [(k, 1.0) for k in range(50)]


def test_a_key_is_not_passed_on() -> None:
    with flying() as (url,):
        with Link(url, system=255, component=190) as station, Link(url, system=254, component=190) as other:
            for link in (station, other):
                wait_for_vehicle(link, 5.0)
            station.send(M.MAVLink_setup_signing_message(0, 0, KEY, 1))
            station.send(M.MAVLink_setup_signing_message(254, 190, KEY, 1))
            station.send(M.MAVLink_statustext_message(6, b"behind it"))
            kinds = set()
            while "STATUSTEXT" not in kinds:
                frame = other.receive(3.0)
                assert frame is not None
                kinds.add(frame.message.get_type())
            assert "SETUP_SIGNING" not in kinds


def pymavlinks(url: str, key: bytes | None, system: int, component: int) -> Any:
    peer = mavutil.mavlink_connection(url, source_system=system, source_component=component, dialect="common")
    if key is not None:
        peer.setup_signing(key, sign_outgoing=True)
    return peer


def test_a_pymavlink_station_talks_with_our_signed_vehicle(signed_vehicle: str) -> None:
    peer = pymavlinks(signed_vehicle, KEY, 255, 190)
    try:
        peer.mav.heartbeat_send(6, 8, 0, 0, 4)
        beat = peer.recv_match(type="HEARTBEAT", blocking=True, timeout=5.0)
        assert beat is not None
        assert beat.get_signed()
        peer.mav.mission_request_list_send(1, 1)
        assert peer.recv_match(type="MISSION_COUNT", blocking=True, timeout=5.0).count == 0
    finally:
        peer.close()


def test_a_pymavlink_vehicle_talks_with_our_signed_station() -> None:
    with Link("udpin:127.0.0.1:0", system=255, component=190, signing=Signing(KEY)) as link:
        peer = pymavlinks(link.url.replace("udpin", "udpout"), KEY, 1, 1)
        try:
            peer.mav.heartbeat_send(2, 3, 0, 0, 4)
            assert wait_for_vehicle(link, 5.0) == 1
            link.send_heartbeat()
            beat = peer.recv_match(type="HEARTBEAT", blocking=True, timeout=5.0)
            assert beat is not None
            assert beat.get_signed()
        finally:
            peer.close()
