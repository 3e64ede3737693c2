"""The mission as a log carries it, so that flight and replay use the very same one."""

from __future__ import annotations

import shlex
import sys
import time
from typing import TYPE_CHECKING

from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.assume import Recorded, configuration
from dslam_mav.log.recorder import Recorder
from dslam_mav.mission import Mission, has_home_item, leg_plan, without_home_item
from dslam_mav.records import Prediction
from missions.plan_file import parse_plan, plan_bytes

if TYPE_CHECKING:
    from dslam_mav.forecast import Sensor

MISSION_ATTACHMENT = "mission.waypoints"
PLAN_ATTACHMENT = "plan.plan"
CONFIGURATION_ATTACHMENT = "configuration.json"


def as_logged(mission: Mission) -> Mission:
    """The mission as replay will read it: home rounded as files round it, numbers of its items as on the wire."""
    data = plan_bytes(mission, ".waypoints")
    return logged_mission(data, "the vehicle's mission", home_item=has_home_item(mission))


def logged_mission(data: bytes, name: str, *, home_item: bool) -> Mission:
    """The mission of an attachment, which always begins with home; `home_item`: so did the vehicle's."""
    mission = parse_plan(data, name).mission
    return mission if home_item else without_home_item(mission)


def attach(recorder: Recorder, mission: Mission, assumptions: Assumptions, vehicle_system: int) -> None:
    """Give a log its mission and configuration."""
    recorder.attach(MISSION_ATTACHMENT, "text/plain", plan_bytes(mission, ".waypoints"))
    recorder.attach(PLAN_ATTACHMENT, "application/json", plan_bytes(mission, ".plan"))
    recorded = Recorded(assumptions, vehicle_system, has_home_item(mission))
    command = "dslam-mav " + shlex.join(sys.argv[1:])
    recorder.attach(CONFIGURATION_ATTACHMENT, "application/json", configuration(recorded, command))


def predict(recorder: Recorder, mission: Mission, assumptions: Assumptions, sensor: Sensor) -> Prediction | None:
    """Say in the log what the mission is expected to see, where anything can be said before it is flown."""
    from dslam_mav.forecast import forecast

    prediction = forecast(leg_plan(mission).vertices_m, assumptions, sensor)
    if prediction is not None:
        recorder.prediction(time.time_ns(), prediction)
    return prediction
