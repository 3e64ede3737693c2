"""Readings on the wire: NAMED_VALUE_FLOAT <-> Reading. Pure.

The wire carries float32, so a reading is kept to 6e-8 of its size (24 bits of mantissa), and whole
milliseconds, so that at most 1000 readings a second have times of their own. NaN and infinity pass.
"""

from __future__ import annotations

import math
import re
import struct
from typing import Any

from dslam_mav.mav.frames import messages
from dslam_mav.observations import Reading

NAME_BYTES = 10

# tools graph only these names (MAVProxy), and the wire cuts longer ones silently
_NAME = re.compile(r"[A-Z0-9_]{1,10}")


def to_message(reading: Reading) -> Any:
    """The NAMED_VALUE_FLOAT that carries `reading`.

    ValueError naming the field: a name not [A-Z0-9_]+ of at most 10 bytes, a finite value beyond float32, a
    time outside 0 to 2³² - 1 ms.
    """
    if not _NAME.fullmatch(reading.name):
        raise ValueError(f"name {reading.name!r}: expected 1 to {NAME_BYTES} of A-Z, 0-9 and _")
    if not 0 <= reading.time_boot_ms < 2**32:
        raise ValueError(f"time_boot_ms {reading.time_boot_ms}: expected 0 to {2**32 - 1}")
    if math.isfinite(reading.value) and not _fits_float32(reading.value):
        raise ValueError(f"value {reading.value:g}: expected at most 3.4e38, the wire's float32")
    return messages().MAVLink_named_value_float_message(
        reading.time_boot_ms, reading.name.encode("ascii"), reading.value
    )


def from_message(message: Any) -> Reading | None:
    """The reading in a NAMED_VALUE_FLOAT, whatever its name; None for any other message."""
    if message.get_type() != "NAMED_VALUE_FLOAT":
        return None
    return Reading(int(message.time_boot_ms), float(message.value), message.name)


def _fits_float32(value: float) -> bool:
    try:
        struct.pack("<f", value)
    except OverflowError:
        return False
    return True
