"""The vehicle's clock, as whole milliseconds that never fall (pure)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

CLOCK_MS = 2**32
"""Where time_boot_ms starts again."""

REBOOT_MS = 10_000
"""An autopilot's clock that falls back by more was restarted."""

MOST_EARLY_MS = 5_000
"""A reading stamped by more ahead of the autopilot's clock was stamped by another one."""

MOST_LATE_MS = 60_000
"""So was one stamped by more behind it: links delay readings by seconds, a simulation flown fast by its speed-up
times as much.
"""

_PAUSE_MS = 60_000  # put between two runs of an autopilot's clock


class VehicleClock:
    """time_boot_ms made to rise for ever: it wraps at 2^32 and starts again with the autopilot.

    The autopilot's messages set it; readings do only as long as none of those was heard.
    """

    def __init__(self) -> None:
        self.newest_ms: int | None = None
        self._wire_ms = 0
        self._autopilots = False

    def take(self, time_boot_ms: int) -> tuple[int, bool]:
        """The unwrapped time of an autopilot's message, and whether the clock started again: the autopilot did, or
        readings had set the clock to something else.
        """
        if self.newest_ms is None or not self._autopilots:
            foreign = self.newest_ms is not None and not self._near(self._step_ms(time_boot_ms))
            self._autopilots = True
            time_ms = time_boot_ms if foreign or self.newest_ms is None else self._at(time_boot_ms)
            self.newest_ms, self._wire_ms = time_ms, time_boot_ms
            return time_ms, foreign
        step_ms = self._step_ms(time_boot_ms)
        restarted = step_ms < -REBOOT_MS
        if restarted:
            step_ms = _PAUSE_MS
        time_ms = self.newest_ms + step_ms
        if step_ms > 0:
            self.newest_ms, self._wire_ms = time_ms, time_boot_ms
        return time_ms, restarted

    def place(self, time_boot_ms: int) -> int | None:
        """The unwrapped time of somebody else's message; None if it is not of the autopilot's clock."""
        if self.newest_ms is None:
            self.newest_ms = self._wire_ms = time_boot_ms
        time_ms = self._at(time_boot_ms)
        if self._autopilots:
            return time_ms if self._near(-self._step_ms(time_boot_ms)) else None
        if time_ms > self.newest_ms:
            self.newest_ms, self._wire_ms = time_ms, time_boot_ms
        return time_ms

    @property
    def state(self) -> tuple[int, int]:
        """The newest time, and what it was on the wire; of a clock that was set."""
        return self.newest_ms or 0, self._wire_ms

    @staticmethod
    def place_many(time_boot_ms: Ints, newest_ms: Ints, wire_ms: Ints) -> tuple[Ints, NDArray[np.bool_]]:
        """(N,) what `place` gives in each `state` of an autopilot's clock, and whether it is of that clock."""
        step_ms = (time_boot_ms - wire_ms + CLOCK_MS // 2) % CLOCK_MS - CLOCK_MS // 2
        return newest_ms + step_ms, (-step_ms >= -MOST_EARLY_MS) & (-step_ms <= MOST_LATE_MS)

    @property
    def autopilots(self) -> bool:
        """Whether an autopilot's message was heard."""
        return self._autopilots

    def _at(self, time_boot_ms: int) -> int:
        return (self.newest_ms or 0) + self._step_ms(time_boot_ms)

    def _step_ms(self, time_boot_ms: int) -> int:
        return (time_boot_ms - self._wire_ms + CLOCK_MS // 2) % CLOCK_MS - CLOCK_MS // 2

    @staticmethod
    def _near(late_ms: int) -> bool:
        """Whether a reading that is so late, by the autopilot's clock, may be of it."""
        return -MOST_EARLY_MS <= late_ms <= MOST_LATE_MS
