"""Getting a flight off the ground, and what the vehicle complains of."""

from __future__ import annotations

import time
from typing import Any

from dslam_mav.commands.background import Background
from dslam_mav.commands.meeting import READY_PATIENCE_S, Met
from dslam_mav.commands.screen import Screen
from dslam_mav.mav.mission.start import start

_ERROR = 3  # MAV_SEVERITY


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
