from __future__ import annotations

from typing import Any

from fakes import mission

from dslam_mav.commands.flight_progress import FlightProgress
from dslam_mav.mav.frames import messages
from dslam_mav.mission import leg_plan

M = messages()


def position(time_ms: int, north_m: float, east_m: float) -> Any:
    return M.MAVLink_local_position_ned_message(time_ms, north_m, east_m, -10.0, 0.0, 0.0, 0.0)


def test_progress_is_metres_and_seconds_along_the_mission() -> None:
    legs = leg_plan(mission([(0.0, 0.0), (30.0, 0.0), (30.0, 40.0)]))
    first, second, third = legs.sequence
    progress = FlightProgress(legs)
    assert (progress.what, progress.detail, progress.flown_m) == ("to the first waypoint", "", 0.0)
    progress.see(position(5_000, 0.0, 0.0))
    progress.see(M.MAVLink_mission_item_reached_message(first))
    progress.see(position(8_000, 0.0, 12.0))
    assert progress.what == "leg 1 of 2"
    assert progress.detail == "12 of 70 m, 3 s of flight"
    progress.see(position(15_000, 0.0, 33.0))  # overshoot: no more than the leg
    assert round(progress.flown_m) == 30
    progress.see(M.MAVLink_mission_item_reached_message(second))
    progress.see(M.MAVLink_mission_item_reached_message(first))  # heard twice
    progress.see(position(17_000, 4.0, 30.0))
    assert (progress.what, round(progress.flown_m)) == ("leg 2 of 2", 35)
    progress.see(M.MAVLink_mission_item_reached_message(third))
    assert progress.flown
    assert (progress.what, round(progress.flown_m)) == ("2 legs flown", 70)


def test_without_positions_there_are_still_legs() -> None:
    legs = leg_plan(mission([(0.0, 0.0), (30.0, 0.0), (30.0, 40.0)]))
    progress = FlightProgress(legs)
    progress.see(M.MAVLink_mission_item_reached_message(legs.sequence[1]))
    assert progress.what == "leg 2 of 2"
    assert round(progress.flown_m) == 30
