"""A flight one of whose legs was not read: what the missing readings carried is lost, and no more."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Flown
from running import run

from dslam_mav.assumed import NOT_CLOSED
from dslam_mav.commands.outcome import known_then, truth_of
from dslam_mav.flight_log import read_log as opened
from dslam_mav.log.reader import read_log
from dslam_mav.log.recorder import Recorder
from dslam_mav.mav.frames import parse_frame
from dslam_mav.recordings import Assumed, our_log
from dslam_mav.replay import Replayed


def without(flown: Flown, out: Path, gone: tuple[int, ...]) -> Path:
    """The log of the flight as it would be if no reading of these legs had been heard."""
    log, whole = read_log(flown.log), replayed(flown.log)
    spans = [(leg.start_ms, leg.end_ms) for leg in whole.legs if leg.number in gone]
    with Recorder(out) as recorder:
        for name, data in log.attachments.items():
            recorder.attach(name, "text/plain", data)
        assert log.truth is not None
        recorder.truth(log.frames[0][0], log.truth)
        for received_ns, raw in log.frames:
            frame = parse_frame(raw, received_ns)
            assert frame is not None
            message = frame.message
            reading = message.get_type() == "NAMED_VALUE_FLOAT" and message.name == "THERMAL"
            if not (reading and any(start <= message.time_boot_ms <= end for start, end in spans)):
                recorder.frame(received_ns, raw)
        for each in log.estimates:
            recorder.estimate(log.frames[-1][0], each.estimate, each.legs_flown, each.final)
    return out


def replayed(path: Path) -> Replayed:
    return our_log(path, read_log(path)).flight(opened(path).mission, Assumed())


def answer(log: Path, *more: object) -> tuple[dict[str, Any], list[str]]:
    done = run("replay", log, "--sources", 2, "--json", *more)
    assert done.code == 0, done.err
    return done.object, [line.removeprefix("warning: ") for line in done.err.splitlines()]


def places(told: dict[str, Any]) -> np.ndarray:
    return np.array([source["position_m"] for source in told["sources"]])


@pytest.fixture(scope="module")
def middle(flown: Flown, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return without(flown, tmp_path_factory.mktemp("middle") / "flight.mcap", (2,))


@pytest.fixture(scope="module")
def first(flown: Flown, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return without(flown, tmp_path_factory.mktemp("first") / "flight.mcap", (1,))


def test_a_leg_in_the_middle(flown: Flown, middle: Path, tmp_path: Path) -> None:
    told, said = answer(middle)
    assert said == ["leg 2 of the mission has 0 readings: legs 3 to 7 are used, leg 1 here is its leg 3"]
    assert len(told["path"]["heading_rad"]) == 5
    alone, _ = answer(without(flown, tmp_path / "alone.mcap", (1, 2)))
    assert places(told).tolist() == places(alone).tolist()
    assert told["errors"] == alone["errors"]
    assert told["errors"]["sources_rms_m"] < 1.0, "truth begins where the legs used do"
    assert told["errors"]["path_rms_m"] < 1.0


def test_the_first_leg(first: Path) -> None:
    told, said = answer(first)
    assert said == ["leg 1 of the mission has 0 readings: legs 2 to 7 are used, leg 1 here is its leg 2"]
    assert told["errors"]["sources_rms_m"] < 0.5
    assert told["verdict"] == "IDENTIFIED"


def test_headings_of_the_plan_are_those_of_the_legs_used(flown: Flown, middle: Path) -> None:
    whole, _ = answer(flown.log, "--heading", "plan")
    told, _ = answer(middle, "--heading", "plan")
    assert told["gauge"] == "anchored"
    assert told["path"]["vertices_m"][0] == pytest.approx(whole["path"]["vertices_m"][2], abs=0.2)
    assert places(told) == pytest.approx(places(whole), abs=0.5)


def test_the_path_is_closed_no_longer(middle: Path, flown: Flown) -> None:
    told, _ = answer(middle, "--closed")
    assert told["reason"].endswith(NOT_CLOSED)
    assert places(told).tolist() == places(answer(middle)[0]).tolist()
    whole, _ = answer(flown.log, "--closed")
    assert NOT_CLOSED not in whole["reason"]


def test_the_map_has_the_sources_where_the_whole_flight_has_them(flown: Flown, middle: Path, tmp_path: Path) -> None:
    maps = []
    for name, log in (("whole", flown.log), ("middle", middle)):
        out = tmp_path / f"{name}.geojson"
        done = run("export", log, "--to", "geojson", "-o", out)
        assert done.code == 0, done.err
        features = json.loads(out.read_text())["features"]
        maps.append([f["geometry"]["coordinates"] for f in features if f["geometry"]["type"] == "Point"][:2])
    assert np.abs(np.array(maps[1]) - np.array(maps[0])).max() < 1e-5  # degrees: a metre


def test_what_was_known_under_way_of_other_legs_is_not_shown(flown: Flown, middle: Path, first: Path) -> None:
    known = [(e.legs_flown, e.estimate) for e in read_log(flown.log).estimates]
    assert known_then(known, replayed(middle).legs) == ()
    assert known_then(known, replayed(first).legs) == tuple(known)
    assert known_then(known, replayed(flown.log).legs) == tuple(known)


def test_truth_without_a_plan_is_of_other_legs(middle: Path) -> None:
    truth, legs = read_log(middle).truth, replayed(middle).legs
    assert truth_of(truth, None, legs) is None


def test_the_page_says_which_legs_are_used(middle: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    done = run("report", middle, "-o", page)
    assert done.code == 0, done.err
    assert "leg 2 of the mission has 0 readings: legs 3 to 7 are used" in page.read_text()
