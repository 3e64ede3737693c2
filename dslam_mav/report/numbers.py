"""Numbers as a person reads them: as many digits as are known, a true minus sign, a dash for the unknown."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

UNKNOWN = "–"
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_MAX_DECIMALS = 9


def fixed(value: float, decimals: int) -> str:
    """`value` with so many decimals; never "−0.0"."""
    if not math.isfinite(value):
        return UNKNOWN if math.isnan(value) else ("∞" if value > 0.0 else "−∞")
    text = f"{value:.{max(0, decimals)}f}"
    if text.startswith("-") and float(text) == 0.0:
        text = text[1:]
    return text.replace("-", "−")


def significant(value: float, digits: int = 3) -> str:
    """`value` with so many significant digits, as a decimal where that stays short, else as a × 10ⁿ."""
    if not math.isfinite(value) or value == 0.0:
        return fixed(value, 0)
    exponent = int(f"{value:.{digits - 1}e}".split("e")[1])
    if -4 <= exponent < 6:
        return fixed(value, digits - 1 - exponent)
    mantissa = fixed(value / 10.0**exponent, digits - 1)
    return f"{mantissa} × 10{str(exponent).translate(_SUPERSCRIPT)}"


def decimals_of(sd: float) -> int:
    """Decimals that show a standard deviation with two significant digits."""
    if not (math.isfinite(sd) and sd > 0.0):
        return 3
    return min(_MAX_DECIMALS, max(0, 1 - int(f"{sd:.1e}".split("e")[1])))


def with_sd(value: float, sd: float) -> str:
    """ "12.34 ± 0.05": two significant digits of the standard deviation, the value to the same decimals."""
    if not math.isfinite(value):
        return UNKNOWN
    if not (math.isfinite(sd) and sd > 0.0):
        return significant(value, 4)
    if sd >= 1e6 or sd < 10.0 ** (1 - _MAX_DECIMALS):
        return f"{significant(value, 4)} ± {significant(sd, 2)}"
    decimals = decimals_of(sd)
    return f"{fixed(value, decimals)} ± {fixed(sd, decimals)}"


def degrees(angle_rad: float, decimals: int = 1) -> str:
    """An angle in (−180°, 180°]."""
    turned = math.remainder(angle_rad, 2.0 * math.pi) if math.isfinite(angle_rad) else angle_rad
    text = fixed(math.degrees(turned), decimals)
    return text if text == UNKNOWN else f"{text}°"


def degrees_with_sd(angle_rad: float, sd_rad: float) -> str:
    """An angle with its standard deviation, in degrees."""
    if not (math.isfinite(angle_rad) and math.isfinite(sd_rad) and sd_rad > 0.0):
        return degrees(angle_rad)
    return with_sd(math.degrees(math.remainder(angle_rad, 2.0 * math.pi)), math.degrees(sd_rad)) + "°"


def nice_step(span: float, about: int) -> float:
    """A step of 1, 2 or 5 times a power of ten that divides `span` into about so many parts."""
    if not (math.isfinite(span) and span > 0.0):
        return 1.0
    raw = span / max(1, about)
    power = 10.0 ** math.floor(math.log10(raw))
    return float(power * next((m for m in (1.0, 2.0, 5.0) if raw <= m * power * 1.0001), 10.0))


def nice_ticks(low: float, high: float, about: int) -> NDArray[np.float64]:
    """Round numbers within [low, high], about so many."""
    step = nice_step(high - low, about)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return np.asarray(np.arange(first, last + 1) * step, dtype=np.float64)


def tick_labels(ticks: NDArray[np.float64]) -> list[str]:
    """Labels of equally spaced ticks, all with the same decimals."""
    if not ticks.size:
        return []
    step = float(np.diff(ticks).min()) if ticks.size > 1 else abs(float(ticks[0])) or 1.0
    if float(np.abs(ticks).max()) >= 1e6 or step < 1e-4:
        return [significant(float(tick), 3) for tick in ticks]
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return [fixed(float(tick), decimals) for tick in ticks]
