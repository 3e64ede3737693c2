"""`upload`, `download`, `clear`: the mission protocol from the command line."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from pathlib import Path

from dslam_mav.commands.screen import Screen
from dslam_mav.commands.signing import signing_from
from dslam_mav.mav.frames import COMPONENT_GROUND, SYSTEM_GROUND
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.suit import suited
from dslam_mav.mav.mission.talk import Talk
from dslam_mav.mav.mission.transfer import clear, download, start, upload
from dslam_mav.mav.position import stands_at
from dslam_mav.mav.profile import profile_named, profile_of
from dslam_mav.mission import Mission, home_of, leg_plan
from dslam_mav.records.words import count
from missions.plan_file import check_plan_output, read_plan, write_plan

ARMING_PATIENCE_S = 120.0


def run_upload(options: Namespace) -> int:
    """Send a plan, read it back and compare; with `--start` arm and fly it."""
    screen = Screen(json_only=options.json)
    plan = read_plan(Path(options.plan))
    for note in plan.notes:
        screen.warn(note)
    with _ground(options, screen) as link:
        system = wait_for_vehicle(link, options.timeout)
        mission = _with_holds(link, system, plan.mission, options.hold, screen)
        with screen.progress("mission upload") as advance:
            held = upload(
                link,
                system,
                mission,
                lambda done, total: advance("mission upload", done, total, f"{done} of {count(total, 'item')}"),
            )
        legs = leg_plan(held)
        length_m = float(legs.lengths_m.sum())
        screen.say(
            f"Vehicle {system} holds the mission: {count(len(held.items), 'item')}, "
            f"{count(len(legs.lengths_m), 'leg')}, {length_m:.1f} m (read back and compared)"
        )
        if options.start:
            stands_at(link, system, home_of(mission), ARMING_PATIENCE_S)
            start(link, system, ARMING_PATIENCE_S)
            screen.say(f"Vehicle {system} flies it")
    screen.result(
        {
            "system": system,
            "items": len(held.items),
            "legs": len(legs.lengths_m),
            "length_m": length_m,
            "started": bool(options.start),
        }
    )
    return 0


def _with_holds(link: Link, system: int, mission: Mission, hold_s: float | None, screen: Screen) -> Mission:
    """The mission as `fly` sends it: stopped at its corners as the autopilot needs it, or for `hold_s`. A plan that has
    holds of its own keeps them.
    """
    autopilot, vehicle_type = Talk(link, system).autopilot()
    profile = link.profile or profile_of(autopilot)
    if hold_s is None and any(item.params[0] > 0.0 for _, item in mission.waypoints()):
        hold_s = 0.0
    if hold_s is not None:
        profile = replace(profile, corner_hold_s=hold_s)
    mission, notes = suited(mission, profile, vehicle_type)
    for note in notes:
        screen.say(f"{note[0].upper()}{note[1:]}")
    return mission


def run_download(options: Namespace) -> int:
    """Fetch the vehicle's mission and write it to a file."""
    screen = Screen(json_only=options.json)
    check_plan_output(options.output)
    with _ground(options, screen) as link:
        system = wait_for_vehicle(link, options.timeout)
        mission = download(link, system)
    write_plan(Path(options.output), mission)
    screen.say(f"{options.output}: {count(len(mission.items), 'item')} from vehicle {system}")
    screen.result({"system": system, "items": len(mission.items), "plan": options.output})
    return 0


def run_clear(options: Namespace) -> int:
    """Make the vehicle forget its mission."""
    screen = Screen(json_only=options.json)
    with _ground(options, screen) as link:
        system = wait_for_vehicle(link, options.timeout)
        clear(link, system)
    screen.say(f"Vehicle {system} holds no mission now")
    screen.result({"system": system, "items": 0})
    return 0


def _ground(options: Namespace, screen: Screen) -> Link:
    signing = signing_from(options, screen)
    link = Link(options.connect, system=SYSTEM_GROUND, component=COMPONENT_GROUND, signing=signing)
    link.profile = profile_named(options.profile) if options.profile else None
    return link
