"""Chunks read at once give what they give message by message, whole or damaged."""

from __future__ import annotations

import random
from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dslam_mav.log.declared import Declared
from dslam_mav.log.packets import Raw, encode_frame
from dslam_mav.log.reader import read_log
from dslam_mav.log.schemas.flight_pb2 import RawFrame


def told(path):
    log = read_log(path)
    return [repr(getattr(log, field.name)) for field in fields(log)]


@pytest.fixture
def by_message(monkeypatch):
    """What is told where no chunk is read at once."""

    def read(path):
        with monkeypatch.context() as patch:
            patch.setattr(Declared, "rows", lambda self, chunk: None)
            return told(path)

    return read


def test_a_whole_log(flight, by_message):
    assert told(flight) == by_message(flight)


def test_damaged_and_doubled_logs(small_chunks, tmp_path, by_message):
    whole, rng, path = small_chunks.read_bytes(), random.Random(5), tmp_path / "a.mcap"
    for i in range(40):
        data = bytearray(whole)
        if i % 4 == 0:  # chunks come again, or in another order
            cut, much = rng.randrange(len(data)), rng.randrange(8000)
            data[cut:cut] = data[max(0, cut - much) : cut]
        if i % 4 == 1:
            del data[rng.randrange(len(data)) :]
        for _ in range(i % 3):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        data[:8] = whole[:8]
        path.write_bytes(data)
        assert told(path) == by_message(path)


RAWS = st.binary(min_size=0, max_size=300)


@given(
    st.lists(
        st.one_of(
            st.builds(
                lambda raw, system, number, signed: RawFrame(
                    raw=raw, system=system, component=1, message_id=number, signature_removed=signed
                ).SerializeToString(),
                RAWS, st.integers(0, 255), st.integers(0, 2**24 - 1), st.booleans(),
            ),
            st.binary(max_size=40),
            RAWS.map(lambda raw: b"\x0a" + bytes([len(raw) % 128]) + raw),
        ),
        max_size=12,
    )
)  # fmt: skip
def test_packets_are_those_that_protobuf_reads(messages):
    raw = Raw()
    for data in [*messages, *messages, *(data[:-1] for data in messages)]:
        try:
            known = RawFrame.FromString(data).raw
        except Exception as error:
            with pytest.raises(type(error)):
                raw(data)
        else:
            assert raw(data) == known


def test_a_packet_cut_short_is_no_packet():
    stored = encode_frame(bytes.fromhex("fd0900000001010000000000000002030004030000"))
    assert stored is not None
    raw, data = Raw(), stored.SerializeToString()
    assert raw(data) == raw(data) == stored.raw
    for size in range(1, len(stored.raw) + 2):
        with pytest.raises(Exception, match="parsing"):
            raw(data[:size])
