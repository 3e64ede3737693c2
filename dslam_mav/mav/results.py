"""An estimate as MAVLink messages: NAMED_VALUE_FLOAT per number, STATUSTEXT in words. Pure.

For source k: `SRCk_E`, `SRCk_N` (metres east and north of home) when anchored, `SRCk_X`, `SRCk_Y` (metres in
the canonical gauge) when not, third coordinates `SRCk_U` or `SRCk_Z`; `SRCk_AMP`; `SRCk_SD` in metres.
`DSLAM_ST` is the verdict's number.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

from dslam_mav.mav.frames import messages
from dslam_mav.records import Estimate, Verdict
from dslam_mav.records.words import count

CHUNK_BYTES = 50
_FLOAT32_MAX = 3.4e38
_AXES = {"anchored": "ENU", "canonical": "XYZ"}


def result_messages(estimate: Estimate, time_boot_ms: int) -> tuple[Any, ...]:
    """Every number of the estimate that is one; where positions are unknown only the verdict is left."""
    values = [("DSLAM_ST", float(int(estimate.verdict)))]
    sources = estimate.sources
    for k in range(len(sources)):
        name = f"SRC{k + 1}_"
        axes = zip(_AXES[estimate.gauge], sources.position_m[k], strict=False)
        values += [(name + axis, float(x)) for axis, x in axes]
        values += [(name + "AMP", float(sources.amplitude[k])), (name + "SD", float(estimate.sd_m[k]))]
    build = messages().MAVLink_named_value_float_message
    return tuple(
        build(time_boot_ms % 2**32, name.encode("ascii"), value)
        for name, value in values
        if math.isfinite(value) and abs(value) <= _FLOAT32_MAX
    )


def status_messages(text: str, text_id: int, *, severity: int | None = None) -> tuple[Any, ...]:
    """`text` as STATUSTEXT, in chunks of 50 bytes; `text_id` (1 to 65535) holds the chunks of one text
    together.
    """
    plain = text.replace("±", "+/-").replace("√", "sqrt ").encode("ascii", "replace")
    chunks = [plain[i : i + CHUNK_BYTES] for i in range(0, len(plain), CHUNK_BYTES)] or [b""]
    shared_id = text_id if len(chunks) > 1 else 0
    level = messages().MAV_SEVERITY_INFO if severity is None else severity
    build = messages().MAVLink_statustext_message
    return tuple(build(level, chunk, shared_id, j) for j, chunk in enumerate(chunks))


class Results:
    """The messages of one estimate after the other; each text has a number of its own, so that its chunks are found."""

    def __init__(self) -> None:
        self._text_id = 0

    def messages(self, estimate: Estimate, lines: Iterable[str], time_boot_ms: int) -> Iterator[Any]:
        """Every number, then `lines`."""
        yield from result_messages(estimate, time_boot_ms)
        for line in lines:
            self._text_id = self._text_id % 65535 + 1
            yield from status_messages(line, self._text_id, severity=severity(estimate.verdict))


def in_words(estimate: Estimate, legs_flown: int, *, final: bool) -> tuple[str, ...]:
    """The estimate as a pilot reads it: the verdict, and at the end each source."""
    head = "D-SLAM" if final else f"D-SLAM after {count(legs_flown, 'leg')}"
    lines = [f"{head}: {estimate.verdict.sentence}"]
    if final:
        names = ("east", "north", "up") if estimate.gauge == "anchored" else ("x", "y", "z")
        for k, position in enumerate(estimate.sources.position_m):
            if all(math.isfinite(x) for x in position):
                where = ", ".join(f"{name} {x:.1f} m" for name, x in zip(names, position, strict=False))
                lines.append(f"Source {k + 1}: {where}, ±{estimate.sd_m[k]:.2g} m")
    return tuple(lines)


def severity(verdict: Verdict) -> int:
    """MAV_SEVERITY of a verdict: information if it is an answer, a warning if it is to be doubted."""
    dialect = messages()
    return int(dialect.MAV_SEVERITY_INFO if verdict == Verdict.IDENTIFIED else dialect.MAV_SEVERITY_WARNING)
