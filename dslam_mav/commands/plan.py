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
from missions.plan_file import read_plan, write_plan
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
    given = [name for name in MAKING if getattr(options, name) is not None]
    if options.plan and given:
        raise BadInputError(
            f"--{given[0].replace('_', '-')} with {options.plan}: expected one of them: a plan is made or read"
        )
    for name, value in DEFAULTS.items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    if options.plan:
        plan = read_plan(Path(options.plan))
        mission, name = plan.mission, Path(options.plan).name
        for note in plan.notes:
            screen.warn(note)
    else:
        mission, name = _make(options), options.pattern
    legs = leg_plan(mission)
    if len(legs.lengths_m) < 1:
        raise BadInputError(f"{options.plan}: {len(legs.sequence)} waypoints: expected 2 or more, to fly legs between")
    if options.output:
        write_plan(Path(options.output), mission)
    turns = np.degrees(np.diff(legs.headings_rad))
    turns = (turns + 180.0) % 360.0 - 180.0
    length_m = float(legs.lengths_m.sum())
    screen.say(f"{name}: {len(legs.lengths_m)} legs, {length_m:.1f} m")
    for j, leg_m in enumerate(legs.lengths_m):
        turn = f", then {abs(turns[j]):.1f}° {'left' if turns[j] > 0 else 'right'}" if j < len(turns) else ""
        screen.say(f"  leg {j + 1}: {leg_m:.2f} m{turn}")
    if options.output:
        screen.say(f"written {options.output}")
    screen.result(
        {
            "predicted": None,
            "verdict": None,
            "legs": len(legs.lengths_m),
            "length_m": length_m,
            "plan": options.output,
        }
    )
    return 0


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
