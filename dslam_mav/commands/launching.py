"""A vehicle of our own, getting a flight off the ground, and what the vehicle complains of."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from dslam_mav.commands.background import Background, background
from dslam_mav.commands.meeting import READY_PATIENCE_S, Met
from dslam_mav.commands.screen import Screen
from dslam_mav.mav.mission.start import start
from dslam_mav.mav.signing import Signing
from dslam_mav.mission import Mission, home_of
from sim_bridge.vehicle import DEFAULT_HOME, Vehicle

SPEEDUP = 10.0
SPEEDUP_ADAPTIVE = 1.0
"""Choosing the legs to come takes about a second of the host's time, whatever the vehicle's clock does."""

_ERROR = 3  # MAV_SEVERITY


@contextmanager
def loopback(options: Namespace, mission: Mission, signing: Signing | None) -> Iterator[str]:
    """A loopback vehicle of our own; the URL to reach it at."""
    home = home_of(mission) or DEFAULT_HOME
    speedup = options.speedup or (SPEEDUP_ADAPTIVE if options.adaptive else SPEEDUP)
    vehicle = Vehicle(["udpin:127.0.0.1:0"], speedup=speedup, seed=options.seed or 0, home=home, signing=signing)
    with background(vehicle.run, "vehicle"):
        yield vehicle.urls[0].replace("udpin", "udpout", 1)


def begin(vehicle: Met, workers: tuple[Background, Background], screen: Screen) -> None:
    """Arm and start; a refusal is shown and tried again."""
    time.sleep(0.3)  # a vehicle forwards only to those whose heartbeat it has heard
    for worker in workers:
        worker.check()
    told: set[str] = set()

    def waiting(why: str) -> None:
        advance("waiting until it is armed", 0, None, why)
        if why not in told:
            told.add(why)
            screen.say(f"{why[0].upper()}{why[1:]}: trying again")

    with screen.progress("starting the mission") as advance:
        start(vehicle.ground, vehicle.system, READY_PATIENCE_S, waiting)


def complain(message: Any, screen: Screen) -> None:
    """What the vehicle says of a failsafe, or the like, a person should read at once."""
    if message.get_type() == "STATUSTEXT" and message.severity <= _ERROR:
        screen.warn(f"vehicle {message.get_srcSystem()} says: {' '.join(message.text.split())}")
