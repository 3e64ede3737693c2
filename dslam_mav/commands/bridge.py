"""`bridge`: inject readings into a vehicle's flight."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from dslam_mav.commands.background import background
from dslam_mav.commands.meeting import met
from dslam_mav.commands.readings import open_readings, places_m
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.signing import signing_from
from dslam_mav.errors import BadInputError
from dslam_mav.mav.mission.transfer import download
from dslam_mav.mission import home_of, leg_plan
from missions.plan_file import read_plan
from sim_bridge.bridge import Bridge
from sim_bridge.whereabouts import Whereabouts


def run(options: Namespace) -> int:
    """Read the field along the vehicle's mission until its last vertex."""
    screen = Screen(json_only=options.json)
    signing = signing_from(options, screen)
    with met([options.connect], options, signing) as vehicle:
        system = vehicle.system
        if options.plan:
            mission = vehicle.numbered(read_plan(Path(options.plan)).mission)
        else:
            mission = download(vehicle.ground, system)
        legs = leg_plan(mission)
        if len(legs.sequence) < 2:
            where = options.plan or f"vehicle {system}'s mission"
            raise BadInputError(f"{where}: {len(legs.sequence)} waypoints: expected 2 or more, to read between")
        readings = open_readings(options, places_m(mission), None)
        for note in readings.notes:
            screen.say(note)
        bridge = Bridge(
            vehicle.bridge(),
            system,
            readings.field,
            readings.sampling,
            legs.sequence,
            noise_sd=readings.noise_sd,
            rng=readings.rng,
            before_s=readings.before_s,
            where=Whereabouts(options.truth_from, home_of(mission)),
            ask_after_s=vehicle.profile.ask_after_s,
        )
        vehicle.hubs[0].leave(vehicle.ground)
        screen.say(f"reading {readings.name} along {len(legs.lengths_m)} legs of vehicle {system}")
        with (
            vehicle.fed(options.feed_odometry),
            background(bridge.run, "bridge") as worker,
            screen.progress("reading") as advance,
        ):
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
