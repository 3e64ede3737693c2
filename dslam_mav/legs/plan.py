"""What an estimate may know of the plan: its vertices and its legs' lengths.

The directions of the plan's legs are a function of their own, for the pilot who asks for `--heading plan`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from dslam_mav.mission import Mission, leg_plan


@dataclass(frozen=True, slots=True)
class PlanFacts:
    """`vertices`: the sequence numbers of the path's corners, rising; `lengths_m`: the legs between them."""

    vertices: tuple[int, ...]
    lengths_m: tuple[float, ...]

    def __post_init__(self) -> None:
        if list(self.vertices) != sorted(set(self.vertices)):
            raise ValueError(f"vertices: expected rising sequence numbers, got {self.vertices}")
        if len(self.lengths_m) != max(0, len(self.vertices) - 1):
            raise ValueError(f"lengths_m: expected {len(self.vertices) - 1} lengths, got {len(self.lengths_m)}")

    def length_m(self, start_seq: int, end_seq: int) -> float | None:
        """The planned length of the leg between two neighbouring vertices; None if they are none."""
        pairs = pairwise(self.vertices)
        return dict(zip(pairs, self.lengths_m, strict=True)).get((start_seq, end_seq))


def plan_facts(mission: Mission) -> PlanFacts:
    """The facts of a mission as the vehicle holds it."""
    plan = leg_plan(mission)
    return PlanFacts(plan.sequence, tuple(float(length) for length in plan.lengths_m))


def plan_headings_rad(mission: Mission) -> dict[tuple[int, int], float]:
    """(start, end sequence numbers) of every leg -> its planned direction, counter-clockwise from east."""
    plan = leg_plan(mission)
    return dict(zip(pairwise(plan.sequence), map(float, plan.headings_rad), strict=True))
