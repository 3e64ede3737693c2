"""A whole flight through a bad air in simulated time: no sockets, no threads, the same every time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from fakes import mission

from dslam_mav.legs import FlownLeg, LegCollector, plan_facts
from dslam_mav.mav.decode import decode
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, COMPONENT_BRIDGE, Encoder, Frame, Parser
from dslam_mav.mission import leg_plan
from dslam_mav.records import Flight, Leg
from dslam_mav.records.arrays import Array
from sim_bridge.bridge import Bridge
from sim_bridge.fields.field import Field
from sim_bridge.loopback.autopilot import Autopilot
from sim_bridge.loopback.link_faults import Air, LinkFaults
from sim_bridge.sampling import Sampling
from sim_bridge.vehicle import DEFAULT_HOME

STEP_MS = 20
HEARD = ("LOCAL_POSITION_NED", "MISSION_CURRENT", "MISSION_ITEM_REACHED", "HEARTBEAT", "VFR_HUD")
MOST_MS = 300_000
BRIDGE, ONBOARD, IN, OUT = "bridge", "onboard", "in", "out"


@dataclass
class Hostile:
    """What the estimator's side heard, in order, and what truly happened: a corner's time, a reading's time on the
    vehicle's own clock by its time on the wire.
    """

    plan: Any
    frames: list[Frame] = field(default_factory=list)
    corner_ms: list[int] = field(default_factory=list)
    bridge: Any = None

    def collected(self) -> LegCollector:
        collector = LegCollector(plan_facts(self.plan))
        for frame in self.frames:
            observation = decode(frame, 1)
            if observation is not None:
                collector.add(observation)
        return collector

    def true_place(self, time_ms: Array) -> tuple[Array, Array]:
        """(leg, metres along it) at times of the vehicle's; it flies its legs at one speed."""
        corners = np.array(self.corner_ms, dtype=np.float64)
        leg = np.clip(np.searchsorted(corners, time_ms, side="right") - 1, 0, len(corners) - 2)
        lengths_m = leg_plan(self.plan).lengths_m
        share = (time_ms - corners[leg]) / (corners[leg + 1] - corners[leg])
        return leg, share * lengths_m[leg]

    def misplaced_m(self, legs: tuple[FlownLeg, ...], to_vehicle_ms: int = 0) -> Array:
        """How far each reading of `legs` is from where it was taken, along the path."""
        vertices = list(leg_plan(self.plan).sequence)
        starts_m = np.concatenate([[0.0], np.cumsum(leg_plan(self.plan).lengths_m)])
        errors = [np.empty(0)]
        for leg in legs:
            truly_on, truth_m = self.true_place(leg.time_ms + to_vehicle_ms)
            believed_m = starts_m[vertices.index(leg.start_seq)] + leg.distance_m
            errors.append(np.abs(believed_m - starts_m[truly_on] - truth_m))
        return np.concatenate(errors)

    def with_the_readings_of(self, legs: tuple[FlownLeg, ...], to_vehicle_ms: int = 0) -> Flight:
        """The flight as it truly was, read where and when these legs' readings were."""
        time_ms = np.concatenate([leg.time_ms + to_vehicle_ms for leg in legs])
        value = np.concatenate([leg.value for leg in legs])
        on, distance_m = self.true_place(time_ms)
        lengths_m = leg_plan(self.plan).lengths_m
        time_s = (time_ms - self.corner_ms[0]) / 1000.0
        used = range(int(on.min()), int(on.max()) + 1)
        return Flight(
            tuple(Leg(float(lengths_m[j]), distance_m[on == j], time_s[on == j], value[on == j]) for j in used)
        )


class _Wire:
    """What the bridge needs of a link, its packets going through the air."""

    def __init__(self, send: Any) -> None:
        self._send, self._encoder = send, Encoder(1, COMPONENT_BRIDGE)

    def send(self, message: Any) -> None:
        self._send(self._encoder.pack(message))


def fly(
    faults: LinkFaults,
    seed: int,
    corners: list[tuple[float, float]],
    sensed: Field,
    *,
    speed_m_s: float = 4.0,
    sampling: Sampling | None = None,
    noise_sd: float = 0.0,
) -> Hostile:
    """One flight; `sensed` is what the sensor reads."""
    plan = mission(corners, speed_m_s=speed_m_s)
    flown, air = Hostile(plan), Air(faults, seed)
    autopilot, encoder = Autopilot(DEFAULT_HOME, seed=seed), Encoder(1, 1)
    parsers = {(who, way): Parser() for who in (BRIDGE, ONBOARD) for way in (IN, OUT)}
    now_s, place_ms = 0.0, 0

    def send(who: str, way: str, raw: bytes) -> None:
        for piece in air.carry((who, way), raw, now_s):
            arrive(who, way, piece)

    def arrive(who: str, way: str, raw: bytes) -> None:
        for frame in parsers[who, way].feed(raw, round(now_s * 1e9)):
            source = frame.message.get_srcSystem(), frame.message.get_srcComponent()
            if (who, way) == (ONBOARD, OUT):
                flown.frames.append(frame)
            elif way == IN:
                send(ONBOARD, OUT, frame.raw)
            elif source == (1, COMPONENT_AUTOPILOT):
                bridge.hear(frame.message)

    flown.bridge = bridge = Bridge(
        _Wire(lambda raw: send(BRIDGE, IN, raw)),  # type: ignore[arg-type]
        1,
        sensed,
        sampling or Sampling(interval_s=0.05),
        leg_plan(plan).sequence,
        noise_sd=noise_sd,
        rng=np.random.default_rng(seed),
    )
    autopilot.set_items(plan.items)
    autopilot.arm()
    autopilot.start_mission()
    for time_ms in range(0, MOST_MS, STEP_MS):
        now_s = time_ms / 1000.0
        for out in autopilot.advance(time_ms):
            kind = out.message.get_type()
            if kind == "LOCAL_POSITION_NED":
                place_ms = out.message.time_boot_ms  # also told at every corner
            elif kind == "MISSION_ITEM_REACHED" and out.message.seq in leg_plan(plan).sequence:
                flown.corner_ms.append(place_ms)
            if kind not in HEARD:
                continue
            raw = encoder.pack(faults.stamped(out.message))
            for who in (BRIDGE, ONBOARD):
                send(who, OUT, raw)
        for (who, way), raw in air.due(now_s):
            arrive(who, way, raw)
        if len(flown.corner_ms) == len(corners) and time_ms > flown.corner_ms[-1] + 3000:
            break
    return flown
