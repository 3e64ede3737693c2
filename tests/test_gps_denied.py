"""GPS-denied by construction: what an estimate must not see is scrambled, and the flight stays the same.

What legs and the estimator may import at all is in test_arrows.py.
Turned, mirrored and shifted leg by leg means: the frame changes whenever MISSION_ITEM_REACHED comes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flown import STAR, fly, pack, repack

from dslam_mav.assumed import estimator
from dslam_mav.assumptions import Assumptions
from dslam_mav.legs import Distance, PlanFacts, plan_facts, plan_headings_rad
from dslam_mav.log.codec import encode_update
from dslam_mav.mav.frames import Frame, messages
from dslam_mav.mav.tlog import read_tlog
from dslam_mav.mission import Home, Mission, MissionItem, enu_to_e7
from dslam_mav.records import Flight
from dslam_mav.replay import flight_from_frames

COPTER = Path(__file__).parents[2] / "shared" / "data" / "flights" / "copter_flow_k2_static.tlog"
ALLOWED = {
    "NAMED_VALUE_FLOAT": {"time_boot_ms", "name", "value"},
    "MISSION_CURRENT": {"seq"},
    "MISSION_ITEM_REACHED": {"seq"},
    "LOCAL_POSITION_NED": {"time_boot_ms", "x", "y", "vx", "vy"},
    "VFR_HUD": {"groundspeed"},
}
_RANGES = {
    "uint8_t": (0, 255), "int8_t": (-128, 127), "uint16_t": (0, 65535), "int16_t": (-32768, 32767),
    "uint32_t": (0, 2**32 - 1), "int32_t": (-(2**31), 2**31 - 1),
    "uint64_t": (0, 2**62), "int64_t": (-(2**62), 2**62),
}  # fmt: skip

Turn = Callable[[float, float], tuple[float, float]]
EXACT: list[Turn] = [
    lambda x, y: (x, y),
    lambda x, y: (-y, x),
    lambda x, y: (-x, -y),
    lambda x, y: (y, -x),
    lambda x, y: (-x, y),
    lambda x, y: (x, -y),
    lambda x, y: (y, x),
    lambda x, y: (-y, -x),
]


def synthetic() -> list[Frame]:
    """With every kind of forbidden message added."""
    frames = []
    m = messages()
    for f in fly(hold_ms=400).frames:
        frames.append(f)
        if f.message.get_type() == "LOCAL_POSITION_NED":
            t = f.message.time_boot_ms
            for extra in (
                m.MAVLink_global_position_int_message(t, 473000000, 85000000, 1, 1, 0, 0, 0, 9000),
                m.MAVLink_gps_raw_int_message(1000 * t, 3, 473000000, 85000000, 1, 1, 1, 0, 0, 9),
                m.MAVLink_attitude_message(t, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
                m.MAVLink_nav_controller_output_message(0.0, 0.0, 90, 90, 12, 0.0, 0.0, 0.0),
            ):
                frames.append(pack(extra, f.received_ns))
    return frames


def recorded() -> list[Frame]:
    if not COPTER.exists():
        pytest.skip(f"{COPTER} is not there")
    return list(read_tlog(COPTER))


@pytest.fixture(scope="module", params=[synthetic, recorded], ids=["synthetic", "ArduCopter"])
def frames(request: pytest.FixtureRequest) -> list[Frame]:
    return request.param()


def flight_of(frames: list[Frame], **options: Any) -> Flight:
    return flight_from_frames(frames, "test", system=1, **options).flight


def assert_same(a: Flight, b: Flight, tolerance_m: float = 0.0) -> None:
    assert len(a.legs) == len(b.legs) >= 4
    for p, q in zip(a.legs, b.legs, strict=True):
        assert p.time_s.tobytes() == q.time_s.tobytes()
        assert p.reading.tobytes() == q.reading.tobytes()
        if tolerance_m:
            assert np.abs(p.distance_m - q.distance_m).max() < tolerance_m
            assert abs(p.length_m - q.length_m) < tolerance_m
        else:
            assert p.distance_m.tobytes() == q.distance_m.tobytes()
            assert p.length_m == q.length_m


def scrambled(frame: Frame, rng: np.random.Generator) -> Frame:
    """Every number that is not allowed is another one."""
    message = frame.message
    kind = message.get_type()
    allowed = ALLOWED.get(kind, set())
    if kind == "NAMED_VALUE_FLOAT" and not message.name.startswith("THERMAL"):
        allowed = {"name"}
    changed: dict[str, Any] = {}
    for name, wire in zip(message.fieldnames, message.fieldtypes, strict=True):
        old = getattr(message, name)
        if name in allowed or isinstance(old, str | bytes | list):
            continue
        if wire in ("float", "double"):
            changed[name] = float(np.float32(rng.normal(0.0, 100.0)))
        elif wire in _RANGES:
            changed[name] = int(rng.integers(*_RANGES[wire], endpoint=True))
    return repack(frame, **changed)


def moved(frames: list[Frame], place: Callable[[int, float, float], Any], turn: Callable[[int], Turn]) -> list[Frame]:
    """Dead reckoning in a frame per leg: positions by `place`, velocities by `turn` of the leg's number."""
    leg, out = 0, []
    for frame in frames:
        m = frame.message
        if m.get_type() == "MISSION_ITEM_REACHED":
            leg += 1
        if m.get_type() == "LOCAL_POSITION_NED":
            x, y = place(leg, m.x, m.y)
            vx, vy = turn(leg)(m.vx, m.vy)
            out.append(repack(frame, x=x, y=y, vx=vx, vy=vy))
        else:
            out.append(frame)
    return out


@pytest.mark.parametrize("distance", ["odometry", "speed"])
def test_fields_nobody_may_see_change_nothing(frames: list[Frame], distance: Distance):
    rng = np.random.default_rng(1)
    other = [scrambled(f, rng) for f in frames]
    kinds = {f.message.get_type() for f, g in zip(frames, other, strict=True) if f.raw != g.raw}
    assert {"GLOBAL_POSITION_INT", "ATTITUDE", "LOCAL_POSITION_NED", "VFR_HUD"} <= kinds
    assert_same(flight_of(frames, distance=distance), flight_of(other, distance=distance))


def test_leaving_out_everything_else_changes_nothing(frames: list[Frame]):
    assert_same(flight_of(frames), flight_of([f for f in frames if f.message.get_type() in ALLOWED]))


@pytest.mark.parametrize("distance", ["odometry", "speed"])
@pytest.mark.parametrize("offset", range(1, 8))
def test_quarter_turns_mirrors_and_exchanged_axes_leg_by_leg_change_no_bit(frames, distance, offset):
    def turn(leg: int) -> Turn:
        return EXACT[(3 * leg + offset) % 8]

    other = moved(frames, lambda leg, x, y: turn(leg)(x, y), turn)
    assert_same(flight_of(frames, distance=distance), flight_of(other, distance=distance))


def test_shifts_leg_by_leg_change_no_bit(frames: list[Frame]):
    rng = np.random.default_rng(2)
    shift = rng.integers(-4000, 4000, (50, 2))

    def coarse(value: float) -> float:
        return round(value * 1024) / 1024  # so that float32 holds the shifted position as exactly

    base = moved(frames, lambda _, x, y: (coarse(x), coarse(y)), lambda _: EXACT[0])
    other = moved(base, lambda leg, x, y: (x + shift[leg, 0], y + shift[leg, 1]), lambda _: EXACT[0])
    assert_same(flight_of(base), flight_of(other))


def test_any_turn_leg_by_leg_changes_no_more_than_float32_does(frames: list[Frame]):
    angles = np.random.default_rng(3).uniform(0.0, 2.0 * math.pi, 50)

    def turn(leg: int) -> Turn:
        c, s = math.cos(angles[leg]), math.sin(angles[leg])
        return lambda x, y: (c * x - s * y, s * x + c * y)

    other = moved(frames, lambda leg, x, y: turn(leg)(x, y), turn)
    assert_same(flight_of(frames), flight_of(other), tolerance_m=2e-5)
    assert_same(flight_of(frames, distance="speed"), flight_of(other, distance="speed"), tolerance_m=2e-4)


def mission(vertices_m: list[tuple[float, float]], home: Home = Home(47.3, 8.5)) -> Mission:  # noqa: B008
    nan = math.nan
    takeoff = MissionItem(22, 3, (0.0, 0.0, 0.0, nan), 0, 0, 10.0)
    corners = [MissionItem(16, 3, (1.0, 0.0, 0.0, nan), *enu_to_e7(e, n, home), 10.0) for n, e in vertices_m]
    return Mission((takeoff, *corners), home)


def test_the_plans_directions_change_nothing():
    frames = synthetic()
    flown = plan_facts(mission(STAR))
    east = [0.0, *np.cumsum(flown.lengths_m)]
    straight = plan_facts(mission([(0.0, e) for e in east]))  # as long, all eastwards
    assert straight.lengths_m == pytest.approx(flown.lengths_m, abs=0.03)
    assert straight.vertices == flown.vertices == (1, 2, 3, 4, 5)
    assert_same(flight_of(frames, plan=flown), flight_of(frames, plan=straight))
    assert_same(flight_of(frames), flight_of(frames, plan=flown))
    # the wire rounds places to a centimetre, so lengths by the plan are as equal as that
    a, b = (flight_of(frames, plan=p, distance="plan") for p in (flown, straight))
    assert_same(a, b, tolerance_m=0.03)


@pytest.mark.parametrize("distance", [None, "plan"])
def test_the_plans_directions_change_no_bit_of_the_answer(distance):
    """Through everything that is given a mission: the collector its facts, the estimator the mission itself."""
    home = Home(0.0, 0.0)  # where places turned by 180° are as far apart to the last bit
    turned = [mission([(s * (n + 50.0), s * e) for n, e in STAR], home) for s in (1, -1)]
    assert plan_facts(turned[0]) == plan_facts(turned[1])
    headings = [plan_headings_rad(m)[(1, 2)] for m in turned]
    assert abs(headings[0] - headings[1]) == pytest.approx(math.pi)
    assumptions = Assumptions(n_sources=1, ambient=20.0, distance=distance)
    bends = mission([(7.0 * k + 1.0, 3.0 * k * k) for k in range(len(STAR))], home)
    answers = []
    for other in (*turned, bends):
        facts = plan_facts(other if other is not bends else turned[0])
        flight = flight_from_frames(synthetic(), "test", system=1, plan=facts, distance=distance)
        result = estimator(assumptions, flight.collector, other)(flight.flight, flight.legs)
        answers.append(encode_update(result, len(flight.legs), True).SerializeToString(deterministic=True))
    assert result.gauge == "canonical"
    assert len(answers[0]) > 100
    assert answers[0] == answers[1] == answers[2]


def test_plan_facts_are_vertices_and_lengths():
    facts = plan_facts(mission(STAR))
    assert facts.lengths_m == pytest.approx(np.hypot(*np.diff(STAR, axis=0).T), abs=0.02)
    assert set(PlanFacts.__slots__) == {"vertices", "lengths_m"}
    heading = plan_headings_rad(mission(STAR))[(1, 2)]
    assert heading == pytest.approx(math.atan2(30.0, 6.0), abs=1e-3)
