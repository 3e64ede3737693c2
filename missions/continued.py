"""A mission whose legs to come are flown another way: the part flown kept, the rest placed by turns and lengths.

Everything is in the vehicle's own frame, whatever its errors are: waypoints are places in it, the leg under way is a
line in it, and a turn from that line means the same to the estimator, which knows no frame at all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.mission import CMD_JUMP, CMD_WAYPOINT, Mission, MissionItem, enu_to_e7, home_of, leg_plan

Array = NDArray[np.float64]


def continued(mission: Mission, end_seq: int, turn_rad: Sequence[float], length_m: Sequence[float]) -> Mission:
    """The mission with other legs after the one that ends at item `end_seq`, which is a vertex of it.

    Each leg begins with a turn from the one before, counter-clockwise, the first from the leg that ends at `end_seq`.
    What follows the last waypoint (return, landing) still does, and no legs at all lead straight to it; what stands
    between the waypoints to come is lost (see `lost_item`). ValueError:
    `end_seq` ends no leg of the mission.
    """
    plan, home = leg_plan(mission), home_of(mission)
    if end_seq not in plan.sequence[1:] or home is None:
        raise ValueError(f"end_seq: expected the end of a leg of the mission, {plan.sequence[1:]}, got {end_seq}")
    if len(turn_rad) != len(length_m):
        raise ValueError(f"turn_rad: expected one for each of {len(length_m)} lengths, got {len(turn_rad)}")
    last = max(q for q, _ in mission.waypoints())
    model = mission.items[end_seq]
    to_come = [_at(model, place, mission) for place in vertices_to_come(mission, end_seq, turn_rad, length_m)[1:]]
    return replace(mission, items=(*mission.items[: end_seq + 1], *to_come, *mission.items[last + 1 :]))


def lost_item(mission: Mission) -> int | None:
    """The sequence number of the first item that `continued` would lose or leave pointing astray: one between the legs
    to come, which belongs to none of them, or a jump, whose numbers then mean other items. None: nothing is lost.
    """
    path = leg_plan(mission).sequence
    last = max((seq for seq, _ in mission.waypoints()), default=-1)
    flown_on = {seq for seq, _ in mission.waypoints()}
    for seq, item in enumerate(mission.items):
        between = len(path) > 1 and path[1] < seq < last and seq not in flown_on
        if between or item.command == CMD_JUMP:
            return seq
    return None


def vertices_to_come(mission: Mission, end_seq: int, turn_rad: Sequence[float], length_m: Sequence[float]) -> Array:
    """(n + 1, 2) metres east and north of home: from the end of the leg under way on."""
    plan = leg_plan(mission)
    j = plan.sequence.index(end_seq)
    step = plan.vertices_m[j] - plan.vertices_m[j - 1]
    heading = math.atan2(step[1], step[0]) + np.cumsum(np.asarray(turn_rad, dtype=np.float64))
    steps = np.asarray(length_m, dtype=np.float64)[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    return np.asarray(plan.vertices_m[j] + np.vstack([np.zeros((1, 2)), np.cumsum(steps.reshape(-1, 2), axis=0)]))


def turns_so_far(mission: Mission, end_seq: int) -> Array:
    """Radians between the legs up to the one that ends at item `end_seq`, positive to the side of the first turn."""
    plan = leg_plan(mission)
    turn = np.diff(plan.headings_rad[: plan.sequence.index(end_seq)])
    return np.asarray((first_turn(mission) or 1.0) * (np.remainder(turn + math.pi, 2.0 * math.pi) - math.pi))


def first_turn(mission: Mission) -> float:
    """+1 where its first turn is to the left, -1 to the right (0: it never turns)."""
    heading = leg_plan(mission).headings_rad
    for turn in np.diff(heading):
        if abs(math.sin(turn)) > 1e-3:
            return math.copysign(1.0, math.sin(turn))
    return 0.0


def _at(model: MissionItem, place_m: Array, mission: Mission) -> MissionItem:
    """A waypoint like the one that ends the leg under way, elsewhere."""
    home = home_of(mission)
    assert home is not None
    x, y = enu_to_e7(float(place_m[0]), float(place_m[1]), home)
    return replace(model, command=CMD_WAYPOINT, x=x, y=y)
