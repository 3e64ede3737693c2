"""What a bad radio does to packets: an air between the loopback vehicle and its peers that loses, doubles and garbles.

Pure: times are arguments, and every way (one peer, one direction) draws from a generator of its own, so that its
n-th packet meets the same fate whatever the others do.
"""

from __future__ import annotations

import math
import random
from collections import deque
from dataclasses import dataclass, field, fields
from typing import Any

from dslam_mav.errors import BadInputError
from dslam_mav.mav.frames import messages

HELD_S = 0.1
"""How long a packet is held back at most, where no three others come to overtake it."""

_OVERTAKEN_BY = 3
_QUIET_AFTER_S = (2.0, 10.0)
_REMEMBERED = 20
_GARBLED_BYTES = 4
_WRAP_MS = 2**32
_HEADER_BYTES = 10

Way = tuple[Any, str]  # a peer and a direction


@dataclass(frozen=True, slots=True)
class LinkFaults:
    """Shares of the packets of every way that are lost, doubled, overtaken by others, garbled, or followed by what a
    second system repeats (`stranger`); and `silence` in seconds, `wrap` and `reset` in seconds of the vehicle's time.
    """

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    corrupt: float = 0.0
    stranger: float = 0.0
    silence: float = 0.0
    wrap: float = math.inf
    reset: float = math.inf

    def time_boot_ms(self, time_ms: int) -> int:
        """The vehicle's time as its messages tell it: begun so that it wraps at `wrap`, begun again at `reset`."""
        if time_ms >= 1000.0 * self.reset:
            return time_ms - round(1000.0 * self.reset)
        return (time_ms - (round(1000.0 * self.wrap) if math.isfinite(self.wrap) else 0)) % _WRAP_MS

    def stamped(self, message: Any) -> Any:
        """A message of the vehicle's, its time as it goes on the wire."""
        if hasattr(message, "time_boot_ms"):
            message.time_boot_ms = self.time_boot_ms(message.time_boot_ms)
        return message


_SHARES = ("loss", "duplicate", "reorder", "corrupt", "stranger")


def parse_link_faults(text: str) -> LinkFaults:
    """ "loss=0.3,silence=2" as faults; BadInputError names the part that is wrong."""
    known = [f.name for f in fields(LinkFaults)]
    values: dict[str, float] = {}
    for part in text.split(","):
        name, _, number = part.strip().partition("=")
        if name not in known or name in values:
            what = "twice" if name in values else f"expected some of {', '.join(known)}"
            raise BadInputError(f"--link-faults {text}: {name!r}: {what}")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        most, unit = (1.0, "a share from 0 to 1") if name in _SHARES else (1e6, "seconds from 0 to 1000000")
        if not 0.0 <= value <= most:
            raise BadInputError(f"--link-faults {text}: {name} {number!r}: expected {unit}")
        values[name] = value
    return LinkFaults(**values)


@dataclass(slots=True)
class _Held:
    data: bytes
    overtakers: int
    until_s: float


@dataclass(slots=True)
class _Traffic:
    random: random.Random
    held: list[_Held] = field(default_factory=list)
    before: deque[bytes] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))


class Air:
    """Carries packets of every way with `faults`, by `seed`."""

    def __init__(self, faults: LinkFaults, seed: int = 0) -> None:
        self._faults = faults
        self._seed = seed
        self._ways: dict[Way, _Traffic] = {}
        self._silences = random.Random(f"{seed} silences")
        self._quiet_s = (math.inf, math.inf)  # from, until

    def carry(self, way: Way, data: bytes, now_s: float) -> list[bytes]:
        """What arrives when `data` is sent: nothing, it, more than it, or something like it; and who it overtakes."""
        if way not in self._ways:
            self._ways[way] = _Traffic(random.Random(f"{self._seed} way {len(self._ways)}"))
        traffic, faults = self._ways[way], self._faults
        if self._silent(now_s) or traffic.random.random() < faults.loss:
            return []
        arriving = [data] * (1 + (traffic.random.random() < faults.duplicate))
        if traffic.random.random() < faults.corrupt:
            arriving[0] = _garbled(data, traffic.random)
        if traffic.random.random() < faults.stranger and traffic.before:
            arriving.append(of_another_system(traffic.random.choice(traffic.before)))
        traffic.before.append(data)
        if traffic.random.random() < faults.reorder:
            traffic.held += [_Held(d, traffic.random.randint(1, _OVERTAKEN_BY), now_s + HELD_S) for d in arriving]
            return []
        for held in traffic.held:
            held.overtakers -= 1
        return arriving + _released(traffic, now_s)

    def due(self, now_s: float) -> list[tuple[Way, bytes]]:
        """What was held back and that nothing came to overtake."""
        return [(way, data) for way, traffic in self._ways.items() for data in _released(traffic, now_s)]

    def _silent(self, now_s: float) -> bool:
        begin_s, end_s = self._quiet_s
        if not self._faults.silence or begin_s <= now_s < end_s:
            return bool(self._faults.silence)
        if math.isinf(begin_s) or now_s >= end_s:
            begin_s = now_s + self._silences.uniform(*_QUIET_AFTER_S)
            self._quiet_s = begin_s, begin_s + self._faults.silence
        return False


def _released(traffic: _Traffic, now_s: float) -> list[bytes]:
    out = [held.data for held in traffic.held if held.overtakers <= 0 or now_s >= held.until_s]
    if out:
        traffic.held = [held for held in traffic.held if held.overtakers > 0 and now_s < held.until_s]
    return out


def _garbled(data: bytes, draw: random.Random) -> bytes:
    garbled = bytearray(data)
    for _ in range(draw.randint(1, _GARBLED_BYTES)):
        garbled[draw.randrange(len(garbled))] ^= draw.randint(1, 255)
    return bytes(garbled)


def of_another_system(raw: bytes) -> bytes:
    """A packet as a second system would send it, its checksum right; what is no packet of a known message as it is."""
    kind = messages().mavlink_map.get(int.from_bytes(raw[7:10], "little"))
    end = _HEADER_BYTES + raw[1] if len(raw) > _HEADER_BYTES else len(raw)
    if kind is None or len(raw) < end + 2:
        return raw
    body = bytearray(raw)
    body[5] = raw[5] % 255 + 1 if raw[5] != 255 else 254
    checksum = messages().x25crc(bytes(body[1:end]) + bytes([kind.crc_extra])).crc
    body[end : end + 2] = checksum.to_bytes(2, "little")
    return bytes(body)
