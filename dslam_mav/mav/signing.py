"""MAVLink 2 message signing: whoever holds the key is heard, nobody else (https://mavlink.io/en/guide/message_signing.html).

A signed packet carries 13 bytes more: the link's number, a time in 10 µs since 2015 and 48 bits of
SHA-256(key, packet, link, time). A receiver keeps the newest time of every stream (link, system, component) and refuses
what is not newer, so that a packet heard once is worth nothing to whoever recorded it. Here that time is kept only once
the signature is right: otherwise one forged packet dated in the future would lock the genuine sender out.
"""

from __future__ import annotations

import hashlib
import hmac
import threading
import time
from collections import Counter

TIMESTAMP_S = 1e-5
EPOCH_S = 1_420_070_400
"""Signing's time zero, 2015-01-01, in seconds since 1970."""

MOST_LATE = round(60.0 / TIMESTAMP_S)
"""How far behind our own time the first packet of a stream may be dated."""

KEY_BYTES = 32

_SIGNATURE_BYTES = 13
_FLAG_SIGNED = 0x01
_LATEST = 2**48 - 1


class Signing:
    """One key and the time of what is signed with it; one object for all links of a process, used from any thread.

    Times rise from packet to packet, follow the host's clock, and never fall behind a time heard in a packet signed
    with the key: so they go on rising over a restart, and a peer whose clock is ahead does not find ours old.
    """

    def __init__(self, key: bytes) -> None:
        """ValueError unless `key` is 32 bytes, not all of them zero (which is MAVLink's word for no signing)."""
        if len(key) != KEY_BYTES or not any(key):
            raise ValueError(f"key: expected {KEY_BYTES} bytes, not all zero")
        self._key = bytes(key)
        self._lock = threading.Lock()
        self._newest = 0

    @property
    def key(self) -> bytes:
        """The secret itself: for an encoder, never for a text."""
        return self._key

    def next_timestamp(self) -> int:
        """The time to sign the next packet with."""
        with self._lock:
            self._newest = min(max(self._newest + 1, _clock()), _LATEST)
            return self._newest

    def now(self) -> int:
        """The time it is, by the clock or by what was heard, whichever is later."""
        with self._lock:
            return max(self._newest, _clock())

    def heard(self, timestamp: int) -> None:
        """Somebody who holds the key dated a packet so."""
        with self._lock:
            self._newest = max(self._newest, timestamp)

    def signature(self, packet: bytes) -> bytes:
        """The last 6 bytes of a signed packet, given all before them."""
        return hashlib.sha256(self._key + packet).digest()[:6]


class Verifier:
    """What one receiver lets pass. `refused` counts the rest: "unsigned", "forged", "replayed", "old"."""

    def __init__(self, signing: Signing) -> None:
        self.refused: Counter[str] = Counter()
        self._signing = signing
        self._newest: dict[tuple[int, int, int], int] = {}

    def accepts(self, raw: bytes) -> bool:
        """Whether a packet (whole, its checksum right) is genuine and new; if so it is never accepted again."""
        reason = self._refusal(raw)
        if reason:
            self.refused[reason] += 1
        return not reason

    def _refusal(self, raw: bytes) -> str:
        if not raw[2] & _FLAG_SIGNED:
            return "unsigned"
        if not hmac.compare_digest(self._signing.signature(raw[:-6]), raw[-6:]):
            return "forged"
        stream = raw[-_SIGNATURE_BYTES], raw[5], raw[6]
        timestamp = int.from_bytes(raw[-12:-6], "little")
        newest = self._newest.get(stream)
        if newest is None and timestamp + MOST_LATE < self._signing.now():
            return "old"
        if newest is not None and timestamp <= newest:
            return "replayed"
        self._newest[stream] = timestamp
        self._signing.heard(timestamp)
        return ""


def refusals_in_words(refused: Counter[str]) -> str:
    """What was refused, to be put behind a sentence: "; 12 packets were refused: 10 unsigned, 2 forged", or ""."""
    if not refused.total():
        return ""
    n = refused.total()
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(refused.items()) if count)
    return f"; {n} packet{' was' if n == 1 else 's were'} refused: {kinds}"


def _clock() -> int:
    return max(0, int((time.time() - EPOCH_S) / TIMESTAMP_S))
