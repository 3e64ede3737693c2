"""`bridge`: inject readings into a vehicle's flight."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from dslam_mav.commands.background import background
from dslam_mav.commands.readings import open_readings, places_m
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.signing import signing_from
from dslam_mav.errors import BadInputError
from dslam_mav.mav.frames import COMPONENT_BRIDGE, COMPONENT_GROUND, SYSTEM_GROUND
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.transfer import download
from dslam_mav.mav.signing import Signing
from dslam_mav.mission import Mission, leg_plan
from missions.plan_file import read_plan
from sim_bridge.bridge import Bridge


def run(options: Namespace) -> int:
    """Read the field along the vehicle's mission until its last vertex."""
    screen = Screen(json_only=options.json)
    signing = signing_from(options, screen)
    if options.plan:
        mission = read_plan(Path(options.plan)).mission
        system = _vehicle(options, signing)
    else:
        system, mission = _held(options, signing)
    legs = leg_plan(mission)
    if len(legs.sequence) < 2:
        where = options.plan or f"vehicle {system}'s mission"
        raise BadInputError(f"{where}: {len(legs.sequence)} waypoints: expected 2 or more, to read between")
    readings = open_readings(options, places_m(mission), None)
    for note in readings.notes:
        screen.say(note)
    with Link(options.connect, system=system, component=COMPONENT_BRIDGE, signing=signing) as link:
        bridge = Bridge(
            link,
            system,
            readings.field,
            readings.sampling,
            legs.sequence,
            noise_sd=readings.noise_sd,
            rng=readings.rng,
        )
        screen.say(f"reading {readings.name} along {len(legs.lengths_m)} legs of vehicle {system}")
        with background(bridge.run, "bridge") as worker, screen.progress("reading") as advance:
            while worker.running:
                worker.join(0.2)
                advance("reading", 0, None, f"{bridge.sent} readings sent")
            worker.check()
    if bridge.missing:
        screen.warn(f"{readings.name}: {bridge.missing} readings left out, it has no value for that time or place")
    if unplaced := bridge.sampler.unplaced:
        screen.warn(f"{readings.name}: {unplaced} readings left out, the vehicle's place was not heard")
    screen.say(f"{bridge.sent} readings sent")
    screen.result({"sent": bridge.sent, "missing": bridge.missing, "unplaced": unplaced})
    return 0


def _vehicle(options: Namespace, signing: Signing | None) -> int:
    with _ground(options, signing) as ground:
        return wait_for_vehicle(ground, options.timeout)


def _held(options: Namespace, signing: Signing | None) -> tuple[int, Mission]:
    with _ground(options, signing) as ground:
        system = wait_for_vehicle(ground, options.timeout)
        return system, download(ground, system)


def _ground(options: Namespace, signing: Signing | None) -> Link:
    return Link(options.connect, system=SYSTEM_GROUND, component=COMPONENT_GROUND, signing=signing)
