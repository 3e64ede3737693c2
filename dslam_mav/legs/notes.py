"""What a person should know of the legs that were collected, and which way they went. Pure."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from dslam_mav.legs.assembly import MIN_READINGS, FlownLeg
from dslam_mav.legs.plan import PlanFacts
from dslam_mav.records.words import agree, count


def notes(
    counts: Counter[str], legs_counts: Counter[str], legs: tuple[FlownLeg, ...], plan: PlanFacts | None, *, heard: bool
) -> tuple[str, ...]:
    """One line each on what was set aside, and on legs that say little; `heard`: there were readings at all."""
    lines = []
    if n := counts["not finite"]:
        were = agree(n, "was", "were")
        lines.append(f"{count(n, 'reading')} {were} not finite and {were} dropped")
    if n := counts["off the clock"]:
        were = agree(n, "was", "were")
        lines.append(f"{count(n, 'reading')} had times that are not of the vehicle's clock and {were} dropped")
    if n := counts["restarts"]:
        lines.append(f"the autopilot's clock started again {count(n, 'time')}; the longest unbroken part is used")
    if not heard:
        lines.append("no readings were heard: is the bridge or the sensor running?")
    lines += _left_out(legs, plan)
    for j, leg in enumerate(legs, 1):
        if leg.value.size == 0:
            lines.append(f"leg {j} of {len(legs)} has no readings")
        elif leg.value.size > 1 and np.ptp(leg.value) == 0.0:
            lines.append(f"leg {j} of {len(legs)}: all {leg.value.size} readings are {leg.value[0]:g}")
    if n := legs_counts["legs lost"]:
        lines.append(f"{count(n, 'leg')} could not be told apart or measured; the longest unbroken part is used")
    return tuple(lines)


def _left_out(legs: tuple[FlownLeg, ...], plan: PlanFacts | None) -> list[str]:
    """One line each on legs left out for want of readings, and on those of the mission that were not seen at all."""
    few = legs[0].few if legs else ()
    lines = [_few(legs, few, plan)] if few else []
    before = any(number < legs[0].number for number, _ in few)
    if not before and (missed := _missed(legs, plan)):
        gone = agree(missed, "leg 1 of the mission is", f"legs 1 to {missed} of the mission are")
        lines.append(f"{gone} missing: leg 1 here is its leg {missed + 1}")
    behind = any(number > legs[-1].number for number, _ in few)
    if not behind and (left := _left(legs, plan)):
        gone = agree(left, "the last leg of the mission is", f"the last {left} legs of the mission are")
        lines.append(f"{gone} missing: {count(len(legs), 'leg')} {agree(len(legs), 'is', 'are')} used")
    return lines


def _few(legs: tuple[FlownLeg, ...], few: tuple[tuple[int, int], ...], plan: PlanFacts | None) -> str:
    """Which legs have too few readings, and which are used."""
    n, (first, last) = len(few), (legs[0].number, legs[-1].number)
    which, how_many = (_listed([row[k] for row in few]) for k in (0, 1))
    of = "" if plan is None else " of the mission"
    readings = agree(few[-1][1], "reading", "readings")
    if any(number >= MIN_READINGS for _, number in few):
        readings += " at one place"
    used = agree(len(legs), f"leg {first} is used", f"legs {first} to {last} are used")
    here = f", leg 1 here is {'leg' if plan is None else 'its leg'} {first}" if first > 1 else ""
    return f"{agree(n, 'leg', 'legs')} {which}{of} {agree(n, 'has', 'have')} {how_many} {readings}: {used}{here}"


def _listed(numbers: list[int]) -> str:
    *most, last = map(str, numbers)
    return f"{', '.join(most)} and {last}" if most else last


def _missed(legs: tuple[FlownLeg, ...], plan: PlanFacts | None) -> int:
    """How many of the plan's legs lie before the first one here."""
    if plan is None or not legs or legs[0].start_seq not in plan.vertices:
        return 0
    return plan.vertices.index(legs[0].start_seq)


def _left(legs: tuple[FlownLeg, ...], plan: PlanFacts | None) -> int:
    """How many of the plan's legs lie behind the last one here: a failsafe brought the vehicle down, say."""
    if plan is None or not legs or legs[-1].end_seq not in plan.vertices:
        return 0
    return len(plan.vertices) - 1 - plan.vertices.index(legs[-1].end_seq)


def mean_heading_rad(leg: FlownLeg, yaw: list[tuple[int, float]]) -> float:
    """The mean yaw of the middle three fifths of a leg, counter-clockwise from east; NaN where none was heard."""
    margin_ms = 0.2 * (leg.end_ms - leg.start_ms)
    inside = [r for t, r in yaw if leg.start_ms + margin_ms <= t <= leg.end_ms - margin_ms]
    if not inside:
        return math.nan
    mean_rad = math.atan2(math.fsum(map(math.sin, inside)), math.fsum(map(math.cos, inside)))
    return math.remainder(0.5 * math.pi - mean_rad, 2.0 * math.pi)
