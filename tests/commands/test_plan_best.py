"""`plan --pattern best`, and fences: what is found, written, and suggested keeps within them."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from running import run

from dslam_mav.mission import Home, leg_vertices
from missions import best as searching
from missions.plan_fence import read_fence
from missions.plan_file import read_plan

FENCE: dict[str, Any] = {
    "fileType": "Plan",
    "version": 1,
    "geoFence": {
        "version": 2,
        "polygons": [
            {
                "inclusion": True,
                "version": 1,
                "polygon": [[47.3975, 8.5452], [47.3975, 8.5458], [47.3979, 8.5458], [47.3979, 8.5452]],
            }
        ],
        "circles": [{"inclusion": False, "version": 1, "circle": {"center": [47.3976, 8.5456], "radius": 3}}],
    },
    "mission": {"version": 2, "items": [], "plannedHomePosition": [47.3977, 8.5455, 488]},
}


@pytest.fixture
def fence(tmp_path: Path) -> Path:
    file = tmp_path / "fence.plan"
    file.write_text(json.dumps(FENCE))
    return file


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search with less care, where only what is asked for matters."""
    for name, value in {"STARTS": 4, "FINALISTS": 2, "ROUGHLY": 30, "TRAINING": 40, "CHOOSING": 60}.items():
        monkeypatch.setattr(searching, name, value)


def test_the_best_keeps_within_a_fence_and_the_file_keeps_the_fence(tmp_path: Path, fence: Path, quick: None) -> None:
    file = tmp_path / "best.plan"
    words = ("--fence", fence, "--spread", 6, "--turn", "30..150", "--margin", 1)
    done = run("plan", "--pattern", "best", *words, "-o", file, "--json")
    assert done.code == 0, done.err
    assert done.object["length_m"] == pytest.approx(22.4 * 6, rel=1e-3)
    mission = read_plan(file).mission
    geofence = read_fence(file)
    assert geofence.raw == FENCE["geoFence"]
    assert mission.home is not None
    assert mission.home.latitude_deg == 47.3977
    assert geofence.around(mission.home).lets_pass(leg_vertices(mission), 0.97)  # corners are rounded to a centimetre


def test_a_plan_that_leaves_the_fence_is_warned_of(fence: Path) -> None:
    done = run("plan", "--pattern", "star7", "--leg", 200, "--fence", fence, "--area", "100,100")
    assert "leaves the geofence" in done.err


def test_the_best_is_as_long_as_the_accuracy_wanted_asks(quick: None) -> None:
    words = ("plan", "--pattern", "best", "--target-sd", 0.8, "--json")
    said = run(*words).object
    assert said["predicted"]["source_error_m"]["median"] <= 0.8
    assert said["length_m"] < 224.0


def test_fences_that_leave_no_room(tmp_path: Path, fence: Path, quick: None) -> None:
    for words, named in (
        (("--spread", 100), "too small"),
        (("--spread", 10, "--legs", 3, "--length", 1000), "no path of 3 legs"),
        (("--spread", 10, "--margin", 40), "from its bounds"),
    ):
        done = run("plan", "--pattern", "best", "--fence", fence, *words)
        assert (done.code, done.out) == (2, "")
        assert f"--fence {fence}" in done.line()
        assert named in done.line()
    bare = tmp_path / "bare.plan"
    bare.write_text(json.dumps({**FENCE, "geoFence": {"version": 2, "polygons": [], "circles": []}}))
    assert "bare.plan: geoFence" in run("plan", "--pattern", "best", "--fence", bare).line()


def fence_of(file: Path) -> Any:
    return json.loads(file.read_text())["geoFence"]


def test_a_plan_that_is_read_and_written_keeps_its_fence(tmp_path: Path, fence: Path) -> None:
    bare, fenced, again = (tmp_path / f"{name}.plan" for name in ("bare", "fenced", "again"))
    run("plan", "-o", bare)
    assert run("plan", bare, "--fence", fence, "-o", fenced).code == 0
    assert fence_of(fenced) == FENCE["geoFence"]
    assert run("plan", fenced, "-o", again).code == 0
    assert fence_of(again) == FENCE["geoFence"]
    assert "cannot hold the geofence" in run("plan", fenced, "-o", tmp_path / "again.waypoints").err
    assert fence_of(bare)["polygons"] == []


def test_what_to_fly_instead_keeps_to_the_fence(fence: Path) -> None:
    words = ("plan", "--pattern", "lawnmower", "--leg", 32, "--sources", 3, "--fence", fence, "--spread", 10, "--json")
    open_field = json.loads(json.dumps(FENCE))
    open_field["geoFence"]["circles"] = []
    fence.write_text(json.dumps(open_field))
    better = run(*shlex.split(run(*words).object["instead"]["command"]), "--json").object
    assert read_fence(fence).around(Home(47.3977, 8.5455, 488.0)).lets_pass(np.array(better["vertices_m"]))
    strip = [[47.397, 8.5455], [47.397, 8.5456], [47.399, 8.5456], [47.399, 8.5455]]
    open_field["geoFence"]["polygons"][0]["polygon"] = strip
    fence.write_text(json.dumps(open_field))
    done = run(*words)
    assert done.object["instead"] is None
    assert "within these limits" in done.err


def test_turns_that_leave_no_path_that_sees_are_the_reason(quick: None) -> None:
    done = run("plan", "--pattern", "best", "--sources", 3, "--turn", "179..180", "--json")
    assert done.code == 0
    assert "--turn" in done.object["reason"]
    assert done.object["instead"] is None


def test_a_margin_wider_than_the_fence_is_refused_before_the_search(
    fence: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(searching, "best_path", None)
    done = run("plan", "--pattern", "best", "--fence", fence, "--spread", 10, "--margin", 25)
    assert (done.code, done.out) == (2, "")
    assert "--margin 25" in done.line()
