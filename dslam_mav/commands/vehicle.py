"""`vehicle`: the loopback vehicle, until Ctrl-C."""

from __future__ import annotations

import time
from argparse import Namespace

from dslam_mav.commands.background import background
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.signing import signing_from
from dslam_mav.errors import BadInputError
from dslam_mav.mission import Home
from sim_bridge.vehicle import DEFAULT_HOME, Vehicle, parse_link_faults


def run(options: Namespace) -> int:
    """Serve until interrupted."""
    screen = Screen(json_only=options.json)
    vehicle = Vehicle(
        options.listen or ["udpin:127.0.0.1:14550"],
        system=options.system,
        speedup=options.speedup,
        seed=options.seed or 0,
        home=parse_home(options.home) if options.home else DEFAULT_HOME,
        cruise_speed_m_s=options.cruise_speed,
        profile=options.profile,
        feed=options.feed,
        signing=signing_from(options, screen),
        link_faults=parse_link_faults(options.link_faults) if options.link_faults else None,
    )
    screen.say(f"Vehicle {options.system} listens on {', '.join(vehicle.urls)}, {options.speedup:g} times real time")
    screen.result({"system": options.system, "urls": list(vehicle.urls)})
    with background(vehicle.run, "vehicle") as worker:
        while worker.running:
            time.sleep(0.2)
        worker.check()
    return 0


def parse_home(text: str) -> Home:
    """ "LAT,LON" or "LAT,LON,ALT" in degrees and metres."""
    parts = text.split(",")
    try:
        if len(parts) not in (2, 3):
            raise ValueError("expected LAT,LON or LAT,LON,ALT in degrees and metres")
        return Home(*(float(part) for part in parts))
    except ValueError as problem:
        raise BadInputError(f"--home {text}: {problem}") from None
