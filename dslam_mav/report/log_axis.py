"""A logarithmic axis in drawing units, and its labelled ticks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from dslam_mav.report.numbers import significant

_MARGIN = 0.04  # of the range, in its logarithm, at least so much beyond the values
_WIDEST = 5.0  # decades: what lies lower is drawn at the edge
_STEPS = ((1.0, (1, 1.5, 2, 3, 5, 7)), (2.0, (1, 2, 5)), (math.inf, (1,)))  # of a decade: narrower ranges show more


@dataclass(frozen=True, slots=True)
class LogAxis:
    """Values low … high on drawing units from `start`, `length` long (negative: values grow upwards)."""

    low: float
    high: float
    start: float
    length: float
    ticks: tuple[tuple[float, str], ...]

    def units(self, value: float) -> float:
        """A positive value's place, kept within the axis."""
        share = math.log(value / self.low) / math.log(self.high / self.low)
        return self.start + min(1.0, max(0.0, share)) * self.length


def log_axis(values: Iterable[float], start: float, length: float) -> LogAxis | None:
    """An axis that holds all positive finite values; None where there is none."""
    told = [value for value in values if math.isfinite(value) and value > 0.0]
    if not told:
        return None
    top = math.log10(max(told))
    bottom = max(math.log10(min(told)), top - _WIDEST)
    pad = max(0.08, _MARGIN * (top - bottom))
    low, high = bottom - pad, top + pad
    if high - low < 0.7:  # room for three ticks
        middle = 0.5 * (low + high)
        low, high = middle - 0.35, middle + 0.35
    steps = next(steps for widest, steps in _STEPS if high - low < widest)
    exponents = range(math.floor(low), math.ceil(high) + 1)
    places = [m * 10.0**e for e in exponents for m in steps]
    ticks = tuple(
        (start + (math.log10(v) - low) / (high - low) * length, _label(v))
        for v in places
        if low - 1e-9 <= math.log10(v) <= high + 1e-9
    )
    return LogAxis(10.0**low, 10.0**high, start, length, ticks)


def _label(value: float) -> str:
    return significant(value, 2 if f"{value:.1e}"[2] != "0" else 1)
