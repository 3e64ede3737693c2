"""Where the bridge reads the field: the simulator's true place, or what the vehicle believes."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dslam_mav.errors import LinkError
from dslam_mav.mav.frames import Parser, messages
from dslam_mav.mav.odometry import to_body
from dslam_mav.mission import Home, enu_to_e7
from sim_bridge.odometry_feed import OdometryFeed
from sim_bridge.whereabouts import Whereabouts, path_flown

M = messages()
HOME = Home(-35.363262, 149.165237, 584.0)


def believed(time_ms: int, east_m: float, north_m: float) -> Any:
    return M.MAVLink_local_position_ned_message(time_ms, north_m, east_m, -10.0, 0, 0, 0)


def attitude(time_ms: int) -> Any:
    return M.MAVLink_attitude_message(time_ms, 0, 0, 0, 0, 0, 0)


def sim_state(east_m: float, north_m: float, home: Home = HOME, *, whole: bool = True, up_m: float = 0.0) -> Any:
    x, y = enu_to_e7(east_m, north_m, home)
    ints = (x, y) if whole else (0, 0)
    return M.MAVLink_sim_state_message(
        1, 0, 0, 0, *(0.0,) * 9, float(x), float(y), home.altitude_m + up_m, 0, 0, 0, 0, 0, *ints
    )


def test_the_simulator_is_believed_where_it_speaks_and_stamped_with_the_message_before() -> None:
    where = Whereabouts(None, HOME)
    assert where.hear(believed(1000, 1.0, 2.0), settled=False) == (1000, (1.0, 2.0, 10.0))
    where.hear(attitude(1050), settled=False)
    time_ms, place_m = where.hear(sim_state(3.0, 4.0), settled=False)
    assert (time_ms, where.used) == (1050, "sim")
    assert place_m[:2] == pytest.approx((3.0, 4.0), abs=0.01)
    assert where.hear(believed(1060, 1.0, 2.0), settled=True) is None
    where.hear(attitude(1100), settled=True)
    assert where.hear(sim_state(3.0, 4.0, up_m=2.5), settled=True)[1][2] == pytest.approx(12.5, abs=0.01)


def test_float_fields_in_degrees_e7_serve_an_older_simulator() -> None:
    where = Whereabouts("sim", HOME)
    where.hear(attitude(7), settled=False)
    placed = where.hear(sim_state(100.0, 50.0, whole=False), settled=False)
    assert placed[1][:2] == pytest.approx((100.0, 50.0), abs=1.5)  # float32 of 1.5e9


def test_simstate_and_hil_state_quaternion() -> None:
    x, y = enu_to_e7(5.0, 6.0, HOME)
    where = Whereabouts("sim", HOME)
    where.hear(believed(10, 0.0, 0.0), settled=False)
    _, place_m = where.hear(M.MAVLink_simstate_message(*(0.0,) * 9, x, y), settled=False)
    assert place_m == pytest.approx((5.0, 6.0, 10.0), abs=0.01)
    hil = M.MAVLink_hil_state_quaternion_message(
        2_500_000, [1, 0, 0, 0], 0, 0, 0, x, y, 584_000, 0, 0, 0, 0, 0, 0, 0, 0
    )
    assert where.hear(hil, settled=False)[0] == 2500


def test_what_served_at_the_first_vertex_goes_on() -> None:
    where = Whereabouts(None, HOME)
    where.hear(believed(1, 0.0, 0.0), settled=False)
    assert where.hear(sim_state(3.0, 4.0), settled=True) is None
    assert where.used == "vehicle"


def test_a_simulator_on_another_continent_counts_from_where_it_stood() -> None:
    there = Home(47.0, 8.0, 400.0)
    where = Whereabouts(None, HOME)
    where.hear(attitude(1), settled=False)
    assert where.hear(sim_state(0.0, 0.0, there), settled=False)[1] == (0.0, 0.0, 0.0)
    assert where.hear(sim_state(3.0, 4.0, there), settled=False)[1][:2] == pytest.approx((3.0, 4.0), abs=0.02)


def test_a_simulator_asked_for_and_not_there_is_one_line() -> None:
    where = Whereabouts("sim", HOME)
    assert where.hear(believed(1, 0.0, 0.0), settled=False) is None
    with pytest.raises(LinkError, match="--truth-from sim: the vehicle offers neither"):
        where.check()


def test_the_path_flown_has_its_corners_where_the_vehicle_was() -> None:
    plan = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]])
    reached = {2: np.array([0.0, 1.0, 9.0]), 4: np.array([42.0, 43.0, 9.0])}
    flown = path_flown(plan, (2, 3, 4, 5), reached)
    assert flown.tolist() == [[0.0, 1.0], [41.0, 2.0], [42.0, 43.0], [2.0, 43.0]]
    assert path_flown(plan, (2, 3, 4, 5), {}) is plan


def test_odometry_is_of_the_body_and_in_the_frames_ardupilot_takes() -> None:
    feed = OdometryFeed(None, 1)  # type: ignore[arg-type]
    feed.hear(attitude(1000))
    first = feed.hear(sim_state(0.0, 0.0))
    assert (first.frame_id, first.child_frame_id, first.x, first.time_usec) == (20, 12, 0.0, 1_000_000)
    second = feed.hear(sim_state(3.0, 4.0, up_m=2.0))
    assert (second.x, second.y, second.z) == pytest.approx((4.0, 3.0, -2.0), abs=0.01)
    half = 0.5**0.5  # turned to the east: north is to the left
    assert to_body((1.0, 0.0, 0.0), (half, 0.0, 0.0, half)) == pytest.approx((0.0, -1.0, 0.0), abs=1e-9)


FLIGHTS = Path(__file__).parents[3] / "shared" / "data" / "flights"


@pytest.mark.parametrize("name", ["copter_flow_k2_static", "rover_gps_k2_static"])
def test_a_recorded_simulator_is_placed_where_its_readings_were_taken(name: str) -> None:
    """What ArduPilot's simulator sent, through us: the recorded readings are the field at the places we make of it."""
    log, told = FLIGHTS / f"{name}.tlog", FLIGHTS / f"{name}.truth.json"
    if not log.exists():
        pytest.skip(f"recorded flights are not here: {FLIGHTS}")
    truth = json.loads(told.read_text())
    where, off = Whereabouts(None, Home(*truth["home"])), []
    placed: tuple[int, Any] | None = None
    for message in (frame.message for frame in Parser().feed(log.read_bytes(), 0)):
        if (message.get_srcSystem(), message.get_srcComponent()) == (1, 1):
            placed = where.hear(message, settled=False) or placed
        elif message.get_type() == "NAMED_VALUE_FLOAT" and placed and placed[0] == message.time_boot_ms:
            off.append(message.value - field(truth, placed[1]))
    assert where.used == "sim"
    assert len(off) > 1000
    assert np.std(off) == pytest.approx(truth["noise_sd"], rel=0.1)
    assert abs(np.mean(off)) < 0.01


def field(truth: dict[str, Any], place_m: tuple[float, float, float]) -> float:
    c_m2 = truth["spread_sqrtC_m_at_start"] ** 2
    value = truth["medium"]["ambient"]
    for source in truth["sources"]:
        north_m, east_m = source["position_ned_m"]
        squared = (place_m[0] - east_m) ** 2 + (place_m[1] - north_m) ** 2
        value += source["amplitude"] / (math.pi * c_m2) * math.exp(-squared / c_m2)
    return float(value)
