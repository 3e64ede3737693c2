"""What is taken out of a log: tables, packets, maps; and the flight under other assumptions."""

from __future__ import annotations

import hashlib
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pymap3d
import pytest
from flown import fly
from running import left, run

from dslam_mav import read_log
from dslam_mav.export import table as tables
from dslam_mav.export.anchor import circle_radius_m
from dslam_mav.log.recorder import Recorder
from dslam_mav.mav.tlog import read_tlog
from dslam_mav.mission import Home, Mission, MissionItem, enu_to_e7, home_item
from missions.plan_file import plan_bytes

HOME = Home(-35.363262, 149.165237, 584.0)
STAR = [  # north, east: seven legs of 30 m, the first to the north and a little to the east
    (15.4 * math.cos(turn) + 14.0, 15.4 * math.sin(turn) + 5.0)
    for turn in (3.6 + 6.0 * math.pi * k / 7.0 for k in range(8))
]
SOURCE = np.array([9.0, 12.0])  # east, north; the larger of two


def value(north_m: float, east_m: float) -> float:
    here = [5.0, 3.5], [(12.0, 9.0), (19.0, -3.0)]
    return 20.0 + sum(
        a * math.exp(-((north_m - n) ** 2 + (east_m - e) ** 2) / 64.0) for a, (n, e) in zip(*here, strict=True)
    )


KML = "{http://www.opengis.net/kml/2.2}"
EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "three_plots.py"


@pytest.fixture(scope="module")
def flight(tmp_path_factory) -> Path:
    """A log with its plan, 7 m east and 4 m south of where home is, and no estimate yet."""
    rng = np.random.default_rng(5)
    flown = fly(STAR, value=lambda north_m, east_m: value(north_m, east_m) + rng.normal(0.0, 0.02))
    places = [enu_to_e7(east + 7.0, north - 4.0, HOME) for north, east in STAR]
    items = [home_item(HOME), *(MissionItem(16, 3, (0, 0, 0, 0), *place, 10.0) for place in places)]
    path = tmp_path_factory.mktemp("flight") / "flight.mcap"
    with Recorder(path) as recorder:
        recorder.attach("mission.waypoints", "text/plain", plan_bytes(Mission(tuple(items), HOME), ".waypoints"))
        for frame in flown.frames:
            recorder.frame(frame.received_ns + 10**18, frame.raw)
    return path


@pytest.fixture(scope="module")
def answered(flight) -> Path:
    """The same flight with an answer, as `replay --set` writes it."""
    done = run("replay", flight, "--sources", "2", "--set", "ambient=20", "--json")
    assert done.code == 0, done.err
    return Path(done.object["log"])


def truth_wgs84(home: Home = HOME, shift: tuple[float, float] = (7.0, -4.0)) -> tuple[float, float]:
    east, north = SOURCE + shift
    lat, lon, _ = pymap3d.enu2geodetic(east, north, 0.0, home.latitude_deg, home.longitude_deg, 0.0)
    return float(lon), float(lat)


def metres_apart(a, b) -> float:
    east, north, _ = pymap3d.geodetic2enu(a[1], a[0], 0.0, b[1], b[0], 0.0)
    return math.hypot(east, north)


def test_what_was_set_is_in_a_log_of_its_own_with_where_it_comes_from(flight, answered):
    assert answered == flight.with_name("flight.set-1.mcap")
    log = read_log(answered)
    told = json.loads(log.attachments["provenance.json"])
    assert told["log"] == "flight.mcap"
    assert told["sha256"] == hashlib.sha256(flight.read_bytes()).hexdigest()
    assert told["set"] == {"ambient": "20"}
    assert log.frames == read_log(flight).frames
    assert log.complete
    assert log.estimates[-1].final
    again = run("replay", answered, "--json").object
    assert again["sources"][0]["position_m"] == log.estimates[-1].estimate.sources.position_m[0].tolist()


def test_both_answers_are_shown_and_the_next_log_takes_the_next_number(answered, tmp_path):
    path = tmp_path / "flight.mcap"
    path.write_bytes(answered.read_bytes())
    done = run("replay", path, "--set", "spread=8")
    assert done.code == 0, done.err
    assert "before" in done.out
    assert "spread=8" in done.out
    done = run("replay", path, "--set", "spread=8", "--json").object
    assert done["log"] == str(tmp_path / "flight.set-2.mcap")
    assert done["before"]["sources"] != done["sources"]
    assert done["set"] == {"spread": "8"}
    told = json.loads(read_log(done["log"]).attachments["provenance.json"])
    assert told["made_from"]["set"] == {"ambient": "20"}


@pytest.mark.parametrize("setting", ["colour=red", "spread", "spread=-1", "activation=3", "heading=north", "closed=2"])
def test_a_setting_that_is_none_is_one_line_and_no_log(flight, setting):
    before = left(flight.parent)
    done = run("replay", flight, "--set", setting)
    assert done.code == 2
    assert f"--set {setting}" in done.line()
    assert left(flight.parent) == before


def test_the_table_holds_every_reading_and_reads_back(answered, tmp_path):
    out = tmp_path / "flight.csv"
    assert run("export", answered, "--to", "csv", "-o", out).code == 0
    log, frame = read_log(answered), pd.read_csv(out)
    np.testing.assert_array_equal(frame["value"], log.readings.value)
    np.testing.assert_array_equal(frame["time_s"], log.readings.time_s)
    for number, leg in enumerate(log.legs, 1):
        np.testing.assert_array_equal(frame.loc[frame["leg"] == number, "distance_m"], leg.distance_m)
    assert run("export", answered, "--to", "parquet", "-o", tmp_path / "flight.parquet").code == 0
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "flight.parquet"), frame, check_dtype=False)
    pd.testing.assert_frame_equal(log.readings_frame(), frame, check_dtype=False)
    assert log.legs_frame()["n_readings"].tolist() == [leg.reading.size for leg in log.legs]
    assert len(log.estimates_frame()) == 2
    assert log.truth_frame().empty


def test_packets_leave_as_a_tlog_with_nothing_lost(flight, tmp_path):
    out = tmp_path / "flight.tlog"
    assert run("export", flight, "--to", "tlog", "-o", out).code == 0
    held = read_log(flight).frames
    assert [(f.received_ns, f.raw) for f in read_tlog(out)] == [(t // 1000 * 1000, raw) for t, raw in held]


def test_nothing_is_overwritten_but_when_asked_to(flight, tmp_path):
    out = tmp_path / "out.csv"
    out.write_text("mine")
    done = run("export", flight, "--to", "csv", "-o", out)
    assert (done.code, "exists already" in done.line(), out.read_text()) == (2, True, "mine")
    assert run("export", flight, "--to", "csv", "-o", out, "--overwrite").code == 0
    assert out.read_text().startswith("time_s,")
    log = run("export", flight, "--to", "tlog", "-o", flight, "--overwrite")
    assert (log.code, "the log itself" in log.line()) == (2, True)


def test_without_pyarrow_one_line_says_what_to_install(flight, tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "find_spec", lambda name: None)
    done = run("export", flight, "--to", "parquet", "-o", tmp_path / "a.parquet")
    assert (done.code, "dslam-mav[parquet]" in done.line(), left(tmp_path)) == (2, True, set())


def test_geojson_lies_where_the_plan_says(answered, tmp_path):
    out = tmp_path / "a.geojson"
    assert run("export", answered, "--to", "geojson", "-o", out).code == 0
    features = json.loads(out.read_text())["features"]
    first = [f for f in features if f["properties"]["solution"] == "answer" and f["properties"].get("source") != 2]
    kinds = {f["properties"]["kind"]: f for f in first}
    source, circle, path = kinds["source"], kinds["accuracy"], kinds["path"]
    assert metres_apart(source["geometry"]["coordinates"], truth_wgs84()) < 1.0
    (ring,) = circle["geometry"]["coordinates"]
    assert ring[0] == ring[-1]
    lon, lat = np.array(ring).T
    assert np.sum(lon[:-1] * lat[1:] - lon[1:] * lat[:-1]) > 0.0, "the right-hand rule: counter-clockwise"
    radius = [metres_apart(corner, source["geometry"]["coordinates"]) for corner in ring]
    np.testing.assert_allclose(radius, circle["properties"]["radius_95_m"], atol=0.003)
    begin = pymap3d.enu2geodetic(STAR[0][1] + 7.0, STAR[0][0] - 4.0, 0.0, HOME.latitude_deg, HOME.longitude_deg, 0.0)
    assert metres_apart(path["geometry"]["coordinates"][0], (begin[1], begin[0])) < 0.05
    assert not any(f["properties"]["mirror_image"] for f in features)


def test_kml_has_the_same_places(answered, tmp_path):
    out = tmp_path / "a.kml"
    assert run("export", answered, "--to", "kml", "-o", out).code == 0
    root = ET.parse(out).getroot()
    assert root.tag == f"{KML}kml"
    (folder, *_) = root.iter(f"{KML}Folder")
    point = folder.find(f".//{KML}Point/{KML}coordinates")
    assert metres_apart([float(x) for x in point.text.split(",")], truth_wgs84()) < 1.0
    ring = folder.find(f".//{KML}LinearRing/{KML}coordinates").text.split()
    assert len(ring) > 30
    assert ring[0] == ring[-1]


def test_without_a_plan_home_and_heading_place_it_and_the_mirror_image_is_marked(answered, tmp_path):
    tlog = tmp_path / "flight.tlog"
    run("export", answered, "--to", "tlog", "-o", tlog)
    words = ["export", tlog, "--set", "sources=2", "--set", "ambient=20", "--to", "geojson", "--overwrite"]
    assert "give --home LAT,LON" in run(*words).line()
    assert "give --heading DEG" in run(*words, "--home", "47.5,8.5").line()
    assert left(tmp_path) == {"flight.tlog"}
    placed = [
        *words,
        "--home",
        "47.5,8.5",
        "--heading",
        math.degrees(math.atan2(STAR[1][1] - STAR[0][1], STAR[1][0] - STAR[0][0])),
    ]
    assert run(*placed).code == 0
    features = json.loads((tmp_path / "flight.geojson").read_text())["features"]
    largest = [f for f in features if f["properties"].get("source") == 1 and f["properties"]["kind"] == "source"]
    points = {f["properties"]["mirror_image"]: f for f in largest}
    near = [
        metres_apart(points[m]["geometry"]["coordinates"], truth_wgs84(Home(47.5, 8.5), (-STAR[0][1], -STAR[0][0])))
        for m in (0, 1)
    ]
    assert min(near) < 1.0 < max(near)
    assert "mirror image" in points[True]["properties"]["name"]
    assert run(*placed, "--turn", "right").code == 0  # from leg 1 northwards to the south-east
    point, *_ = json.loads((tmp_path / "flight.geojson").read_text())["features"]
    assert (
        metres_apart(point["geometry"]["coordinates"], truth_wgs84(Home(47.5, 8.5), (-STAR[0][1], -STAR[0][0]))) < 1.0
    )


@pytest.mark.parametrize("sds", [(1.0, 1.0), (3.0, 1.0), (2.0, 0.0)])
def test_the_circle_holds_95_percent(sds):
    errors = np.random.default_rng(2).standard_normal((200_000, 2)) * sds
    inside = (np.linalg.norm(errors, axis=1) < circle_radius_m(np.diag(sds) ** 2)).mean()
    assert inside == pytest.approx(0.95, abs=0.003)


def test_the_example_makes_its_plots(answered, tmp_path):
    out = tmp_path / "plots.png"
    environment = {**os.environ, "MPLBACKEND": "Agg", "PYTHONPATH": str(EXAMPLE.parents[2])}
    subprocess.run([sys.executable, EXAMPLE, answered, out], check=True, env=environment, cwd=EXAMPLE.parents[2])
    assert out.read_bytes().startswith(b"\x89PNG")
