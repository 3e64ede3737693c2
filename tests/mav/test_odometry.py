"""ODOMETRY of where an anchored answer has the vehicle: right, only when asked for, and not beside somebody else's."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from aboard import Vehicle, run, stand_in
from flown import STAR, Flown, fly, pack

from dslam_mav.legs import FlownLeg
from dslam_mav.mav.frames import Frame, messages
from dslam_mav.mav.odometry import FAILED, LOCAL_FRD, OdometryOut, quaternion, to_body
from dslam_mav.records import Estimate, Flight, Leg, Path, Verdict

M = messages()
HEADING_RAD = {seq: math.atan2(b[0] - a[0], b[1] - a[1]) for seq, (a, b) in enumerate(pairwise(STAR), 1)}


def with_attitude(flown: Flown) -> list[Frame]:
    """Its nose along the way, before each position; the frame of its dead reckoning is turned and shifted."""
    frames, seq = [], 1
    for frame in flown.frames:
        message = frame.message
        if message.get_type() == "MISSION_ITEM_REACHED":
            seq = message.seq
        if message.get_type() == "LOCAL_POSITION_NED":
            yaw = 0.5 * math.pi - HEADING_RAD.get(seq, 0.0)
            frames.append(pack(M.MAVLink_attitude_message(message.time_boot_ms, 0, 0, yaw, 0, 0, 0), frame.received_ns))
            turned = M.MAVLink_local_position_ned_message(
                message.time_boot_ms, 7.0 - message.y, message.x - 3.0, -10.0, -message.vy, message.vx, 0.5
            )
            frame = pack(turned, frame.received_ns)  # noqa: PLW2901
        frames.append(frame)
    return frames


def anchored(flight: Flight, legs: tuple[FlownLeg, ...]) -> Estimate:
    """An answer that has the path where it is, east and north of home."""
    path = np.array(STAR)[: len(legs) + 1, ::-1]
    return replace(stand_in(flight), gauge="anchored", path=Path(path, np.zeros(len(legs))))


def sent(vehicle: Vehicle, frames: list[Frame], estimate=anchored, planned=HEADING_RAD) -> tuple[list, list[str]]:
    """The ODOMETRY of a flight whose last leg is flown slowly enough for an estimate, and what was logged in words."""
    original = vehicle.send
    cut = next(i for i, f in enumerate(frames) if f.message.get_type() == "MISSION_ITEM_REACHED" and f.message.seq == 4)

    def send(all_frames: list[Frame], pause_every: int = 100) -> None:
        original(all_frames[: cut + 60])
        time.sleep(0.5)
        original(all_frames[cut + 60 :])

    vehicle.send = send
    _, log, _, raised = run(vehicle, frames, estimate=estimate, odometry=OdometryOut(1, 191, planned, LOCAL_FRD))
    assert raised is None
    return vehicle.of("ODOMETRY"), log.texts


def true_place(flown: Flown, time_ms: int) -> np.ndarray:
    """North and east."""
    return np.array([np.interp(time_ms, flown.corner_ms, axis) for axis in np.array(STAR).T])


@pytest.mark.parametrize("planned", [HEADING_RAD, None])
def test_it_says_where_the_vehicle_is_in_the_frames_ardupilot_takes(vehicle: Vehicle, planned):
    flown = fly(late_ms=100)
    odometry, _ = sent(vehicle, with_attitude(flown), planned=planned)
    assert len(odometry) > 30
    assert {(m.get_srcSystem(), m.get_srcComponent(), m.frame_id, m.child_frame_id) for m in odometry} == {
        (1, 191, 20, 12)
    }
    odometry = [m for m in odometry if m.time_usec // 1000 <= flown.corner_ms[-1]]
    at_ms = np.array([m.time_usec // 1000 for m in odometry])
    assert np.diff(at_ms).max() <= 100, "10 Hz"
    for m, t in zip(odometry, at_ms, strict=True):
        assert (m.x, m.y) == pytest.approx(true_place(flown, t), abs=0.05)
        assert (m.z, m.quality) == (-10.0, 100)
    speed = [m.vx for m in odometry if m.time_usec // 1000 < flown.corner_ms[-1] - 500]
    assert speed == pytest.approx([4.0] * len(speed), abs=0.05), "forward"


def test_none_is_sent_before_there_is_an_anchored_answer(vehicle: Vehicle):
    odometry, _ = sent(vehicle, with_attitude(fly(late_ms=100)), estimate=stand_in)
    assert odometry == []


def test_none_is_sent_while_somebody_else_sends_some(vehicle: Vehicle):
    frames = with_attitude(fly(late_ms=100))
    other = M.MAVLink_vision_position_estimate_message(1, 0, 0, 0, 0, 0, 0)
    frames = [part for f in frames for part in (f, *([pack(other, f.received_ns, 1, 197)] if f.raw[7] == 32 else []))]
    odometry, said = sent(vehicle, frames)
    assert odometry == []
    assert said.count("somebody else tells the vehicle where it is: no ODOMETRY is sent") == 1


def test_every_answer_is_a_new_reset_counter_and_quality_follows_the_verdict():
    out = OdometryOut(1, 191, {1: 0.0}, LOCAL_FRD)
    none = np.zeros(0)
    leg = FlownLeg(0, 1, 0, 10, 30.0, none, none.astype(np.int64), none, "odometry")
    flight = Flight((Leg(30.0, none, none, none),))
    place = M.MAVLink_local_position_ned_message(1000, 5, 6, -10, 1, 0, 0)
    out.hear(pack(M.MAVLink_attitude_message(1000, 0, 0, 0, 0, 0, 0), 0).message, (1, 10), 0.0)
    told = []
    for verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS, Verdict.MODEL_MISFIT, Verdict.NOT_CONVERGED):
        path = Path(np.array([[0.0, 0.0], [30.0, 0.0]]), np.zeros(1))
        answer = replace(stand_in(flight), gauge="anchored", verdict=verdict, path=path)
        out.answered(answer, (leg,))
        m = out.hear(pack(place, 0).message, (1, 10), 0.0)
        told.append((m.reset_counter, m.quality, m.x, m.y))
    assert told == [(1, 100, 0.0, 30.0), (2, 50, 0.0, 30.0), (3, 25, 0.0, 30.0), (3, FAILED, 0.0, 30.0)]


def test_attitudes_as_quaternions_turn_vectors_as_the_body_does():
    assert to_body((1.0, 0.0, 0.0), quaternion((0.0, 0.0, 0.5 * math.pi))) == pytest.approx((0.0, -1.0, 0.0), abs=1e-9)
    assert to_body((0.0, 0.0, 1.0), quaternion((0.5 * math.pi, 0.0, 0.0))) == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)
    assert to_body((1.0, 0.0, 0.0), quaternion((0.0, 0.5 * math.pi, 0.0))) == pytest.approx((0.0, 0.0, 1.0), abs=1e-9)
