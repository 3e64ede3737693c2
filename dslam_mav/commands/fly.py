"""`fly`: plan, upload, start, read, estimate, log and report in one go."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import numpy as np

from dslam_mav.commands.adaptive_options import check, check_mission
from dslam_mav.commands.assume import assumptions_from
from dslam_mav.commands.compass import compared
from dslam_mav.commands.flying import Setup, fly
from dslam_mav.commands.folder import flight_folder
from dslam_mav.commands.live import served
from dslam_mav.commands.odometry import check as check_odometry
from dslam_mav.commands.outcome import show, write_report
from dslam_mav.commands.readings import Readings, open_readings, places_m
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.signing import signing_from
from dslam_mav.dslam.warm import warm_up
from dslam_mav.errors import BadInputError, DslamError
from dslam_mav.mav.url import parse_url
from dslam_mav.mission import CMD_CHANGE_SPEED, Mission, leg_plan, with_home_item
from dslam_mav.records.words import count
from missions.plan import Profile, plan_mission
from missions.plan_file import read_plan
from sim_bridge.vehicle import DEFAULT_HOME

ALTITUDE_M = 20.0
SENSED_M = 10.0
"""Where a vehicle may hold its height by a range finder."""


def run(options: Namespace) -> int:
    """Fly; exit code 0 when sources were reconstructed."""
    screen = Screen(json_only=options.json)
    check(options)
    setup = _set_up(options, screen)
    check_odometry(options, setup.assumptions)
    check_mission(options, setup.mission, setup.plan_name)
    for note in setup.notes:
        screen.warn(note)
    for note in setup.readings.notes:
        screen.say(note)
    with served(options, screen) as live:
        with screen.progress("loading the estimator (compiled on first use)"):
            warm_up()
        with flight_folder(Path(options.out)) as folder:
            outcome = fly(replace(setup, live=live.send if live else None), folder, options, screen)
            try:
                outcome = write_report(compared(outcome), folder / "report.html")
            except DslamError as problem:  # a full disk must not cost the answer
                outcome = replace(outcome, stopped=outcome.stopped or problem)
    return show(screen, outcome)


def _set_up(options: Namespace, screen: Screen) -> Setup:
    for url in options.connect or ():
        parse_url(url)
    notes: tuple[str, ...] = ()
    if options.plan:
        plan = read_plan(Path(options.plan))
        mission, name, notes = _with_home(plan.mission, options.plan), Path(options.plan).name, plan.notes
    else:
        own = open_readings(options, None, None)
        profile = Profile(
            altitude_m=_height_m(own, SENSED_M if options.connect else ALTITUDE_M), speed_m_s=own.speed_m_s, hold_s=0.0
        )
        mission, name = plan_mission(own.vertices_m[:, :2], DEFAULT_HOME, profile), f"the path of {own.name}"
    legs = leg_plan(mission)
    if len(legs.vertices_m) < 2:
        raise BadInputError(
            f"{options.plan}: {count(len(legs.vertices_m), 'waypoint')}: expected 2 or more, to fly legs between"
        )
    readings = open_readings(options, places_m(mission), _speed_m_s(mission))
    assumptions = assumptions_from(options, medium=readings.medium)
    return Setup(mission, readings, assumptions, name, notes, signing_from(options, screen))


def _height_m(own: Readings, usual_m: float) -> float:
    """The height of a path in space, which must be one; where a path has none, the usual."""
    if own.vertices_m.shape[1] == 2:
        return usual_m
    heights_m = own.vertices_m[:, 2]
    if np.ptp(heights_m) > 0.0:
        low, high = heights_m.min(), heights_m.max()
        raise BadInputError(f"{own.name}: path.vertices_m: expected one height, got {low:g} to {high:g} m: give a PLAN")
    return float(heights_m[0])


def _with_home(mission: Mission, name: str) -> Mission:
    try:
        return with_home_item(mission, DEFAULT_HOME)
    except ValueError as problem:
        raise BadInputError(f"{name}: {problem}") from None


def _speed_m_s(mission: Mission) -> float | None:
    speeds = [item.params[1] for item in mission.items if item.command == CMD_CHANGE_SPEED and item.params[1] > 0.0]
    return speeds[0] if speeds else None
