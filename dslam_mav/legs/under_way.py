"""The leg being flown, before it ends: for what is to be decided about the next one. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dslam_mav.legs.assembly import FlownLeg, Samples, assemble
from dslam_mav.legs.distance import Distance
from dslam_mav.legs.passing import Event
from dslam_mav.legs.plan import PlanFacts


@dataclass(frozen=True, slots=True, eq=False)
class UnderWay:
    """`legs` flown with the one under way last, which ends at item `end_seq`, is `planned_m` long in the plan and
    flown to the `share` of it; `left_s` of the vehicle's time until its end at the pace so far.
    """

    legs: tuple[FlownLeg, ...]
    end_seq: int
    planned_m: float
    share: float
    left_s: float
    now_ms: int


def part_flown(
    events: Sequence[Event], samples: Samples, plan: PlanFacts | None, mode: Distance | None, newest_ms: int
) -> UnderWay | None:
    """The legs until `newest_ms`; None where no leg of the plan is under way, or its distance is not measured."""
    if plan is None or not events or events[-1].seq not in plan.vertices[:-1] or newest_ms <= events[-1].time_ms:
        return None
    start = events[-1]
    end_seq = plan.vertices[plan.vertices.index(start.seq) + 1]
    planned_m = plan.length_m(start.seq, end_seq)
    now = Event(end_seq, newest_ms, start.run, len(events), start.boot)
    legs, _ = assemble([*events, now], samples, plan, mode)
    if planned_m is None or not legs or legs[-1].end_ms != newest_ms or legs[-1].mode == "plan":
        return None
    flown_m, seconds = legs[-1].length_m, 1e-3 * (newest_ms - start.time_ms)
    left_s = max(planned_m - flown_m, 0.0) * seconds / max(flown_m, 1e-9)
    return UnderWay(legs, end_seq, planned_m, flown_m / planned_m, left_s, newest_ms)
