"""No signing keys and no signatures in a log; what is stored still parses."""

from __future__ import annotations

import pytest

from dslam_mav.log import Recorder, read_log
from dslam_mav.log.packets import encode_frame
from dslam_mav.mav.frames import Parser, messages, parse_frame

KEY = bytes(range(32))


def pack(message: object, *, signed: bool = False) -> bytes:
    mav = messages().MAVLink(None, srcSystem=7, srcComponent=158)
    if signed:
        mav.signing.secret_key = KEY
        mav.signing.sign_outgoing = True
        mav.signing.link_id = 3
        mav.signing.timestamp = 12345
    return message.pack(mav)  # type: ignore[attr-defined]


def samples() -> list[object]:
    dialect = messages()
    return [
        dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3),
        dialect.MAVLink_named_value_float_message(77, b"THERMAL", 1.25),
        dialect.MAVLink_named_value_float_message(0, b"", 0.0),  # its trailing zeros are cut on the wire
        dialect.MAVLink_statustext_message(6, b"x" * 50),
        dialect.MAVLink_encapsulated_data_message(1, list(range(253))),
    ]


@pytest.mark.parametrize("message", samples(), ids=lambda m: m.get_type())
def test_a_signed_packet_is_stored_as_its_unsigned_self(message):
    signed, unsigned = pack(message, signed=True), pack(message)
    assert len(signed) == len(unsigned) + 13
    stored = encode_frame(signed)
    assert stored is not None
    assert stored.raw == unsigned
    assert (stored.system, stored.component, stored.message_id) == (7, 158, message.get_msgId())
    assert stored.signature_removed
    assert parse_frame(stored.raw, 0) is not None
    plain = encode_frame(unsigned)
    assert plain is not None
    assert plain.raw == unsigned
    assert not plain.signature_removed


def test_a_broken_checksum_stays_broken():
    signed = bytearray(pack(samples()[0], signed=True))
    signed[-15] ^= 0x40
    stored = encode_frame(bytes(signed))
    assert stored is not None
    assert parse_frame(stored.raw, 0) is None


@pytest.mark.parametrize("signed", [False, True])
def test_the_key_is_never_stored(tmp_path, signed):
    setup = messages().MAVLink_setup_signing_message(7, 1, list(KEY), 99)
    path = tmp_path / "flight.mcap"
    with Recorder(path) as recorder:
        recorder.frame(1, pack(setup, signed=signed))
        recorder.frame(2, pack(samples()[1], signed=True))
        assert recorder.dropped_frames == 1
    log = read_log(path)
    assert [time_ns for time_ns, _ in log.frames] == [2]
    assert Parser().feed(log.frames[0][1], 2)[0].message.value == 1.25
    assert KEY not in b"".join(raw for _, raw in log.frames)


@pytest.mark.parametrize("raw", [b"", b"\xfd", b"hello, world, this is no packet", b"\xfd" + bytes(30)])
def test_what_is_no_packet_is_dropped_and_counted(tmp_path, raw):
    with Recorder(tmp_path / "flight.mcap") as recorder:
        recorder.frame(1, raw)
        assert recorder.dropped_frames == 1
    assert read_log(tmp_path / "flight.mcap").frames == ()
