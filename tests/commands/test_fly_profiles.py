"""`fly --connect`: one connection, a vehicle with ArduPilot's or PX4's ways, from a plan drawn anywhere."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fakes import flying
from running import run

from dslam_mav.log.reader import read_log
from dslam_mav.mav.hub import Hub
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mission import Home, leg_plan
from missions.plan_file import parse_plan, read_plan
from sim_bridge.odometry_feed import OdometryFeed

THERE = Home(-35.363262, 149.165237, 584.0)


def test_ardupilot_on_optical_flow_over_the_one_place_of_a_tcp_port(flown: Any, tmp_path: Path) -> None:
    """GPS-denied: it is told where it stands, drifts, and the readings are taken where it truly is."""
    with flying("tcpin:127.0.0.1:0", profile="ardupilot", feed="flow", speedup=20.0, home=THERE) as (url,):
        words = ("fly", flown.plan, "--scene", flown.scene, "--sources", 2, "--connect", url, "--out", tmp_path)
        far = run(*words)  # the plan's home is on another continent
        assert far.code == 2
        assert "km from vehicle 1: plan it there (--home -35.363262,149.165237,584)" in far.line()
        done = run(*words, "--here", "--json")
        held = tmp_path / "held.plan"
        assert run("download", "--connect", url, "-o", held).code == 0
    assert (done.code, done.err) == (0, "")
    assert max(done.object["errors"]["sources_m"]) < 2.0
    log = read_log(Path(done.object["log"]))
    assert len(log.readings) > 150
    assert log.truth is not None
    planned_m = leg_plan(parse_plan(log.attachments["mission.waypoints"], "log").mission).vertices_m
    off_m = np.linalg.norm(log.truth.vertices_m - planned_m, axis=1)
    assert 0.2 < off_m.max() < 6.0, "truth is where the simulator had it, not where it was to fly"
    assert run("replay", done.object["log"], "--json").object["errors"] == done.object["errors"]
    heard = {frame[7:10] for _, frame in log.frames}
    assert (108).to_bytes(3, "little") in heard, "SIM_STATE"
    ours, theirs = (leg_plan(read_plan(file).mission).vertices_m for file in (flown.plan, held))
    assert theirs == pytest.approx(ours, abs=0.05)


def test_px4_takes_off_and_flies_a_plan_that_has_a_home_item(flown: Any, tmp_path: Path) -> None:
    """And is told where the answer has it, since that was asked for."""
    words = ("fly", flown.plan, "--scene", flown.scene, "--sources", 2, "--out", tmp_path / "logs", "--send-odometry")
    with flying(profile="px4", speedup=20.0) as (url,), Link(url, system=255, component=191) as beside:
        beside.send_heartbeat()
        refused = run(*words, "--connect", url)
        assert (refused.code, "expected --heading vehicle or plan" in refused.line()) == (2, True)
        done = run(*words, "--connect", url, "--heading", "plan")
        told = []
        while (frame := beside.receive(0.2)) is not None:
            told += [frame.message] if frame.message.get_type() == "ODOMETRY" else []
    assert (done.code, done.err) == (0, "")
    assert "get an acceptance radius of 0.5 m" in done.out
    assert "noise sd" in done.out
    assert {(m.get_srcComponent(), m.frame_id, m.quality) for m in told} == {(191, 1, 100)}
    assert len({m.reset_counter for m in told}) >= 1


def test_odometry_is_fed_by_us_and_several_connections_are_shared_out(flown: Any, tmp_path: Path) -> None:
    with flying(*["tcpin:127.0.0.1:0"] * 3, profile="ardupilot", feed="odometry", speedup=20.0) as urls:
        connect = [word for url in urls for word in ("--connect", url)]
        done = run(
            "fly", "--scene", flown.scene, "--sources", 2, *connect, "--feed-odometry", "--truth-from", "sim",
            "--out", tmp_path / "logs", "--json",
        )  # fmt: skip
    assert (done.code, done.err) == (0, "")
    assert max(done.object["errors"]["sources_m"]) < 2.0


def feed_until(url: str, seq: int, over: threading.Event) -> None:
    """ODOMETRY for a vehicle, until it has reached an item."""
    with Hub(url) as hub:
        ground, stop = hub.join(255, 191), threading.Event()
        wait_for_vehicle(ground, 5.0)
        feed = OdometryFeed(hub.join(1, 197), 1)
        feeding = threading.Thread(target=feed.run, args=(stop,))
        feeding.start()
        while not over.is_set():
            frame = ground.receive(0.2)
            if frame is not None and frame.message.get_type() == "MISSION_ITEM_REACHED" and frame.message.seq >= seq:
                break
        stop.set()
        feeding.join()


def test_a_failsafe_in_flight_is_told_and_what_was_flown_is_answered(flown: Any, tmp_path: Path) -> None:
    """Its navigation feed stops on the fourth leg, and it lands eight seconds later."""
    words = ("fly", "--scene", flown.scene, "--sources", 2, "--out", tmp_path / "logs", "--json")
    with flying(*["tcpin:127.0.0.1:0"] * 2, profile="ardupilot", feed="odometry", speedup=10.0) as urls:
        over = threading.Event()
        feeding = threading.Thread(target=feed_until, args=(urls[1], 6, over))
        feeding.start()
        try:
            done = run(*words, "--connect", urls[0])
        finally:
            over.set()
            feeding.join()
    assert "vehicle 1 says: EKF Failsafe: changed to LAND Mode" in done.err
    n_legs = len(done.object["path"]["vertices_m"]) - 1
    assert 3 <= n_legs <= 5
    assert f"the last {7 - n_legs} legs of the mission are missing" in done.err
    assert len(done.object["sources"]) == 2
