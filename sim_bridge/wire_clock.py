"""The vehicle's clock as the bridge keeps it: it wraps at 2³² ms, and starts again when the autopilot does. Pure."""

from __future__ import annotations

_WRAP_MS = 2**32
_REBOOT_MS = 10_000


class WireClock:
    """time_boot_ms made to rise for ever, and back."""

    def __init__(self) -> None:
        self._newest_ms: int | None = None
        self._ahead_ms = 0  # of the time on the wire

    def take(self, time_boot_ms: int) -> tuple[int, bool]:
        """A message's time, made to rise, and whether the clock was started again: it then goes on where it was."""
        if self._newest_ms is None:
            self._newest_ms = time_boot_ms
        step_ms = (time_boot_ms + self._ahead_ms - self._newest_ms + _WRAP_MS // 2) % _WRAP_MS - _WRAP_MS // 2
        restarted = step_ms < -_REBOOT_MS
        if restarted:
            step_ms = 1
        time_ms = self._newest_ms + step_ms
        self._ahead_ms = time_ms - time_boot_ms
        self._newest_ms = max(self._newest_ms, time_ms)
        return time_ms, restarted

    def on_wire(self, time_ms: int) -> int:
        """A time near the last one taken, as the vehicle tells it."""
        return (time_ms - self._ahead_ms) % _WRAP_MS
