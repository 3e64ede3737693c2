"""`plan`: make a mission, or look at one somebody else drew."""

from __future__ import annotations

import math
from argparse import Namespace
from pathlib import Path

import numpy as np

from dslam_mav.commands.screen import Screen
from dslam_mav.commands.vehicle import parse_home
from dslam_mav.errors import BadInputError
from dslam_mav.mission import Mission, leg_plan
from missions.patterns import pattern
from missions.plan import Profile, plan_mission
from missions.plan_file import PlanFile, read_plan, write_plan
from sim_bridge.vehicle import DEFAULT_HOME

DEFAULTS = {
    "pattern": "star7",
    "leg": 32.0,
    "first_heading": 0.0,
    "altitude": 20.0,
    "speed": 5.0,
    "hold": 0.0,
    "seed": 0,
}
MAKING = (*DEFAULTS, "legs", "home", "centre")
"""Options of a mission that is made; with a FILE none of them says anything."""


def run(options: Namespace) -> int:
    """Write the plan and say what it is."""
    screen = Screen(json_only=options.json)
    plan, name = _plan(options)
    legs = leg_plan(plan.mission)
    if len(legs.lengths_m) < 1:
        raise BadInputError(f"{options.plan}: {len(legs.sequence)} waypoints: expected 2 or more, to fly legs between")
    for note in plan.notes:
        screen.warn(note)
    if options.output:
        write_plan(Path(options.output), plan.mission)
    length_m = float(legs.lengths_m.sum())
    screen.say(f"{name}: {len(legs.lengths_m)} legs, {length_m:.1f} m")
    turns = np.degrees(np.diff(legs.headings_rad))
    turns = (turns + 180.0) % 360.0 - 180.0
    for j, leg_m in enumerate(legs.lengths_m):
        screen.say(f"  leg {j + 1}: {leg_m:.2f} m{_then(turns[j]) if j < len(turns) else ''}")
    if options.output:
        screen.say(f"written {options.output}")
    said = {"legs": len(legs.lengths_m), "length_m": length_m, "plan": options.output}
    screen.result({"predicted": None, "verdict": None, **said})
    return 0


def _plan(options: Namespace) -> tuple[PlanFile, str]:
    """The plan read or made, and its name."""
    given = [name for name in MAKING if getattr(options, name) is not None]
    if options.plan and given:
        raise BadInputError(
            f"--{given[0].replace('_', '-')} with {options.plan}: expected one of them: a plan is made or read"
        )
    if options.plan:
        return read_plan(Path(options.plan)), Path(options.plan).name
    for name, value in DEFAULTS.items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    return PlanFile(_make(options)), str(options.pattern)


def _then(turn_deg: float) -> str:
    if abs(turn_deg) < 0.05:
        return ", then straight on"
    return f", then {abs(turn_deg):.1f}° {'left' if turn_deg > 0 else 'right'}"


def _make(options: Namespace) -> Mission:
    centre = None
    if options.centre:
        try:
            east_m, north_m = (float(part) for part in options.centre.split(","))
        except ValueError:
            raise BadInputError(f"--centre {options.centre}: expected EAST_M,NORTH_M") from None
        centre = (east_m, north_m)
    vertices = pattern(
        options.pattern,
        options.leg,
        legs=options.legs,
        heading_rad=math.radians(options.first_heading),
        centre_m=centre,
        rng=np.random.default_rng(options.seed),
    )
    home = parse_home(options.home) if options.home else DEFAULT_HOME
    profile = Profile(altitude_m=options.altitude, speed_m_s=options.speed, hold_s=options.hold)
    return plan_mission(vertices, home, profile)
