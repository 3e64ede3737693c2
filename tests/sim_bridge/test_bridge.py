from __future__ import annotations

import math
import threading
import time

import numpy as np
import pytest

from dslam_mav.errors import BadInputError, LinkError
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, COMPONENT_BRIDGE, Frame, messages
from dslam_mav.mav.link import Link
from dslam_mav.mav.readings import from_message
from sim_bridge.bridge import Bridge
from sim_bridge.fields.field import Array
from sim_bridge.sampling import Sampling

SYSTEM = 7


class Slope:
    """Reads 20 + east + 100 north + 10 up, and nothing beyond 8 m east."""

    def read(self, time_s: Array, place_m: Array) -> Array:
        value = 20.0 + place_m @ np.array([1.0, 100.0, 10.0])
        return np.where(place_m[:, 0] > 8.0, np.nan, value)


def peers() -> tuple[Link, Link]:
    """A vehicle's end and a bridge's end of one real connection, the bridge heard already."""
    vehicle = Link("udpin:127.0.0.1:0", system=SYSTEM, component=COMPONENT_AUTOPILOT)
    bridge = Link(vehicle.url.replace("udpin", "udpout"), system=SYSTEM, component=COMPONENT_BRIDGE)
    bridge.send_heartbeat()
    assert vehicle.receive(5.0) is not None
    return vehicle, bridge


def fly(vehicle: Link) -> None:
    """10 m east in 10 s, 2 m north of home and 3 m up."""
    m = messages()
    for i in range(101):
        east = 0.1 * i
        vehicle.send(m.MAVLink_local_position_ned_message(1000 + 100 * i, 2.0, east, -3.0, 0, 1, 0))
        if i == 0:
            vehicle.send(m.MAVLink_mission_item_reached_message(1))
    vehicle.send(m.MAVLink_mission_item_reached_message(2))
    vehicle.send(m.MAVLink_local_position_ned_message(12000, 2.0, 20.0, -3.0, 0, 1, 0))


def heard(vehicle: Link) -> list[Frame]:
    frames = []
    while (frame := vehicle.receive(0.3)) is not None:
        frames.append(frame)
    return frames


def run(noise_sd: float = 0.0, seed: int = 0) -> tuple[Bridge, list[Frame]]:
    vehicle, link = peers()
    with vehicle, link:
        bridge = Bridge(
            link,
            SYSTEM,
            Slope(),
            Sampling(spacing_m=0.5),
            (1, 2),
            noise_sd=noise_sd,
            rng=np.random.default_rng(seed),
        )
        thread = threading.Thread(target=bridge.run, args=(threading.Event(),))
        thread.start()
        fly(vehicle)
        thread.join(10.0)
        assert not thread.is_alive()
        return bridge, heard(vehicle)


def test_readings_are_injected_as_a_sensor_on_the_vehicle_would() -> None:
    bridge, frames = run()
    readings = [f for f in frames if f.message.get_type() == "NAMED_VALUE_FLOAT"]
    assert {(f.message.get_srcSystem(), f.message.get_srcComponent()) for f in readings} == {(SYSTEM, 158)}
    got = [from_message(f.message) for f in readings]
    assert [r.time_boot_ms for r in got if r] == list(range(1000, 9001, 500))  # 0, 0.5, … 8 m at 1 m/s
    expected = [20.0 + 0.5 * n + 200.0 + 30.0 for n in range(17)]
    assert [r.value for r in got if r] == pytest.approx(expected, rel=2.0**-23)
    assert {r.name for r in got if r} == {"THERMAL"}
    assert (bridge.sent, bridge.missing, bridge.sampler.skipped) == (17, 3, 0)


def test_noise_is_repeatable_by_seed() -> None:
    def values(seed: int) -> list[float]:
        return [f.message.value for f in run(0.5, seed)[1] if f.message.get_type() == "NAMED_VALUE_FLOAT"]

    first, again, other, clean = values(1), values(1), values(2), 250.0 + 0.5 * np.arange(17)
    assert first == again
    assert first != other
    drawn = np.random.default_rng(1).standard_normal(17)
    assert first == pytest.approx(list(clean + 0.5 * drawn), rel=2.0**-22)


def test_the_bridge_beats_and_ends_when_told() -> None:
    vehicle, link = peers()
    with vehicle, link:
        stop = threading.Event()
        bridge = Bridge(link, SYSTEM, Slope(), Sampling(spacing_m=0.5), (1, 2))
        thread = threading.Thread(target=bridge.run, args=(stop,))
        thread.start()
        end_s = time.monotonic() + 2.5
        beats = 0
        while time.monotonic() < end_s:
            frame = vehicle.receive(0.1)
            beats += frame is not None and frame.message.get_type() == "HEARTBEAT"
        stop.set()
        thread.join(2.0)
        assert not thread.is_alive()
        assert 2 <= beats <= 4
        assert bridge.sent == 0


def test_other_systems_positions_are_not_the_vehicles() -> None:
    vehicle, link = peers()
    with vehicle, link:
        vehicle.system = SYSTEM + 1
        stop = threading.Event()
        bridge = Bridge(link, SYSTEM, Slope(), Sampling(spacing_m=0.5), (1, 2))
        thread = threading.Thread(target=bridge.run, args=(stop,))
        thread.start()
        fly(vehicle)
        time.sleep(0.3)
        stop.set()
        thread.join(2.0)
        assert bridge.sent == 0
        assert not bridge.sampler.started


def test_a_vehicle_that_falls_silent_is_a_link_error() -> None:
    vehicle, link = peers()
    with vehicle, link:
        vehicle.send(messages().MAVLink_local_position_ned_message(1000, 0, 0, 0, 0, 0, 0))
        bridge = Bridge(link, SYSTEM, Slope(), Sampling(spacing_m=0.5), (1, 2))
        with pytest.raises(LinkError, match=r"vehicle 7 has been silent for 0\.3 s"):
            bridge.run(threading.Event(), silence_s=0.3)


def test_what_cannot_be_flown_is_refused_at_once() -> None:
    vehicle, link = peers()
    with vehicle, link:
        with pytest.raises(BadInputError, match="mission: expected at least 2 waypoints, got 0"):
            Bridge(link, SYSTEM, Slope(), Sampling(spacing_m=0.5), ())
        with pytest.raises(ValueError, match="noise_sd: expected 0 or more, got nan"):
            Bridge(link, SYSTEM, Slope(), Sampling(spacing_m=0.5), (1, 2), noise_sd=math.nan)
        with pytest.raises(ValueError, match="rng: expected a generator"):
            Bridge(link, SYSTEM, Slope(), Sampling(spacing_m=0.5), (1, 2), noise_sd=1.0)
