"""The live loop over real sockets: what it logs, what it sends back, how it ends."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest
from flown import fly, heartbeat, reading

from dslam_mav.errors import LinkError, MissionError
from dslam_mav.legs import FlownLeg, LegCollector, PlanFacts
from dslam_mav.mav.frames import Frame, Parser, messages, parse_frame
from dslam_mav.mav.link import Link
from dslam_mav.mav.onboard import Onboard
from dslam_mav.mav.watch import FlightWatch
from dslam_mav.records import Estimate, Flight, Medium, Path, Sources, Verdict
from dslam_mav.replay import flight_from_frames

PLAN = PlanFacts((1, 2, 3, 4, 5), (30.0,) * 4)
M = messages()


def stand_in(flight: Flight, legs: tuple[FlownLeg, ...] = ()) -> Estimate:
    """An "estimate" that depends on every bit of the flight."""
    sums = [float((leg.distance_m * leg.reading * (1.0 + leg.time_s)).sum()) for leg in flight.legs]
    n = len(flight.legs)
    return Estimate(
        sources=Sources([[sums[0], 2.0], [3.0, 4.0]], [200.0, 100.0], [5.0, 4.0], [-1.0, -1.0]),
        path=Path(np.zeros((n + 1, 2)), np.zeros(n)),
        medium=Medium(), verdict=Verdict.IDENTIFIED, reason="", spread_m=10.0,
        position_covariance_m2=np.stack([0.04 * np.eye(2)] * 2),
        path_aligned_covariance_m2=np.stack([0.04 * np.eye(2)] * 2),
        parameter_covariance=np.zeros((0, 0)), parameter_names=(), noise_sd=0.1, log_likelihood=0.0,
        residual=np.array(sums),
    )  # fmt: skip


@dataclass
class Log:
    frames: list[tuple[int, bytes]] = field(default_factory=list)
    readings: list = field(default_factory=list)
    progressed: list = field(default_factory=list)
    estimates: list[tuple[Estimate, int, bool]] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    def frame(self, received_ns, raw):
        self.frames.append((received_ns, raw))

    def reading(self, received_ns, reading):
        self.readings.append(reading)

    def progress(self, received_ns, progress):
        self.progressed.append(progress)

    def estimate(self, received_ns, estimate, legs_flown, final):
        self.estimates.append((estimate, legs_flown, final))

    def text(self, received_ns, level, text):
        self.texts.append(text)


class Vehicle:
    """Sends stored frames from a socket to whoever speaks to it first, and keeps what it hears."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.url = f"udpout:127.0.0.1:{self.socket.getsockname()[1]}"
        self.heard: list[Frame] = []
        self._peer = None
        self._parser = Parser()
        self._over = threading.Event()
        self.socket.settimeout(0.05)
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def send(self, frames: list[Frame], pause_every: int = 100) -> None:
        while self._peer is None:
            time.sleep(0.01)
        for i, frame in enumerate(frames):
            self.socket.sendto(frame.raw, self._peer)
            if i % pause_every == 0:
                time.sleep(0.005)

    def of(self, kind: str) -> list:
        return [f.message for f in self.heard if f.message.get_type() == kind]

    def close(self) -> None:
        time.sleep(0.1)
        self._over.set()
        self._thread.join()
        self.socket.close()

    def _listen(self) -> None:
        while not self._over.is_set():
            try:
                data, self._peer = self.socket.recvfrom(65536)
            except TimeoutError:
                continue
            self.heard += self._parser.feed(data, 0)


@pytest.fixture
def vehicle() -> Iterator[Vehicle]:
    v = Vehicle()
    yield v
    v.close()


def run(vehicle: Vehicle, frames: list[Frame], *, estimate=stand_in, plan=PLAN, stop=None, **options):
    """The loop over a socket while the vehicle sends; (loop, log, updates, what it raised)."""
    log, updates = Log(), []
    with Link(vehicle.url, system=1, component=191) as link:
        onboard = Onboard(
            link,
            1,
            LegCollector(plan),
            estimate,
            log,
            on_update=updates.append,
            **{"quiet_s": 0.4, **options},
        )
        sender = threading.Thread(target=vehicle.send, args=(frames,))
        sender.start()
        raised = None
        try:
            assert onboard.run(stop or threading.Event()) is onboard.result
        except LinkError as error:
            raised = error
        sender.join()
    return onboard, log, updates, raised


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


def test_a_vehicle_that_disappears_is_one_line_and_the_legs_until_then_an_estimate(vehicle: Vehicle):
    flown = fly()
    cut = next(i for i, f in enumerate(flown.frames) if f.received_ns > (flown.corner_ms[3] + 500) * 1_000_000)
    onboard, log, _, raised = run(vehicle, flown.frames[:cut], lost_s=0.5)
    assert str(raised) == "vehicle 1 fell silent for 0.5 s, after 3 legs were flown"
    estimate, legs_flown, final = log.estimates[-1]
    assert (legs_flown, final) == (3, True)
    assert onboard.result is estimate
    assert str(raised) in log.texts


def test_a_closed_tcp_connection_is_a_vehicle_that_disappears():
    flown = fly()
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        peer, _ = server.accept()
        with peer:
            for frame in flown.frames[: len(flown.frames) // 2]:
                peer.sendall(frame.raw)
            peer.shutdown(socket.SHUT_WR)
            while peer.recv(4096):
                pass

    thread = threading.Thread(target=serve)
    thread.start()
    with Link(f"tcp:127.0.0.1:{server.getsockname()[1]}", system=1, component=191) as link:
        onboard = Onboard(link, 1, LegCollector(PLAN), stand_in, Log())
        with pytest.raises(LinkError, match=r"closed the connection, after 1 leg was flown|after \d legs were flown"):
            onboard.run(threading.Event())
    thread.join()
    server.close()
    assert onboard.result is not None


def test_stop_ends_the_flight_with_an_estimate_of_what_there_is(vehicle: Vehicle):
    flown = fly()
    stop = threading.Event()
    threading.Timer(1.0, stop.set).start()
    cut = next(i for i, f in enumerate(flown.frames) if f.received_ns > (flown.corner_ms[3] + 500) * 1_000_000)
    _, log, _, raised = run(vehicle, flown.frames[:cut], stop=stop, lost_s=60.0)
    assert raised is None
    assert log.estimates[-1][1:] == (3, True)


def test_a_flight_without_a_plan_ends_when_the_vehicle_disarms(vehicle: Vehicle):
    _, log, _, raised = run(vehicle, fly(late_ms=100).frames, plan=None)
    assert raised is None
    assert log.estimates[-1][1:] == (4, True)


def test_no_leg_is_no_estimate_and_says_so(vehicle: Vehicle):
    stop = threading.Event()
    threading.Timer(0.4, stop.set).start()
    onboard, log, _, _ = run(vehicle, [heartbeat(1)], stop=stop)
    assert onboard.result is None
    assert log.estimates == []
    assert log.texts == [
        "no readings were heard: is the bridge or the sensor running?",
        "no leg with readings was flown: nothing to estimate",
    ]


def test_an_estimate_that_fails_under_way_does_not_end_the_flight(vehicle: Vehicle):
    def fragile(flight: Flight, legs: tuple[FlownLeg, ...]) -> Estimate:
        if len(flight.legs) < 4:
            raise ValueError("n_sources: too many")
        return stand_in(flight)

    flown = fly(late_ms=300)
    _, log, _, raised = run(vehicle, flown.frames, estimate=fragile)
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


def test_a_vehicle_that_disappears_is_missed_while_others_go_on_sending(vehicle: Vehicle):
    flown = fly()
    cut = next(i for i, f in enumerate(flown.frames) if f.received_ns > (flown.corner_ms[3] + 500) * 1_000_000)
    t = flown.corner_ms[3] + 500
    others = [reading(t + k, 20.0, t + k) for k in range(300)]  # a frame every 5 ms, for 1.5 s
    original = vehicle.send

    def send(frames, pause_every=100):
        original(frames)
        original(others, 1)

    vehicle.send = send
    begin_s = time.monotonic()
    _, log, _, raised = run(vehicle, flown.frames[:cut], lost_s=0.5)
    assert str(raised) == "vehicle 1 fell silent for 0.5 s, after 3 legs were flown"
    assert 0 < sum(r.time_boot_ms >= t for r in log.readings) < len(others)  # it did not wait for their end
    assert log.estimates[-1][1:] == (3, True)
    assert time.monotonic() - begin_s < 10.0


def test_a_pause_of_our_own_is_no_silence_of_the_vehicle():
    watch = FlightWatch(1, 0.0, lost_s=5.0)
    watch.see(heartbeat(1), 1.0)
    assert not watch.lost(1.0)
    bridge = reading(1, 20.0, 1)
    watch.see(bridge, 60.0)  # we slept; a heartbeat waits behind this reading
    assert not watch.lost(60.0)
    for k in range(60):
        watch.see(bridge, 60.0 + 0.1 * k)
    assert not any(watch.lost(60.0 + 0.1 * k) for k in range(40))
    assert any(watch.lost(64.0 + 0.1 * k) for k in range(20))


@pytest.mark.parametrize("plan", [PLAN, None])
def test_a_flight_that_is_over_before_any_item_was_passed_ends(vehicle: Vehicle, plan):
    stop = threading.Event()
    timer = threading.Timer(8.0, stop.set)
    timer.start()
    log = Log()
    with Link(vehicle.url, system=1, component=191) as link:
        onboard = Onboard(link, 1, LegCollector(plan), stand_in, log, quiet_s=0.4, lost_s=60.0)
        sender = threading.Thread(target=vehicle.send, args=([heartbeat(1), heartbeat(2, armed=False)],))
        sender.start()
        with pytest.raises(MissionError, match="ended its mission before any item of it was passed"):
            onboard.run(stop)
        sender.join()
    timer.cancel()
    assert not stop.is_set()
    assert onboard.result is None
    assert log.texts[-1].startswith("vehicle 1 ended its mission")


def test_a_last_estimate_that_fails_is_logged_and_hides_nothing(vehicle: Vehicle):
    def broken(flight: Flight, legs: tuple[FlownLeg, ...]) -> Estimate:
        raise ValueError("n_sources: too many")

    flown = fly()
    cut = next(i for i, f in enumerate(flown.frames) if f.received_ns > (flown.corner_ms[3] + 500) * 1_000_000)
    _, log, _, raised = run(vehicle, flown.frames[:cut], estimate=broken, lost_s=0.5)
    assert str(raised) == "vehicle 1 fell silent for 0.5 s, after 3 legs were flown"
    assert isinstance(raised.__cause__, ValueError)
    assert "no estimate of the whole flight: n_sources: too many" in log.texts
    assert str(raised) in log.texts


def test_a_last_estimate_that_fails_after_a_whole_flight_is_raised(vehicle: Vehicle):
    def broken(flight: Flight, legs: tuple[FlownLeg, ...]) -> Estimate:
        raise ValueError("n_sources: too many")

    with pytest.raises(ValueError, match="too many"):
        run(vehicle, fly(late_ms=300).frames, estimate=broken)


def test_flight_and_legs_of_an_estimate_are_one_snapshot(vehicle: Vehicle):
    seen = []

    def slow(flight: Flight, legs: tuple[FlownLeg, ...]) -> Estimate:
        time.sleep(0.3)
        seen.append([leg.time_ms.size for leg in legs] == [leg.time_s.size for leg in flight.legs])
        return stand_in(flight)

    run(vehicle, fly(late_ms=300).frames, estimate=slow)
    assert seen
    assert all(seen)
