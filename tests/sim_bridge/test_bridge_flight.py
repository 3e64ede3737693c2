"""The bridge in a whole flight: scene, loopback vehicle, real sockets, a listener on the ground."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from dslam_mav.mav.frames import COMPONENT_BRIDGE, COMPONENT_GROUND, SYSTEM_GROUND, Frame
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.start import start
from dslam_mav.mav.mission.transfer import upload
from dslam_mav.mission import leg_plan
from missions.plan import Profile, plan_mission
from sim_bridge.bridge import Bridge
from sim_bridge.fields.scene import Scene, SceneField, read_scene, simulate
from sim_bridge.sampling import Sampling
from sim_bridge.vehicle import DEFAULT_HOME, Vehicle

DEMO = Path(__file__).parents[2] / "sim_bridge" / "scenes" / "star7_three_sources.json"


@contextmanager
def vehicle_on(**options: float) -> Iterator[str]:
    """A loopback vehicle of its own, and the URL to reach it at."""
    stop = threading.Event()
    with Vehicle(["udpin:127.0.0.1:0"], **options) as vehicle:  # type: ignore[arg-type]
        url = vehicle.urls[0].replace("udpin", "udpout")
        thread = threading.Thread(target=vehicle.run, args=(stop,))
        thread.start()
        try:
            yield url
        finally:
            stop.set()
            thread.join()


def flown(scene: Scene, seed: int) -> tuple[np.ndarray, np.ndarray, Bridge, np.ndarray]:
    """(times ms, values, the bridge, vertices) of the scene's own path flown over loopback."""
    mission = plan_mission(scene.vertices(), DEFAULT_HOME, Profile(speed_m_s=scene.sampling.speed_m_s, hold_s=0.0))
    plan = leg_plan(mission)
    with vehicle_on(speedup=30.0) as url:
        ground = Link(url, system=SYSTEM_GROUND, component=COMPONENT_GROUND)
        link = Link(url, system=1, component=COMPONENT_BRIDGE)
        with ground, link:
            system = wait_for_vehicle(ground, 5.0)
            upload(ground, system, mission)
            bridge = Bridge(
                link,
                system,
                SceneField(scene),
                Sampling(scene.sampling.spacing_m),
                plan.sequence,
                noise_sd=scene.noise_sd(plan.vertices_m),
                rng=np.random.default_rng(seed),
            )
            wait_for_vehicle(link, 5.0)
            thread = threading.Thread(target=bridge.run, args=(threading.Event(),))
            thread.start()
            start(ground, system)
            thread.join(30.0)
            assert not thread.is_alive()
            heard = _readings(ground)
    times = np.array([f.message.time_boot_ms for f in heard], dtype=np.int64)
    return times, np.array([f.message.value for f in heard]), bridge, plan.vertices_m


def _readings(link: Link) -> list[Frame]:
    """All readings heard so far, and those on their way: half a second more."""
    frames = []
    end_s = time.monotonic() + 0.5
    while (frame := link.receive(0.1)) is not None and time.monotonic() < end_s:
        if frame.message.get_type() == "NAMED_VALUE_FLOAT":
            assert frame.message.name == "THERMAL"
            assert (frame.message.get_srcSystem(), frame.message.get_srcComponent()) == (1, 158)
            frames.append(frame)
    return frames


@pytest.mark.timeout(60)
def test_a_flight_reads_what_the_scene_says_and_repeats_bit_for_bit() -> None:
    scene = read_scene(DEMO)
    times, values, bridge, vertices = flown(scene, seed=3)
    assert bridge.sent == len(values)
    assert (bridge.missing, bridge.sampler.skipped) == (0, 0)

    flight = simulate(scene, vertices, np.random.default_rng(3))
    assert abs(len(values) - flight.n_readings) <= len(flight.legs)  # a corner's millisecond either way
    first, last_of_star = times[0], times[-1] - times[0]
    assert last_of_star == pytest.approx(flight.lengths_m.sum() / 5.0 * 1e3, abs=200)

    # the plan's corners are rounded to 1e-7 degrees, so leg 1 may differ by a centimetre and a reading
    n = 64
    place_m = vertices[0] + np.arange(n)[:, None] * 0.5 * np.array([[1.0, 0.0]])
    clean = SceneField(scene).read(np.zeros(n), place_m)
    noise = scene.noise_sd(vertices) * np.random.default_rng(3).standard_normal(n)
    np.testing.assert_allclose(values[:n] - noise, clean, atol=1e-3)
    np.testing.assert_allclose((times[:n] - first) / 1e3, np.arange(n) * 0.1, atol=1e-3)

    again = flown(scene, seed=3)
    np.testing.assert_array_equal(times - times[0], again[0] - again[0][0])
    np.testing.assert_array_equal(values, again[1])
