"""Readings in a table: replayed as a flight, or refused in one line."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from running import SCENE, run

from dslam_mav.flight_log import read_flight, read_log
from dslam_mav.log.recorder import Recorder
from dslam_mav.mission import Home
from missions.plan import Profile, plan_mission
from missions.plan_file import plan_bytes
from sim_bridge.fields.scene import SceneField, read_scene

GAS = Path(__file__).parents[3] / "shared" / "data" / "flights" / "nano_drone_gas_A_1.csv"
NAMES = "time_s=t:ms,value=gas*0.5,east_m=x:cm,north_m=y:cm"


@pytest.fixture(scope="module")
def table(tmp_path_factory) -> Path:
    """A flight over the scene at 5 m/s, in other units and columns of other names."""
    folder = tmp_path_factory.mktemp("table")
    (folder / "scene.json").write_text(json.dumps(SCENE))
    field = SceneField(read_scene(folder / "scene.json"))
    vertices = np.array(SCENE["path"]["vertices_m"])
    share = np.arange(0.0, 1.0, 1 / 64)[:, None]
    places = np.vstack([a + share * (b - a) for a, b in pairwise(vertices)] + [vertices[-1:]])
    time_s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))]) / 5.0
    value = field.read(time_s, places) + 0.02 * np.random.default_rng(1).standard_normal(time_s.size)
    rows = [
        f"{1e3 * t:.3f},{2 * v:.9g},{100 * x:.6f},{100 * y:.6f}"
        for t, v, (x, y) in zip(time_s, value, places, strict=True)
    ]
    path = folder / "flight.csv"
    path.write_text("t,gas,x,y\n" + "\n".join(rows) + "\n")
    mission = plan_mission(vertices, Home(47.0, 8.0), Profile(altitude_m=10.0, speed_m_s=5.0, hold_s=0.0))
    (folder / "flight.plan").write_bytes(plan_bytes(mission, ".plan"))
    return path


def test_legs_are_the_straight_pieces_of_the_track(table):
    flight = read_flight(table, columns=NAMES)
    corners = np.array(SCENE["path"]["vertices_m"])
    np.testing.assert_allclose(flight.lengths_m, np.linalg.norm(np.diff(corners, axis=0), axis=1), rtol=1e-3)
    assert flight.n_readings == 7 * 64


def test_the_sources_are_found_and_the_tables_directions_are_not_used(table, tmp_path):
    answers = []
    for columns in (NAMES, NAMES.replace("x:cm", "y*-1:cm").replace("north_m=y", "north_m=x")):  # turned by 90°
        done = run("replay", table, "--columns", columns, "--sources", "2", "--ambient", "20", "--json")
        assert done.code == 0, done.err
        answers.append(done.object)
    assert answers[0]["verdict"] == "IDENTIFIED"
    assert answers[0]["sources"] == answers[1]["sources"]
    found = np.array([source["position_m"] for source in answers[0]["sources"]])
    np.testing.assert_allclose(np.abs(found), np.abs([s["position_m"] for s in SCENE["sources"]]), atol=0.3)


def test_without_places_the_plan_is_taken_as_flown_at_constant_speed(table):
    plan = table.with_suffix(".plan")
    done = run("replay", table, "--columns", "time_s=t:ms,value=gas*0.5", "--plan", plan, "--sources", "2", "--json")
    assert done.code == 0, done.err
    assert "constant speed" in done.err
    assert len(done.object["path"]["vertices_m"]) == 8


def test_with_both_the_plan_tells_the_legs(table):
    plan = table.with_suffix(".plan")
    done = run("replay", table, "--columns", NAMES, "--plan", plan, "--sources", "2", "--heading", "plan", "--json")
    assert done.code == 0, done.err
    assert done.object["gauge"] == "anchored"


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["--columns", "time_s=t:ms,value=gas"], "no places: expected columns east_m and north_m, or give --plan FILE"),
        ([], "column time_s: missing, it has t, gas, x, y; --columns time_s=NAME says which it is"),
        (["--columns", NAMES, "--heading", "vehicle"], "has no headings; use --heading none or plan"),
        (["--columns", "time=t"], "expected FIELD=NAME with FIELD of"),
        (["--columns", NAMES.replace("cm", "m"), "--plan", "PLAN"], "expected metres from the plan's home"),
    ],
)
def test_what_is_lacking_is_said_in_one_line(table, words, wanted):
    done = run("replay", table, *[table.with_suffix(".plan") if word == "PLAN" else word for word in words])
    assert done.code == 2
    assert wanted in done.line()


def test_columns_are_of_tables_only(tmp_path):
    log = tmp_path / "flight.tlog"
    log.write_bytes(b"\x00" * 40)
    done = run("replay", log, "--columns", "value=x")
    assert (done.code, "expected with a CSV file" in done.line()) == (2, True)


@pytest.mark.skipif(not GAS.exists(), reason="the shared recordings are not here")
def test_a_recorded_gas_flight_becomes_a_flight():
    flight = read_flight(GAS, columns="time_s=Time:ms,value=Gas1L*-1,east_m=X,north_m=Y")
    assert len(flight.legs) >= 9
    assert flight.n_readings > 900
    done = run("info", GAS, "--columns", "time_s=Time:ms,value=Gas1L,east_m=X,north_m=Y", "--json")
    assert done.object == {"topics": {"readings": 1048, "places": 1048}, "duration_s": 104.7, "complete": True}


def test_a_log_made_of_a_table_is_its_flight_in_python_too(table, tmp_path):
    """`replay --set` keeps a table as an attachment: such a log has no packets."""
    path = tmp_path / "flight.set-1.mcap"
    with Recorder(path) as recorder:
        recorder.attach("recording.csv", "text/csv", table.read_bytes())
        recorder.attach("provenance.json", "application/json", json.dumps({"columns": NAMES}).encode())
    theirs, log = read_flight(table, columns=NAMES), read_log(path)
    assert log.readings.value.size == 7 * 64 + 1
    for legs in (log.legs, read_flight(path).legs):
        assert [leg.reading.tobytes() for leg in legs] == [leg.reading.tobytes() for leg in theirs.legs]
