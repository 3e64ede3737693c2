"""The live loop when something goes wrong: the vehicle vanishes, nothing is flown, an estimate fails."""

from __future__ import annotations

import socket
import threading
import time

import pytest
from aboard import PLAN, Log, Vehicle, cut_short, run, stand_in
from flown import fly, heartbeat, reading

from dslam_mav.errors import LinkError, MissionError
from dslam_mav.legs import FlownLeg, LegCollector
from dslam_mav.mav.link import Link
from dslam_mav.mav.onboard import Onboard
from dslam_mav.mav.watch import FlightWatch
from dslam_mav.records import Estimate, Flight


def test_a_vehicle_that_disappears_is_one_line_and_the_legs_until_then_an_estimate(vehicle: Vehicle):
    flown = fly()
    onboard, log, _, raised = run(vehicle, cut_short(flown), lost_s=0.5)
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


def test_a_vehicle_that_disappears_is_missed_while_others_go_on_sending(vehicle: Vehicle):
    flown = fly()
    t = flown.corner_ms[3] + 500
    others = [reading(t + k, 20.0, t + k) for k in range(300)]  # a frame every 5 ms, for 1.5 s
    original = vehicle.send

    def send(frames, pause_every=100):
        original(frames)
        original(others, 1)

    vehicle.send = send
    begin_s = time.monotonic()
    _, log, _, raised = run(vehicle, cut_short(flown), lost_s=0.5)
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
    _, log, _, raised = run(vehicle, cut_short(flown), estimate=broken, lost_s=0.5)
    assert str(raised) == "vehicle 1 fell silent for 0.5 s, after 3 legs were flown"
    assert isinstance(raised.__cause__, ValueError)
    assert "no estimate of the whole flight: n_sources: too many" in log.texts
    assert str(raised) in log.texts


def test_a_last_estimate_that_fails_after_a_whole_flight_is_raised(vehicle: Vehicle):
    def broken(flight: Flight, legs: tuple[FlownLeg, ...]) -> Estimate:
        raise ValueError("n_sources: too many")

    with pytest.raises(ValueError, match="too many"):
        run(vehicle, fly(late_ms=300).frames, estimate=broken)
