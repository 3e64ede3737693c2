"""Telemetry logs (.tlog) of ground stations: 8-byte big-endian microseconds since 1970, then one packet,
repeated.

Real ones hold thousands of corrupt bytes and several systems; old ones MAVLink 1, which is read as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from dslam_mav.errors import BadInputError, unreadable
from dslam_mav.mav.frames import Frame, messages, parse_frame

_STAMP_BYTES = 8
_MARKER_V1, _MARKER_V2 = 0xFE, 0xFD
_PLAUSIBLE_US = (631_152_000_000_000, 4_102_444_800_000_000)  # the years 1990 to 2100
_LEAST_GOOD_SHARE = 0.1


class Tlog:
    """A tlog's frames in file order; `bad_bytes` counts what was skipped so far.

    BadInputError, one line: the file cannot be read; iterating, it turns out to be no tlog.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self.bad_bytes = 0
        try:
            self._data = self.path.read_bytes()
        except OSError as problem:
            raise unreadable(path, problem) from None

    def __iter__(self) -> Iterator[Frame]:
        data = self._data
        self.bad_bytes = 0
        at = 0
        time_us = 0
        while at + _STAMP_BYTES < len(data):
            raw = _packet(data, at + _STAMP_BYTES)
            stamp_us = int.from_bytes(data[at : at + _STAMP_BYTES], "big")
            if raw is not None and not _PLAUSIBLE_US[0] < stamp_us < _PLAUSIBLE_US[1]:
                stamp_us = time_us  # a packet after garbage: as late as the one before
            frame = _decode(raw, 1000 * stamp_us) if raw is not None else None
            if frame is None:
                self.bad_bytes += 1
                at += 1
                continue
            time_us = stamp_us
            at += _STAMP_BYTES + len(frame.raw)
            yield frame
        self.bad_bytes += len(data) - at
        if not data or len(data) - self.bad_bytes < _LEAST_GOOD_SHARE * len(data):
            raise BadInputError(f"{self.path}: no tlog: expected timestamped MAVLink packets, found hardly any")


def begins_as_tlog(begin: bytes) -> bool:
    """Whether a file's first bytes are a time and the mark of a packet; of a tlog that begins with garbage they are
    not.
    """
    return len(begin) > _STAMP_BYTES and begin[_STAMP_BYTES] in (_MARKER_V1, _MARKER_V2)


def read_tlog(path: Path) -> Tlog:
    """The tlog at `path`, to iterate over."""
    return Tlog(path)


def tlog_bytes(packets: Iterable[tuple[int, bytes]]) -> bytes:
    """A tlog of packets, each with its nanoseconds since 1970; a tlog keeps whole microseconds of them."""
    return b"".join((time_ns // 1000).to_bytes(_STAMP_BYTES, "big") + raw for time_ns, raw in packets)


def _packet(data: bytes, at: int) -> bytes | None:
    """The bytes of the packet that seems to start at `at`."""
    if at + 3 > len(data) or data[at] not in (_MARKER_V1, _MARKER_V2):
        return None
    signature = 13 if data[at + 2] & 1 else 0
    length = 8 + data[at + 1] if data[at] == _MARKER_V1 else 12 + data[at + 1] + signature
    return data[at : at + length] if at + length <= len(data) else None


_v1_decoder = messages().MAVLink(None)


def _decode(raw: bytes, received_ns: int) -> Frame | None:
    if raw[0] == _MARKER_V2:
        return parse_frame(raw, received_ns)
    if raw[5] not in messages().mavlink_map:
        return None  # its checksum cannot be told
    try:
        return Frame(received_ns, raw, _v1_decoder.decode(bytearray(raw)))
    except messages().MAVError:
        return None
