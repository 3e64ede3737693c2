"""The live server, watched by real WebSocket clients."""

from __future__ import annotations

import json
import logging
import socket
import sys
import time

import pytest
from viewer import SUBPROTOCOL, Viewer, by_topic
from websockets.sync.client import connect

from dslam_mav.errors import BadInputError
from dslam_mav.log import Recorder
from dslam_mav.log.live import Live
from dslam_mav.log.reader import read_messages
from dslam_mav.observations import Progress, Reading

READINGS = 300


@pytest.fixture
def live():
    with Live("127.0.0.1", 0) as server:
        yield server


def subscribed(server):
    """A viewer asks for topics one by one, and only the first of them can be waited for."""
    assert server.watched.wait(30)
    time.sleep(1.0)


def log_flight(path, also, estimate, start_ns):
    """A short flight with an estimate after each of three legs."""
    with Recorder(path, also) as recorder:
        for i in range(READINGS):
            time_ns = start_ns + i * 20_000_000
            recorder.frame(time_ns, bytes.fromhex("fd0900000001010000000000000002030004030000"))
            recorder.reading(time_ns, Reading(20 * i, i / 7))
            if i % 100 == 99:
                recorder.progress(time_ns, Progress(i // 100, reached=True))
                recorder.text(time_ns, logging.INFO, f"leg {i // 100}: ça va")
                recorder.estimate(time_ns, estimate(i), 1 + i // 100, final=i == READINGS - 1)


def test_a_viewer_gets_what_the_log_gets(live, tmp_path, estimate, start_ns):
    with Viewer(live.url) as viewer:
        subscribed(live)
        log_flight(tmp_path / "a.mcap", live.send, estimate, start_ns)
        live.close()
        viewer.to_the_end()
    assert viewer.info["name"] == "dslam-mav"
    assert viewer.info["capabilities"] == ["time"]  # nobody but us has a say in a flight
    assert by_topic(viewer.messages) == by_topic(read_messages(tmp_path / "a.mcap"))
    assert len(viewer.of("/thermal")) == len(viewer.of("/mavlink/raw")) == READINGS
    assert viewer.times_ns == sorted(viewer.times_ns)
    assert viewer.times_ns[-1] > start_ns + 5_900_000_000


def test_path_and_sources_are_read_with_the_advertised_schemas_alone(live, tmp_path, estimate, start_ns):
    with Viewer(live.url, ("/path", "/scene", "/estimate")) as viewer:
        subscribed(live)
        log_flight(tmp_path / "a.mcap", live.send, estimate, start_ns)
        live.close()
        viewer.to_the_end()
    for i, (path, scene, update) in enumerate(
        zip(viewer.of("/path"), viewer.of("/scene"), viewer.of("/estimate"), strict=True)
    ):
        known = estimate(100 * i + 99)
        poses = viewer.decode("/path", path).poses
        assert [[pose.position.x, pose.position.y] for pose in poses] == known.path.vertices_m.tolist()
        (sources,) = [entity for entity in viewer.decode("/scene", scene).entities if entity.id == "sources"]
        drawn = [[ball.pose.position.x, ball.pose.position.y] for ball in sources.spheres]
        assert drawn == known.sources.position_m.tolist()
        told = viewer.decode("/estimate", update)
        assert (told.legs_flown, told.final, told.estimate.verdict_name) == (i + 1, i == 2, "IDENTIFIED")
    assert i == 2


def test_a_late_viewer_is_told_how_things_stand_and_nobody_else_is(live, tmp_path, estimate, start_ns):
    with Viewer(live.url) as first:
        subscribed(live)
        log_flight(tmp_path / "a.mcap", live.send, estimate, start_ns)
        first.until(lambda: len(first.of("/thermal")) == READINGS)
        logged = by_topic(read_messages(tmp_path / "a.mcap"))
        with Viewer(live.url) as late:
            pictures = ("/path", "/scene", "/field", "/estimate", "/mission", "/log")
            pictures += ("/field_points", "/path_points", "/source_points")
            late.until(lambda: {topic for _, topic, _ in late.messages} >= set(pictures))
            live.send(start_ns, "/thermal", b"")
            late.until(lambda: bool(late.of("/thermal")))
            first.until(lambda: len(first.of("/thermal")) == READINGS + 1)
        seen = by_topic(late.messages)
        assert {topic: seen[topic] for topic in pictures} == {topic: logged[topic][-1:] for topic in pictures}
        assert seen.keys() == {*pictures, "/thermal"}  # streams begin where a viewer joins
        assert len(seen["/thermal"]) == 1
        assert late.times_ns[0] == logged["/thermal"][-1][0]
    told = by_topic(first.messages)
    told["/thermal"].pop()
    assert told == logged


def test_viewers_that_hang_or_vanish_are_nobody_elses_affair(live, capfd):
    stuck, gone = (connect(live.url, subprotocols=[SUBPROTOCOL], max_queue=1).__enter__() for _ in range(2))
    for viewer in (stuck, gone):
        message = ""
        while "advertise" not in message:
            message = viewer.recv()
        asked = [{"id": one["id"], "channelId": one["id"]} for one in json.loads(message)["channels"]]
        viewer.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
    subscribed(live)
    big = bytes(20_000)
    for i in range(12_000):  # more than the backlog, and 240 MB
        live.send(i, "/log", big)
        if i == 6_000:
            gone.socket.close()
    with Viewer(live.url) as viewer:
        viewer.until(lambda: bool(viewer.messages) and live.waiting == 0)
        live.send(1, "/thermal", b"last")
        viewer.until(lambda: viewer.of("/thermal") == [b"last"])
    stuck.socket.close()
    live.close()
    assert capfd.readouterr() == ("", "")


def test_a_port_in_use_and_a_host_that_is_not_ours_are_said(live):
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(BadInputError, match=rf"^--live 127.0.0.1:{port}: port {port} is in use already; choose"):
            Live("127.0.0.1", port)
    with pytest.raises(BadInputError, match=r"^--live 203.0.113.7:0: cannot be served there: "):
        Live("203.0.113.7", 0)


def test_without_the_sdk_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(BadInputError, match=r"pip install 'dslam-mav\[live\]'$"):
        Live("127.0.0.1", 0)
