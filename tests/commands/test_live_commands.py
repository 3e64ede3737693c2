"""`--live`: a flight watched as it is flown, and as it was logged."""

from __future__ import annotations

import signal
import socket
import sys
from pathlib import Path
from typing import Any

import pytest
from running import end, run, spawn, stop, the_log
from viewer import Viewer, by_topic, live_url

from dslam_mav.cli import _parser
from dslam_mav.log.reader import read_messages


def test_a_pilot_sees_path_and_sources_leg_by_leg(flown: Any, tmp_path: Path) -> None:
    words = ("--scene", flown.scene, "--sources", 2, "--speedup", 15, "--out", tmp_path)
    process = spawn("fly", "--live", 0, *words)
    try:
        with Viewer(live_url(process)) as pilot:
            pilot.until(lambda: len(pilot.of("/scene")) >= 2 and len(pilot.of("/path")) >= 2)
            assert process.poll() is None, "seen in flight"
            done = end(process)
            pilot.to_the_end()
    finally:
        stop(process)
    assert (done.code, done.err) == (0, "")
    logged = by_topic(read_messages(the_log(tmp_path)))
    seen = by_topic(pilot.messages)
    for topic in ("/estimate", "/path", "/scene", "/field", "/thermal"):
        assert seen[topic] == logged[topic], topic
    corners = [len(pilot.decode("/path", data).poses) for data in pilot.of("/path")]
    assert corners == sorted(corners)
    assert corners[-1] == 8
    assert corners[0] < 8
    (sources,) = [one for one in pilot.decode("/scene", pilot.of("/scene")[-1]).entities if one.id == "sources"]
    assert len(sources.spheres) == 2
    assert sources.texts[0].text.startswith("source 1: peak 8.")


def test_a_log_is_played_from_the_first_viewer_on_and_stays(flown: Any) -> None:
    process = spawn("replay", "--live", "127.0.0.1:0", "--speed", 0, flown.log)
    try:
        url = live_url(process)
        logged = by_topic(read_messages(flown.log))
        with Viewer(url) as first:
            first.until(lambda: len(first.of("/mavlink/raw")) == len(logged["/mavlink/raw"]))
            first.until(lambda: by_topic(first.messages) == logged, timeout_s=10)
        with Viewer(url, ("/path", "/scene")) as late:
            late.until(lambda: len(late.messages) == 2)
        assert by_topic(late.messages) == {topic: logged[topic][-1:] for topic in ("/path", "/scene")}
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        done = end(process)
    finally:
        stop(process)
    assert (done.code, done.err) == (130, "dslam-mav: interrupted\n")
    *answer, played = done.out.splitlines()
    assert played == f"Played   {sum(map(len, logged.values())):,} messages; serving until Ctrl-C"
    assert answer == run("replay", flown.log).out.splitlines()


def test_a_port_in_use_ends_all_before_it_begins(flown: Any, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        for words in (
            ("fly", "--scene", flown.scene, "--out", tmp_path / "logs"),
            ("onboard", "--connect", "udpout:127.0.0.1:9", "--out", tmp_path / "a.mcap"),
            ("replay", flown.log),
        ):
            done = run(*words, "--live", port)
            assert (done.code, done.out) == (2, "")
            assert f"port {port} is in use" in done.line()
    assert list(tmp_path.iterdir()) == []


def test_without_the_extra_one_line_says_so(flown: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "foxglove", None)
    done = run("fly", "--live", "--scene", flown.scene, "--out", tmp_path / "logs")
    assert (done.code, done.out) == (2, "")
    assert done.line() == "dslam-mav: --live needs foxglove-sdk; install it with: pip install 'dslam-mav[live]'"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "live", "log"),
    [
        (["--live", "a.mcap"], ("127.0.0.1", 8765), "a.mcap"),
        (["--live", "9000", "a.mcap"], ("127.0.0.1", 9000), "a.mcap"),
        (["a.mcap", "--live"], ("127.0.0.1", 8765), "a.mcap"),
        (["--live", "0.0.0.0:9000", "a.mcap"], ("0.0.0.0", 9000), "a.mcap"),
        (["--live=[::1]:9000", "a.mcap"], ("::1", 9000), "a.mcap"),
        (["--live", ":9000", "--json", "a.mcap"], ("127.0.0.1", 9000), "a.mcap"),
        (["a.mcap"], None, "a.mcap"),
    ],
)
def test_an_address_is_told_from_a_log(words: list[str], live: object, log: str) -> None:
    options = _parser().parse_args(["replay", *words])
    assert (options.live, options.log) == (live, log)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--live=nonsense",), "argument --live: 'nonsense': expected [HOST:]PORT"),
        (("--live", "65536"), "a port of 65535 or less"),
        (("--speed", 2), "--speed 2: only with --live"),
        (("--live", "--speed", -1), "--speed: '-1': expected 0 or more"),
    ],
)
def test_what_makes_no_sense_is_refused(flown: Any, words: tuple[object, ...], told: str) -> None:
    done = run("replay", flown.log, *words)
    assert done.code == 2
    assert told in done.line()


def test_a_recording_of_others_has_nothing_to_play(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time_s,value\n0,1\n")
    done = run("replay", "--live", path)
    assert done.code == 2
    assert "a.csv: --live plays an .mcap log" in done.line()
