"""Vehicle, bridge, estimator and ground station as processes of their own, and parts of it against a vehicle."""

from __future__ import annotations

import re
import signal
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fakes import flying
from running import SCENE, end, run, spawn, spawn_vehicle, stop, wait_for
from viewer import Viewer, by_topic, live_url

from dslam_mav import read_flight
from dslam_mav.log.reader import read_messages
from dslam_mav.mission import leg_plan
from missions.plan_file import read_plan


def ready(process: subprocess.Popen[str]) -> str:
    """The first line a process says."""
    assert process.stdout is not None
    return process.stdout.readline()


def test_a_flight_of_four_processes_and_another_with_the_same_vehicle(flown: Any, tmp_path: Path) -> None:
    log = tmp_path / "flight.mcap"
    started: list[subprocess.Popen[str]] = []
    try:
        vehicle, url = spawn_vehicle("--speedup", 15)
        started.append(vehicle)
        link = ("--connect", url, "--plan", flown.plan)
        bridge = spawn("bridge", "--scene", flown.scene, *link)
        onboard = spawn("onboard", "--out", log, "--sources", 2, "--live", 0, *link)
        started += [bridge, onboard]
        assert ready(bridge).startswith("Reading scene.json along 7 legs of vehicle 1")
        watching = Viewer(live_url(onboard), ("/path", "/scene"))
        assert ready(onboard).startswith("Listening to vehicle 1 on udpout:")
        upload = run("upload", flown.plan, "--connect", url, "--start", "--json")
        assert (upload.code, upload.err) == (0, "")
        assert upload.object["started"] is True
        assert upload.object["legs"] == 7
        done, sent = end(onboard), end(bridge)
        watching.to_the_end()
        out = ("--connect", url, "--out", tmp_path / "logs", "--json")
        second = run("fly", flown.plan, "--scene", flown.scene, "--sources", 2, *out)
    finally:
        for process in started:
            stop(process)
    assert (done.code, done.err) == (0, "")
    assert "IDENTIFIED" in done.out
    pictures = [message for message in read_messages(log) if message[1] in ("/path", "/scene")]
    assert by_topic(watching.messages) == by_topic(pictures)
    assert (sent.code, sent.err) == (0, "")
    assert re.fullmatch(r"[\d,]+ readings sent\n", sent.out)
    assert read_flight(log).n_readings == read_flight(flown.log).n_readings  # none on a leg is lost
    again = run("replay", log, "--json", "--heading", "plan").object
    truth = np.array([source["position_m"] for source in SCENE["sources"]])
    found = np.array([source["position_m"] for source in again["sources"]])
    assert np.linalg.norm(found - truth, axis=1).max() < 0.5
    assert (second.code, second.err) == (0, "")
    assert max(second.object["errors"]["sources_m"]) < 0.5


def test_upload_download_and_clear(flown: Any, tmp_path: Path) -> None:
    held = tmp_path / "held.waypoints"
    with flying() as (url,):
        to = ("--connect", url)
        first = run("upload", flown.plan, *to)
        assert (first.code, first.err) == (0, "")
        assert "7 legs, 112.0 m (read back and compared)" in first.out
        down = run("download", "-o", held, *to, "--json")
        assert (down.code, down.object["plan"]) == (0, str(held))
        ours, theirs = (leg_plan(read_plan(file).mission).vertices_m for file in (flown.plan, held))
        assert theirs == pytest.approx(ours, abs=0.05)
        assert run("clear", *to).out == "Vehicle 1 holds no mission now\n"
        empty = run("onboard", *to, "--out", tmp_path / "x.mcap")
        assert (empty.code, empty.out) == (2, "")
        assert "vehicle 1's mission: 0 waypoints" in empty.line()
        nothing = run("download", "-o", tmp_path / "empty.plan", *to)
        assert nothing.code in (1, 2)
        assert "empty" in nothing.line()
    assert {path.name for path in tmp_path.iterdir()} == {"held.waypoints"}


def test_an_estimator_told_to_end_closes_its_log(flown: Any, tmp_path: Path) -> None:
    log = tmp_path / "flight.mcap"
    with flying(speedup=5.0) as (url,):
        onboard = spawn("onboard", "--out", log, "--connect", url, "--plan", flown.plan, "--sources", 2)
        try:
            ready(onboard)
            assert run("upload", flown.plan, "--connect", url, "--start").code == 0
            wait_for(log, 40_000)
            onboard.send_signal(signal.SIGTERM)
            done = end(onboard)
        finally:
            stop(onboard)
    assert done.code == 143
    assert done.line() == "dslam-mav: terminated"
    info = run("info", log, "--json").object
    assert info["complete"] is True
    assert info["topics"]["/mavlink/raw"] > 100
