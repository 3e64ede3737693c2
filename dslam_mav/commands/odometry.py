"""`--send-odometry`: may the vehicle be told where it is, and what is told."""

from __future__ import annotations

from argparse import Namespace

from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.meeting import Met
from dslam_mav.errors import BadInputError
from dslam_mav.legs import plan_headings_rad
from dslam_mav.mav.frames import COMPONENT_ESTIMATOR
from dslam_mav.mav.odometry import LOCAL_FRD, LOCAL_NED, OdometryOut
from dslam_mav.mission import Mission


def check(options: Namespace, assumptions: Assumptions) -> None:
    """BadInputError, one line, where an answer would have no place on the ground."""
    if not options.send_odometry:
        return
    if assumptions.heading == "none":
        raise BadInputError("--send-odometry with --heading none: an answer in its own gauge has no north; expected "
                            "--heading vehicle or plan")  # fmt: skip
    if getattr(options, "feed_odometry", False):
        raise BadInputError("--send-odometry with --feed-odometry: expected one of them, a vehicle heeds one sender")


def sender(options: Namespace, assumptions: Assumptions, vehicle: Met, mission: Mission) -> OdometryOut | None:
    """What a flight on this mission sends; None where nothing is asked for."""
    if not options.send_odometry:
        return None
    planned = None
    if assumptions.heading == "plan":
        planned = {start: heading_rad for (start, _), heading_rad in plan_headings_rad(mission).items()}
    frame = LOCAL_FRD if vehicle.profile.name == "ardupilot" else LOCAL_NED  # ArduPilot takes this one as north, east
    return OdometryOut(vehicle.system, COMPONENT_ESTIMATOR, planned, frame)
