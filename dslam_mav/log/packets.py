"""MAVLink packets as a log may keep them: no signing keys, no signatures. Pure; works on bytes alone.

A signature is 13 bytes behind the checksum, announced by bit 0 of the incompatibility flags
(https://mavlink.io/en/guide/message_signing.html). The checksum covers that flag, so taking a signature off
means adapting it. It is linear over GF(2): crc(a ⊕ b) = crc(a) ⊕ crc₀(b) with crc₀ starting from 0. So the
change for a flipped flag depends on the payload's length alone; neither a table of CRC_EXTRA nor the message
is needed, and a packet that was valid stays valid.
"""

from __future__ import annotations

from functools import lru_cache

from dslam_mav.log.schemas.flight_pb2 import RawFrame

SETUP_SIGNING = 256  # carries the secret key

_RAW_TAG = 0x0A  # field 1, bytes
_LONG = 0x80  # lengths from here on take two bytes
_V2_MARKER = 0xFD
_V1_MARKER = 0xFE
_V2_OVERHEAD = 12  # header 10, checksum 2
_V1_OVERHEAD = 8
_SIGNATURE_BYTES = 13
_FLAG_SIGNED = 0x01


def encode_frame(raw: bytes) -> RawFrame | None:
    """One packet as it may be stored; None for SETUP_SIGNING and for what is not exactly one packet."""
    if len(raw) >= _V2_OVERHEAD and raw[0] == _V2_MARKER:
        signed = bool(raw[2] & _FLAG_SIGNED)
        message_id = int.from_bytes(raw[7:10], "little")
        if len(raw) != _V2_OVERHEAD + raw[1] + signed * _SIGNATURE_BYTES or message_id == SETUP_SIGNING:
            return None
        stored = without_signature(raw) if signed else raw
        return RawFrame(raw=stored, system=raw[5], component=raw[6], message_id=message_id, signature_removed=signed)
    if len(raw) >= _V1_OVERHEAD and raw[0] == _V1_MARKER and len(raw) == _V1_OVERHEAD + raw[1]:
        return RawFrame(raw=raw, system=raw[3], component=raw[4], message_id=raw[5])
    return None


class Raw:
    """The packet of a message of `/mavlink/raw`, as protobuf reads it, but in a third of the time.

    As every recorder writes it the packet comes first, and what follows is the same for all packets of a kind: that is
    parsed once. DecodeError for what is no message.
    """

    def __init__(self) -> None:
        self._tails: set[bytes] = set()

    def __call__(self, data: bytes) -> bytes:
        """The packet."""
        short = len(data) > 2 and data[0] == _RAW_TAG and data[1] < _LONG
        end = 2 + data[1] if short else 0
        if short and data[end:] in self._tails and len(data) >= end:
            return data[2:end]
        stored = RawFrame.FromString(data)
        rest = RawFrame(
            system=stored.system,
            component=stored.component,
            message_id=stored.message_id,
            signature_removed=stored.signature_removed,
        ).SerializeToString()
        if short and rest == data[end:]:
            self._tails.add(rest)
        return stored.raw


def without_signature(raw: bytes) -> bytes:
    """A signed MAVLink 2 packet as its sender would have sent it unsigned."""
    body = bytearray(raw[: _V2_OVERHEAD + raw[1]])
    body[2] &= ~_FLAG_SIGNED
    checksum = int.from_bytes(body[-2:], "little") ^ _checksum_change(raw[1])
    body[-2:] = checksum.to_bytes(2, "little")
    return bytes(body)


@lru_cache(maxsize=256)
def _checksum_change(payload_bytes: int) -> int:
    """crc₀ of the flag's bit: byte 2 of the packet, then 7 of header, the payload and CRC_EXTRA as zeros."""
    crc = _x25(0, _FLAG_SIGNED)
    for _ in range(7 + payload_bytes + 1):
        crc = _x25(crc, 0)
    return crc


def _x25(crc: int, byte: int) -> int:
    """One byte of MAVLink's checksum, CRC-16/MCRF4XX (https://mavlink.io/en/guide/serialization.html#crc_extra)."""
    mixed = (byte ^ crc) & 0xFF
    mixed = (mixed ^ (mixed << 4)) & 0xFF
    return (crc >> 8) ^ (mixed << 8) ^ (mixed << 3) ^ (mixed >> 4)
