"""Whatever is wrong with a file, a URL or a number: exit 2, one line that names it, nothing left behind."""

from __future__ import annotations

import json
import re
import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from running import SCENE, left, run

SHARED = Path(__file__).parents[3] / "shared" / "data"


def refused(folder: Path, words: tuple[object, ...], *named: str) -> None:
    before = left(folder)
    done = run(*words)
    assert (done.code, done.out) == (2, ""), done
    for name in named:
        assert name in done.line(), name
    assert left(folder) == before


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (None, "cannot be read"),
        ("", "begins with"),
        ("hello", "hello"),
        ("{", "line 1"),
        ("[1]", "[1]"),
        ('{"fileType": "Plan", "version": 7, "mission": {"items": []}}', "version"),
        ("QGC WPL 999\n", "999"),
    ],
)
@pytest.mark.parametrize("command", [("plan",), ("fly",), ("upload", "--connect", "udpout:127.0.0.1:9")])
def test_a_plan_that_is_none(tmp_path: Path, command: tuple[str, ...], content: str | None, named: str) -> None:
    plan = tmp_path / "wrong.plan"
    if content is not None:
        plan.write_text(content)
    out = ("--out", tmp_path / "logs") if command == ("fly",) else ()
    refused(tmp_path, (*command, plan, *out), "wrong.plan", named)


@pytest.mark.parametrize("waypoints", [0, 1])
def test_a_plan_with_no_leg_to_fly(tmp_path: Path, waypoints: int) -> None:
    plan = tmp_path / "short.waypoints"
    lines = ["0\t1\t0\t16\t0\t0\t0\t0\t47.3977\t8.5456\t488\t1", "1\t0\t3\t22\t0\t0\t0\t0\t47.3977\t8.5456\t10\t1"]
    lines += ["2\t0\t3\t16\t0\t0\t0\t0\t47.3979\t8.5456\t10\t1"] * waypoints
    plan.write_text("QGC WPL 110\n" + "\n".join(lines) + "\n")
    refused(tmp_path, ("fly", plan, "--out", tmp_path / "logs"), "short.waypoints", f"{waypoints} waypoint")
    refused(tmp_path, ("plan", plan), "short.waypoints", f"{waypoints} waypoint")


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"sauces": []}, "sauces"),
        ({"medium": {"diffusivity_m2_s": 0.5, "dimensons": 2}}, "medium.dimensons"),
        ({"medium": {"diffusivity_m2_s": "much"}}, "medium.diffusivity_m2_s"),
        ({"sources": [{"position_m": [1, 2], "amplitude": 5, "activation_s": "soon"}]}, "activation_s"),
        ({"sampling": {"spacing_m": 0.0001, "speed_m_s": 5.0}}, "spacing_m 0.0001"),
        ({"path": {"vertices_m": [[0, 0]]}}, "path"),
        ({"noise": {"snr_db": 20.0, "sd": 1.0}}, "noise"),
    ],
)
def test_a_scene_that_is_wrong(tmp_path: Path, change: dict[str, Any], named: str) -> None:
    scene = tmp_path / "wrong.json"
    scene.write_text(json.dumps({**SCENE, **change}))
    refused(tmp_path, ("fly", "--scene", scene, "--out", tmp_path / "logs"), "wrong.json", named)


def test_a_scene_that_is_missing_or_no_json(tmp_path: Path) -> None:
    refused(tmp_path, ("fly", "--scene", tmp_path / "none.json"), "none.json")
    (tmp_path / "text.json").write_text("hello")
    refused(tmp_path, ("fly", "--scene", tmp_path / "text.json"), "text.json")
    (tmp_path / "dead.json").write_text(json.dumps({key: SCENE[key] for key in SCENE if key != "path"}))
    refused(tmp_path, ("fly", "--scene", tmp_path / "dead.json"), "dead.json", "nothing to fly")


@pytest.mark.parametrize("command", ["replay", "report", "info"])
def test_a_log_that_is_none(tmp_path: Path, command: str) -> None:
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "text.mcap").write_text("hello\n" * 100)
    (tmp_path / "folder.mcap").mkdir()
    for name in ("none.mcap", "empty.mcap", "text.mcap", "folder.mcap"):
        refused(tmp_path, (command, tmp_path / name), name)


@pytest.mark.parametrize("command", ["replay", "report"])
def test_a_tlog_that_is_none(tmp_path: Path, command: str) -> None:
    (tmp_path / "empty.tlog").touch()
    (tmp_path / "text.tlog").write_text("hello\n" * 100)
    for name in ("none.tlog", "empty.tlog", "text.tlog"):
        refused(tmp_path, (command, tmp_path / name), name)


@pytest.mark.parametrize("command", ["info", "replay", "report"])
@pytest.mark.parametrize("name", ["x.mcap", "x.tlog", "x.bin", "x.csv", "x"])
def test_an_empty_file_is_called_empty(tmp_path: Path, command: str, name: str) -> None:
    (tmp_path / name).touch()
    refused(tmp_path, (command, tmp_path / name), f"{name}: is empty; expected a .mcap, a .tlog, ")


@pytest.mark.parametrize("command", ["info", "replay", "report"])
def test_a_file_of_no_kind_that_is_known(tmp_path: Path, command: str) -> None:
    (tmp_path / "README.md").write_text("# Read this first\n")
    refused(tmp_path, (command, tmp_path / "README.md"), "README.md: is no recording of a flight; expected a .mcap, ")
    np.savez(tmp_path / "spot.npz", frames=np.zeros((2, 3, 3)))
    refused(tmp_path, (command, tmp_path / "spot.npz"), "spot.npz: is no recording of a flight", "fly --readings")


def test_a_tlog_is_known_by_its_first_packet_whatever_its_name(tmp_path: Path, flown: Any) -> None:
    assert run("export", flown.log, "--to", "tlog", "-o", tmp_path / "flight.tlog").code == 0
    (tmp_path / "flight.tlog").rename(tmp_path / "flight.raw")
    told = run("info", tmp_path / "flight.raw", "--json").object
    assert told["complete"]
    assert told["topics"]["NAMED_VALUE_FLOAT"] > 100


def test_an_assumption_set_twice_is_refused(tmp_path: Path, flown: Any) -> None:
    for settings in (("sources=2", "sources=3"), ("static=yes", "evolving=yes")):
        words = [word for each in settings for word in ("--set", each)]
        refused(tmp_path, ("replay", flown.log, *words), f"--set {settings[1]}: expected each assumption once")


@pytest.mark.skipif(not SHARED.exists(), reason=f"needs the recorded flights in {SHARED}")
def test_a_real_flight_without_readings() -> None:
    done = run("replay", SHARED / "flights" / "copter_waypoints.tlog")
    assert (done.code, done.out) == (2, "")
    assert "copter_waypoints.tlog: no THERMAL readings" in done.line()


@pytest.mark.parametrize(
    ("url", "named"),
    [
        ("nonsense", "nonsense"),
        ("udpout:127.0.0.1", "PORT"),
        ("udpout:127.0.0.1:port", "port"),
        ("udpout:127.0.0.1:99999", "99999"),
        ("carrier:pigeon:7", "carrier"),
    ],
)
@pytest.mark.parametrize("command", ["fly", "clear", "onboard", "bridge"])
def test_a_url_that_is_none(tmp_path: Path, command: str, url: str, named: str) -> None:
    more = ("--out", tmp_path / "x.mcap") if command == "onboard" else ()
    refused(tmp_path, (command, "--connect", url, *more), named)


def test_fly_listens_on_one_port_and_says_who_did_not_come(tmp_path: Path) -> None:
    done = run("fly", "--connect", "udpin:127.0.0.1:0", "--timeout", 0.3, "--out", tmp_path / "logs")
    assert done.code == 1
    assert re.search(r"no vehicle answered on udpin:127.0.0.1:\d+ within 0.3 s", done.line())


@pytest.mark.parametrize("command", ["vehicle", "onboard", "bridge", "upload"])
def test_a_port_in_use(tmp_path: Path, command: str, flown: Any) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        url = f"udpin:127.0.0.1:{taken.getsockname()[1]}"
        words = {
            "vehicle": ("vehicle", "--listen", url),
            "onboard": ("onboard", "--connect", url, "--out", tmp_path / "x.mcap"),
            "bridge": ("bridge", "--connect", url),
            "upload": ("upload", flown.plan, "--connect", url),
        }[command]
        done = run(*words)
    assert (done.code, done.out) == (1, "")
    assert url in done.line()
    assert "in use" in done.line()
    assert not left(tmp_path)


@pytest.mark.parametrize(
    ("name", "content", "more", "named"),
    [
        ("none.csv", None, (), "cannot be read"),
        ("odd.xyz", "a", (), "'.xyz'"),
        ("noending", "a", (), "no ending"),
        ("columns.csv", "a,b\n1,2\n2,3\n", (), "column time_s"),
        ("columns.csv", "a,b\n1,2\n2,3\n", ("--columns", "time_s=a,value=c"), "column c"),
        ("columns.csv", "a,b\n1,2\n2,3\n", ("--columns", "speed=a"), "--columns: speed=a"),
        ("word.csv", "time_s,value\n1,2\n2,warm\n", (), "line 3: value"),
        ("nan.csv", "time_s,value\n1,2\n2,nan\n", (), "line 3: value"),
        ("back.csv", "time_s,value\n2,2\n1,2\n", (), "line 3"),
        ("short.csv", "time_s,value\n2,2\n", (), "at least 2"),
        ("fast.csv", "time_s,value\n" + "".join(f"{k * 1e-4:.4f},1\n" for k in range(50)), (), "whole ms"),
        ("text.npz", "hello", (), "text.npz"),
        ("text.tlog", "hello", (), "text.tlog"),
        ("text.mcap", "hello", (), "text.mcap"),
    ],
)
def test_readings_that_are_wrong(
    tmp_path: Path, flown: Any, name: str, content: str | None, more: tuple[str, ...], named: str
) -> None:
    if content is not None:
        (tmp_path / name).write_text(content)
    words = ("fly", flown.plan, "--readings", tmp_path / name, "--out", tmp_path / "logs", *more)
    refused(tmp_path, words, "" if named.startswith("--columns") else name, named)


def test_frames_of_another_kind(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", picture=np.zeros((3, 3)))
    refused(tmp_path, ("fly", "--readings", tmp_path / "other.npz", "--out", tmp_path / "logs"), "other.npz", "frames")
    frames = np.zeros((4, 8), np.float32)
    np.savez(tmp_path / "flat.npz", frames=frames, time_s=np.arange(4.0), pixel_m=1.0)
    refused(tmp_path, ("fly", "--readings", tmp_path / "flat.npz", "--out", tmp_path / "logs"), "flat.npz", "(4, 8)")


def test_options_that_do_not_go_together(tmp_path: Path, flown: Any) -> None:
    csv = tmp_path / "r.csv"
    csv.write_text("time_s,value\n0,1\n1,2\n")
    for words, named in (
        (("fly", "--scene", flown.scene, "--readings", csv), "--scene and --readings"),
        (("fly", "--readings", csv), "give a PLAN"),
        (("fly", "--frames", "2"), "--frames 2"),
        (("fly", flown.plan, "--readings", csv, "--copies", 2), "--copies 2"),
        (("fly", "--columns", "value=T"), "--columns value=T"),
        (("fly", "--activation", 5), "--activation 5"),
        (("fly", "--evolving", "--spread", 5), "--spread"),
        (("plan", flown.plan, "--pattern", "star5"), "--pattern"),
        (("plan", "--pattern", "nonsense"), "'nonsense'"),
        (("plan", "--home", "north"), "--home north"),
        (("plan", "--home", "95,8"), "95"),
        (("plan", "--centre", "1"), "--centre 1"),
        (("plan", "-o", tmp_path / "x.kml"), "x.kml"),
        (("plan", "-o", tmp_path / "nowhere" / "x.plan"), "nowhere"),
        (("report", tmp_path / "a.mcap", tmp_path / "b.mcap"), "none of 2 logs can be read"),
        (("replay", flown.log, "--plan", tmp_path / "none.plan"), "none.plan"),
        (("vehicle", "--system", 300), "300"),
        (("vehicle", "--listen", "udpout:127.0.0.1:5"), "udpout"),
    ):
        refused(tmp_path, words, named)


def test_a_log_is_never_overwritten(flown: Any, tmp_path: Path) -> None:
    before = flown.log.read_bytes()
    done = run("onboard", "--connect", "udpout:127.0.0.1:9", "--out", flown.log)
    assert done.code == 2
    assert "exists already" in done.line()
    assert flown.log.read_bytes() == before
