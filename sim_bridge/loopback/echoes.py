"""What PX4 says again: readings as its own, and the item reached last. Pure."""

from __future__ import annotations

from typing import Any

from dslam_mav.mav.frames import messages
from sim_bridge.loopback.flight import NEVER_MS

READING_MS = 100
"""Between two readings sent on; those that come meanwhile are not."""

NAME_BYTES = 9
REACHED_MS = 1_000
REACHED_TIMES = 10


class Echoes:
    """One vehicle's; silent unless it is `wanted`."""

    def __init__(self, *, wanted: bool) -> None:
        self._wanted = wanted
        self._read_ms = -READING_MS
        self._seq = 0
        self._left = 0
        self._due_ms = NEVER_MS

    @property
    def due_ms(self) -> int:
        """When `again` has something to say."""
        return self._due_ms

    def reading(self, message: Any, time_ms: int) -> Any | None:
        """A reading as it is sent on: its name cut, its time the vehicle's own."""
        if not self._wanted or time_ms - self._read_ms < READING_MS:
            return None
        self._read_ms = time_ms
        return messages().MAVLink_named_value_float_message(
            time_ms % 2**32, message.name[:NAME_BYTES].encode(), message.value
        )

    def reached(self, seq: int, time_ms: int) -> None:
        """An item was reached, and that was said."""
        if self._wanted:
            self._seq, self._left, self._due_ms = seq, REACHED_TIMES, time_ms + REACHED_MS

    def again(self, time_ms: int) -> Any | None:
        """MISSION_ITEM_REACHED once more, if it is due."""
        if time_ms < self._due_ms:
            return None
        self._left -= 1
        self._due_ms = time_ms + REACHED_MS if self._left else NEVER_MS
        return messages().MAVLink_mission_item_reached_message(self._seq)
