"""Legs as a copter with inertia flies them, beside ideal ones: `python -m tests.bench.accelerations [--scenes N]`.

Random scenes on the star {7/3}, flown by the loopback vehicle without its sockets, once to the letter and once with
ArduPilot's accelerations, overshoot and holds at corners; the readings' rate and noise are the same, the bridge, the
gate and the collector those of a flight. Headings and the ambient level are not told. Lengths are in √C.
"""

from __future__ import annotations

import argparse
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from fakes import mission
from random_scenes import matched_error_m, random_places

from dslam_mav import Medium, estimate
from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.field import field
from dslam_mav.dslam.warm import warm_up
from dslam_mav.legs import LegCollector, plan_facts
from dslam_mav.mav.decode import decode
from dslam_mav.mav.frames import Encoder, Frame, messages, parse_frame
from dslam_mav.mav.mission.suit import suited
from dslam_mav.mav.profile import profile_named
from dslam_mav.mission import Mission, leg_plan, with_home_item
from dslam_mav.records.arrays import Array
from missions.patterns import star
from sim_bridge.bridge import Bridge
from sim_bridge.loopback.autopilot import Autopilot
from sim_bridge.loopback.manners import manners
from sim_bridge.sampling import Sampling
from sim_bridge.vehicle import DEFAULT_HOME

SPREAD_M = 12.5
LEG_M = 3.2 * SPREAD_M
SPEED_M_S = 5.0
INTERVAL_S = 0.05
AMBIENT = 20.0
QUADROTOR = 2
STEP_MS, READY_MS, MOST_MS = 50, 60_000, 400_000
STREAMS = ("LOCAL_POSITION_NED", "MISSION_CURRENT", "HEARTBEAT", "ATTITUDE")
ROWS = ((2, 20.0), (2, 40.0), (3, 20.0), (3, 40.0))


class Scene:
    """K random sources about the middle of the star; `read` is what a sensor reads of them."""

    def __init__(self, seed: int, k_sources: int, vertices_m: Array) -> None:
        rng = np.random.default_rng((seed, k_sources))
        self.places_m = vertices_m[:-1].mean(axis=0) + SPREAD_M * random_places(rng, k_sources)
        self.amplitudes = SPREAD_M**2 * 50.0 * 4.0 ** rng.random(k_sources)

    def read(self, time_s: Array, place_m: Array) -> Array:
        """Readings (M,) at places (M, 3)."""
        spread2 = np.full((len(time_s), len(self.amplitudes)), SPREAD_M**2)
        return AMBIENT + field(place_m[:, :2], spread2, self.places_m, self.amplitudes)

    def noise_sd(self, vertices_m: Array, snr_db: float) -> float:
        """Of a reading, for this ratio to the mean square of what the ideal path reads."""
        shares = np.arange(0.0, 1.0, SPEED_M_S * INTERVAL_S / LEG_M)[:, None]
        legs = pairwise(vertices_m)
        read = np.concatenate([self.read(shares[:, 0], a + shares * (b - a)) for a, b in legs]) - AMBIENT
        return float(np.sqrt(np.mean(read**2) / 10.0 ** (snr_db / 10.0)))


class Wire:
    """What the bridge needs of a link."""

    def __init__(self, frames: list[Frame]) -> None:
        self._frames, self._encoder = frames, Encoder(1, 158)

    def send(self, message: Any) -> None:
        """A reading, on its way."""
        _hear(self._frames, self._encoder.pack(message))


def _hear(frames: list[Frame], raw: bytes) -> None:
    frame = parse_frame(raw, 0)
    assert frame is not None
    frames.append(frame)


def fly(plan: Mission, scene: Scene, noise_sd: float, seed: int, profile: str) -> tuple[LegCollector, Array]:
    """What was collected on a flight, and where the vehicle truly was when its corners were reached (V, 2)."""
    autopilot = Autopilot(DEFAULT_HOME, seed=seed, manners=manners(profile))
    if profile != "strict":
        plan, _ = suited(with_home_item(plan), profile_named(profile), QUADROTOR)
    frames: list[Frame] = []
    sequence = leg_plan(plan).sequence
    bridge = Bridge(
        Wire(frames), 1, scene, Sampling(interval_s=INTERVAL_S), sequence,  # type: ignore[arg-type]
        noise_sd=noise_sd, rng=np.random.default_rng(seed),
    )  # fmt: skip
    autopilot.set_items(plan.items)
    for name in STREAMS:
        autopilot.streams.set_interval("us", getattr(messages(), f"MAVLINK_MSG_ID_{name}"), STEP_MS, 0)
    autopilot.advance(READY_MS)
    autopilot.guided = True
    assert autopilot.arm() == ""
    autopilot.start_mission()
    encoder, corners = Encoder(1, 1), {}
    for time_ms in range(READY_MS, MOST_MS, STEP_MS):
        for out in autopilot.advance(time_ms):
            _hear(frames, encoder.pack(out.message))
            bridge.hear(frames[-1].message)
            if out.message.get_type() == "LOCAL_POSITION_NED":
                place = out.message.y, out.message.x
            elif out.message.get_type() == "MISSION_ITEM_REACHED" and out.message.seq in sequence:
                corners.setdefault(out.message.seq, place)  # PX4 says so again
        if len(corners) == len(sequence):
            break
    collector = LegCollector(plan_facts(plan))
    seen = (decode(frame, 1) for frame in frames)
    collector.add_all(observation for observation in seen if observation is not None)
    return collector, np.array(list(corners.values()))


def error_of(plan: Mission, scene: Scene, noise_sd: float, seed: int, profile: str) -> float:
    """RMS source error in √C of one flight, in the gauge of its first leg as flown."""
    collector, corners_m = fly(plan, scene, noise_sd, seed, profile)
    medium = Medium(spread_m=SPREAD_M, static=True, ambient=None)
    result = estimate(collector.flight(final=True), medium, len(scene.amplitudes))
    error_m = matched_error_m(result, to_canonical(corners_m).apply(scene.places_m))
    return error_m / SPREAD_M if np.isfinite(error_m) else np.inf


def main() -> None:
    """A row for every number of sources and noise."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenes", type=int, default=40)
    parser.add_argument("--profile", default="ardupilot", choices=("ardupilot", "px4"))
    options = parser.parse_args()
    warm_up()
    print(f"{options.scenes} random scenes a row, star {{7/3}}, headings and ambient unknown: source error in √C,")
    print(f"median / 90 %, on ideal legs and on those of --profile {options.profile}")
    print("K  dB   ideal legs      as flown        ratio of medians, median of ratios")
    vertices_m = star(7, 3, LEG_M)
    plan = mission([(float(e), float(n)) for e, n in vertices_m], speed_m_s=SPEED_M_S)
    for k_sources, snr_db in ROWS:
        errors = []
        for seed in range(options.scenes):
            scene = Scene(seed, k_sources, vertices_m)
            noise_sd = scene.noise_sd(vertices_m, snr_db)
            errors.append([error_of(plan, scene, noise_sd, seed, flown) for flown in ("strict", options.profile)])
        (ideal, flown), worst = np.median(errors, axis=0), np.percentile(errors, 90, axis=0)
        print(
            f"{k_sources}  {snr_db:.0f}   {ideal:.4f} / {worst[0]:.3f}  {flown:.4f} / {worst[1]:.3f}  "
            f"{flown / ideal:.2f}  {np.median([b / a for a, b in errors]):.2f}", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    main()
