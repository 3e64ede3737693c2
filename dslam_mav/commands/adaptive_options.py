"""`--adaptive`: what a pilot says of a mission that is decided as it is flown, and the adviser set up by it."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import dataclass

import numpy as np

from dslam_mav.assumptions import Assumptions
from dslam_mav.dslam.known import Known
from dslam_mav.dslam.layouts import Region
from dslam_mav.errors import BadInputError
from dslam_mav.mav.mission.compare import command_name
from dslam_mav.mission import CMD_JUMP, Mission, leg_plan
from missions.adviser import FIRST_GUESS_K, Adviser, Assumed, canonical_box
from missions.continued import lost_item
from missions.fence import Fence

LEG_SPREADS = 3.8  # a planned leg's usual length
SPREAD_FACTOR = 1.6  # √C either way, where nothing is said of it
LEAST_LEG_SHARE = 0.2  # of a planned leg


@dataclass(frozen=True, slots=True, eq=False)
class Steered:
    """The adviser, and what its proposals are held to: metres in all, the shortest leg, the fence (metres east and
    north of the mission's home).
    """

    adviser: Adviser
    total_m: float
    least_leg_m: float
    fence: Fence


def steered(options: Namespace, assumptions: Assumptions, held: Mission, fence: Fence) -> Steered | None:
    """The adviser of a flight on the mission `held`; None where none is asked for."""
    if not options.adaptive:
        return None
    plan = leg_plan(held)
    total_m = float(plan.lengths_m.sum())
    least_m = LEAST_LEG_SHARE * total_m / len(plan.lengths_m)
    adviser = Adviser(_assumed(assumptions, plan.vertices_m), target_sd_m=options.target_sd, seed=assumptions.seed)
    return Steered(adviser, total_m, least_m, fence)


def check(options: Namespace) -> None:
    """BadInputError, one line, for what does not go together."""
    if options.target_sd is not None and not options.adaptive:
        raise BadInputError(f"--target-sd {options.target_sd:g}: only with --adaptive")
    if not options.adaptive:
        return
    if options.method == "paper":
        raise BadInputError("--adaptive with --method paper: legs are chosen by the joint estimate; expected joint")
    if options.distance == "plan":
        raise BadInputError(
            "--adaptive with --distance plan: how far a leg is flown must be measured; expected odometry or speed"
        )
    if options.heading == "plan":
        raise BadInputError("--adaptive with --heading plan: the plan changes in flight; expected none or vehicle")
    if options.closed:
        raise BadInputError("--adaptive with --closed: legs chosen in flight need not end where they began")
    if getattr(options, "readings", None) and not str(options.readings).endswith(".npz"):
        raise BadInputError(
            f"--adaptive with --readings {options.readings}: logged readings are of the path they were taken on; "
            "expected --scene, .npz frames or a sensor"
        )


def check_mission(options: Namespace, mission: Mission, name: str) -> None:
    """Before take-off: BadInputError for a mission that cannot be changed in flight without losing an item."""
    if not options.adaptive or (seq := lost_item(mission)) is None:
        return
    command = mission.items[seq].command
    why = (
        "items have other numbers once the legs to come are changed: expected a mission without jumps"
        if command == CMD_JUMP
        else "it would be lost with the legs to come: expected it before the second waypoint or after the last"
    )
    raise BadInputError(f"{name}: item {seq} ({command_name(command)}) with --adaptive: {why}")


def _assumed(assumptions: Assumptions, vertices_m: np.ndarray) -> Assumed:
    """Sources are looked for where the plan goes; it is all a pilot says of the area."""
    medium = assumptions.medium()
    low, high = canonical_box(vertices_m)
    usual_m = float(np.linalg.norm(np.diff(vertices_m, axis=0), axis=1).mean()) / LEG_SPREADS
    spread_m = (usual_m / SPREAD_FACTOR, usual_m * SPREAD_FACTOR)
    mu, tau = medium.diffusivity_m2_s, medium.activation_s
    if medium.spread_m is not None:
        spread_m = (float(medium.spread_m), float(medium.spread_m))
    elif mu is not None and isinstance(tau, float):
        known_m = math.sqrt(4.0 * mu * -tau)
        spread_m = (known_m, known_m)
    rate = 0.0 if medium.static or mu is None else 4.0 * mu
    region = Region(tuple(low.tolist()), tuple(high.tolist()))
    k = assumptions.n_sources or FIRST_GUESS_K
    return Assumed(medium, assumptions.n_sources, Known(k, region, spread_m, rate, medium.ambient))
