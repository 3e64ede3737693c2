"""MAVLink 2 packets: bytes to frames and back (https://mavlink.io/en/guide/serialization.html).

Pure: no sockets, no clock. Wire bytes that are no MAVLink 2 packet of a known message (noise, MAVLink 1, a
wrong checksum, unknown message numbers) are dropped and counted, never raised.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from dslam_mav.mav.signing import Signing, Verifier

COMPONENT_AUTOPILOT = 1
COMPONENT_BRIDGE = 158
COMPONENT_GROUND = 190
COMPONENT_ESTIMATOR = 191
COMPONENT_STEERING = 192  # onboard computer 2
SYSTEM_GROUND = 255

_MARKER = 0xFD
_HEADER_BYTES = 10
_CHECKSUM_BYTES = 2
_SIGNATURE_BYTES = 13
_FLAG_SIGNED = 0x01


@dataclass(frozen=True, slots=True)
class Frame:
    """One packet: `received_ns` since 1970 by the host's clock (or the log's), its bytes, what they say."""

    received_ns: int
    raw: bytes
    message: Any


def messages() -> Any:
    """The dialect: message classes (`MAVLink_heartbeat_message`, …) and enumeration values."""
    return dialect


def heartbeat(component: int) -> Any:
    """The HEARTBEAT of a ground station, or of a component on board."""
    dialect = messages()
    kind = dialect.MAV_TYPE_GCS if component == COMPONENT_GROUND else dialect.MAV_TYPE_ONBOARD_CONTROLLER
    return dialect.MAVLink_heartbeat_message(kind, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3)


class Parser:
    """A stream of bytes in, frames out; what is no packet is skipped and counted in `bad_bytes`.

    With a `verifier` a packet that it does not accept is dropped, and counted there.
    """

    def __init__(self, verifier: Verifier | None = None) -> None:
        self.bad_bytes = 0
        self._verifier = verifier
        self._buffer = bytearray()

    def feed(self, data: bytes, received_ns: int) -> list[Frame]:
        """The frames completed by `data`; an unfinished packet waits for the next call."""
        self._buffer += data
        frames: list[Frame] = []
        at = 0
        while True:
            start = self._buffer.find(_MARKER, at)
            self.bad_bytes += (len(self._buffer) if start < 0 else start) - at
            at = len(self._buffer) if start < 0 else start
            length = _packet_length(self._buffer, at)
            if length is None or len(self._buffer) - at < length:
                break
            frame = _decode(self._buffer[at : at + length], received_ns) if length else None
            if frame is None:  # not a packet after all: one may begin inside it
                self.bad_bytes += 1
                at += 1
            else:
                if self._verifier is None or self._verifier.accepts(frame.raw):
                    frames.append(frame)
                at += length
        del self._buffer[:at]
        return frames


class Encoder:
    """Packs messages as one sender, with its own sequence counter; signed if `signing` is given."""

    def __init__(self, system: int, component: int, signing: Signing | None = None) -> None:
        self.system = system
        self.component = component
        self._mav = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self._signing = signing
        if signing is not None:
            self._mav.signing.secret_key = signing.key
            self._mav.signing.sign_outgoing = True

    def pack(self, message: Any) -> bytes:
        """The packet's bytes; a field that does not fit its type is a struct.error (the caller's mistake)."""
        if self._signing is not None:
            self._mav.signing.timestamp = self._signing.next_timestamp()
        raw: bytes = message.pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        return raw


def parse_frame(raw: bytes, received_ns: int) -> Frame | None:
    """One stored packet as a frame; None if it is not exactly one good MAVLink 2 packet."""
    if not raw or raw[0] != _MARKER or _packet_length(raw, 0) != len(raw):
        return None
    return _decode(bytearray(raw), received_ns)


def _packet_length(buffer: bytes | bytearray, at: int) -> int | None:
    """Bytes of the packet at `at`; None: more bytes are needed to tell; 0: it cannot be a packet."""
    if len(buffer) - at < _HEADER_BYTES:
        return None
    flags = buffer[at + 2]
    message_id = int.from_bytes(buffer[at + 7 : at + 10], "little")
    if flags & ~_FLAG_SIGNED or message_id not in dialect.mavlink_map:
        return 0
    return _HEADER_BYTES + buffer[at + 1] + _CHECKSUM_BYTES + (_SIGNATURE_BYTES if flags & _FLAG_SIGNED else 0)


# decoding without a signing key keeps no state between packets, so that one decoder serves everybody
_decoder = dialect.MAVLink(None)


def _decode(packet: bytearray, received_ns: int) -> Frame | None:
    try:
        return Frame(received_ns, bytes(packet), _decoder.decode(packet))
    except dialect.MAVError:
        return None
