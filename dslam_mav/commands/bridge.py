"""`bridge`: inject readings into a vehicle's flight."""

from __future__ import annotations

from argparse import Namespace

from dslam_mav.commands.background import background
from dslam_mav.commands.meeting import flown, met, planned_path
from dslam_mav.commands.readings import left_out, places_m, source_of_readings
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.signing import signing_from
from dslam_mav.mission import home_of, leg_plan
from dslam_mav.records.words import count
from sim_bridge.bridge import Bridge
from sim_bridge.whereabouts import Whereabouts


def run(options: Namespace) -> int:
    """Read the field along the vehicle's mission until its last vertex."""
    screen = Screen(json_only=options.json)
    plan = planned_path(options)
    along = source_of_readings(options)
    if plan is not None:
        along(places_m(plan), None)
    signing = signing_from(options, screen)
    with met([options.connect], options, signing) as vehicle:
        system = vehicle.system
        mission = flown(vehicle, plan)
        legs = leg_plan(mission)
        readings = along(places_m(mission), None)
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
        screen.say(f"Reading {readings.name} along {count(len(legs.lengths_m), 'leg')} of vehicle {system}")
        with (
            vehicle.fed(options.feed_odometry),
            background(bridge.run, "bridge") as worker,
            screen.progress("reading") as advance,
        ):
            while worker.running:
                worker.join(0.2)
                advance("reading", 0, None, f"{count(bridge.sent, 'reading')} sent")
            worker.check()
    if bridge.missing:
        screen.warn(left_out(bridge.missing, readings.name, "it has no value for that time or place"))
    if unplaced := bridge.sampler.unplaced:
        screen.warn(left_out(unplaced, readings.name, "the vehicle's place was not heard"))
    screen.say(f"{count(bridge.sent, 'reading')} sent")
    screen.result({"sent": bridge.sent, "missing": bridge.missing, "unplaced": unplaced})
    return 0
