"""The live loop over real sockets: what it logs, what it sends back, how it ends."""

from __future__ import annotations

import math
import threading
import time

import numpy as np
from aboard import PLAN, Vehicle, cut_short, run, stand_in
from flown import fly, heartbeat

from dslam_mav.legs import FlownLeg, PlanFacts
from dslam_mav.mav.frames import messages, parse_frame
from dslam_mav.records import Estimate, Flight
from dslam_mav.replay import flight_from_frames

M = messages()


def test_a_flight_ends_in_one_estimate_that_its_log_repeats_bit_for_bit(vehicle: Vehicle):
    flown = fly(late_ms=300)
    onboard, log, updates, raised = run(vehicle, flown.frames)
    assert raised is None
    assert [f.raw for f in flown.frames][: len(log.frames)] == [raw for _, raw in log.frames]
    assert len(log.readings) == len(flown.distance_m)
    *_, (final, legs_flown, is_final) = log.estimates
    assert (is_final, legs_flown, final) == (True, 4, onboard.result)
    again = flight_from_frames([parse_frame(raw, t) for t, raw in log.frames], "log", plan=PLAN, system=1)
    assert stand_in(again.flight).residual.tobytes() == final.residual.tobytes()
    assert [u.legs_flown for u in updates if u.estimate is None] == [1, 2, 3]
    assert updates[-1].final
    assert [p.seq for p in log.progressed if p.reached] == [1, 2, 3, 4, 5]


def test_estimates_come_after_every_leg_from_the_third_on(vehicle: Vehicle):
    flown = fly(late_ms=300)
    third = next(i for i, f in enumerate(flown.frames) if f.message.get_type() == "NAMED_VALUE_FLOAT"
                 and f.message.time_boot_ms > flown.corner_ms[3])  # fmt: skip
    frames = flown.frames

    original = vehicle.send

    def send(all_frames, pause_every=100):
        original(all_frames[: third + 1])
        time.sleep(0.5)
        original(all_frames[third + 1 :])

    vehicle.send = send
    _, log, _, _ = run(vehicle, frames)
    assert [(n, final) for _, n, final in log.estimates] == [(3, False), (4, True)]


def test_a_leg_without_readings_ends_the_legs_before_it_and_the_next_ones_count(vehicle: Vehicle):
    flown = fly([(20.0 * math.cos(k * 2.7), 20.0 * math.sin(k * 2.7)) for k in range(8)])
    silent = {t for t, (leg, _) in flown.distance_m.items() if leg == 1}
    frames = [
        f for f in flown.frames if f.message.get_type() != "NAMED_VALUE_FLOAT" or f.message.time_boot_ms not in silent
    ]
    plan = PlanFacts(tuple(range(1, 9)), tuple(flown.lengths_m))
    onboard, log, updates, raised = run(vehicle, frames, plan=plan)
    assert raised is None
    told = [(u.legs_flown, u.newest) for u in updates if u.estimate is None]
    assert told[-3:] == [(2, 4), (3, 5), (4, 6)]
    assert (updates[-1].legs_flown, updates[-1].newest, updates[-1].final) == (5, 7, True)
    assert log.estimates[-1] == (onboard.result, 5, True)
    assert "leg 2 of the mission has 0 readings: legs 3 to 7 are used, leg 1 here is its leg 3" in log.texts


def test_results_and_heartbeats_come_back_from_component_191(vehicle: Vehicle):
    onboard, _, _, _ = run(vehicle, fly().frames)
    time.sleep(0.1)
    values = {m.name: m.value for m in vehicle.of("NAMED_VALUE_FLOAT")}
    x = onboard.result.sources.position_m[0, 0]
    assert values == {
        "DSLAM_ST": 0.0, "SRC1_X": np.float32(x), "SRC1_Y": 2.0, "SRC2_X": 3.0, "SRC2_Y": 4.0,
        "SRC1_AMP": 200.0, "SRC2_AMP": 100.0, "SRC1_SD": np.float32(0.2), "SRC2_SD": np.float32(0.2),
    }  # fmt: skip
    assert {m.get_srcComponent() for m in vehicle.of("NAMED_VALUE_FLOAT")} == {191}
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in vehicle.of("HEARTBEAT")} == {(1, 191)}
    assert any("identified" in m.text for m in vehicle.of("STATUSTEXT"))


def test_a_slow_estimate_loses_no_frame(vehicle: Vehicle):
    def slow(flight: Flight, legs: tuple[FlownLeg, ...]) -> Estimate:
        time.sleep(0.4)
        return stand_in(flight)

    flown = fly(reading_ms=10, position_ms=20)
    _, log, _, raised = run(vehicle, flown.frames, estimate=slow)
    assert raised is None
    assert len(log.readings) == len(flown.distance_m)


def test_stop_ends_the_flight_with_an_estimate_of_what_there_is(vehicle: Vehicle):
    flown = fly()
    stop = threading.Event()
    threading.Timer(1.0, stop.set).start()
    _, log, _, raised = run(vehicle, cut_short(flown), stop=stop, lost_s=60.0)
    assert raised is None
    assert log.estimates[-1][1:] == (3, True)


def test_a_flight_without_a_plan_ends_when_the_vehicle_disarms(vehicle: Vehicle):
    _, log, _, raised = run(vehicle, fly(late_ms=100).frames, plan=None)
    assert raised is None
    assert log.estimates[-1][1:] == (4, True)


def test_a_silent_autopilot_is_asked_for_its_streams(vehicle: Vehicle):
    stop = threading.Event()
    threading.Timer(2.6, stop.set).start()
    run(vehicle, [heartbeat(1)], stop=stop)
    asked = {int(m.param1): m.param2 for m in vehicle.of("COMMAND_LONG") if m.command == M.MAV_CMD_SET_MESSAGE_INTERVAL}
    assert asked[M.MAVLINK_MSG_ID_LOCAL_POSITION_NED] == 50_000
    assert M.MAVLINK_MSG_ID_MISSION_CURRENT in asked
    assert M.MAVLINK_MSG_ID_ATTITUDE not in asked


def test_flight_and_legs_of_an_estimate_are_one_snapshot(vehicle: Vehicle):
    seen = []

    def slow(flight: Flight, legs: tuple[FlownLeg, ...]) -> Estimate:
        time.sleep(0.3)
        seen.append([leg.time_ms.size for leg in legs] == [leg.time_s.size for leg in flight.legs])
        return stand_in(flight)

    run(vehicle, fly(late_ms=300).frames, estimate=slow)
    assert seen
    assert all(seen)
