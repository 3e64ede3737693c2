"""`plan` says how well a mission will see, what to fly instead, and finds the best; bad input is one line."""

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


def error_m(*words: object) -> float:
    said = run("plan", *words, "--json").object
    return float(said["predicted"]["source_error_m"]["median"])


def test_figures_answer_to_what_is_known() -> None:
    plain = error_m("--sources", 3)
    assert error_m("--sources", 2) < plain < error_m("--sources", 4)
    assert error_m("--sources", 3, "--heading-sd", 1) < plain
    assert error_m("--sources", 3, "--leg-sd", 0.5) > plain
    assert error_m("--sources", 3, "--ambient", "auto") > plain
    assert error_m("--sources", 3, "--spread", "9..11", "--area", "32,32") > error_m(
        "--sources", 3, "--spread", 10, "--area", "32,32"
    )
    assert error_m("--sources", 3, "--snr", 40) == pytest.approx(0.1 * plain, rel=1e-6)
    assert error_m("--sources", 3, "--noise-sd", 0.2) == pytest.approx(2.0 * error_m("--sources", 3, "--noise-sd", 0.1))
    assert error_m("--sources", 3, "--noise-sd", 0.2, "--peak", 2) == pytest.approx(
        error_m("--sources", 3, "--noise-sd", 0.1)
    )
    seldom, often = (error_m("--sources", 3, "--rate", rate, "--speed", 4) for rate in (2, 8))
    assert seldom == pytest.approx(2.0 * often, rel=0.05)
    assert error_m("--sources", 3, "--diffusivity", 0.5, "--age", 50, "--area", "32,32") > plain


def test_the_object_has_what_people_script_against() -> None:
    said = run("plan", "--sources", "2-3", "--json").object
    for name in ("source_error_m", "path_error_m", "source_error_aligned_m", "path_error_aligned_m"):
        figures = said["predicted"][name]
        assert 0.0 < figures["median"] < figures["p90"]
    assert said["predicted"]["unidentifiable_share"] == 0.0
    assert said["for"]["sources"] == [2, 3]
    assert said["simulated"] is None
    assert said["instead"] is None


def test_a_poor_plan_is_told_why_and_what_to_fly_instead(tmp_path: Path) -> None:
    file = tmp_path / "mower.plan"
    run("plan", "--pattern", "lawnmower", "-o", file)
    done = run("plan", file, "--sources", 3, "--json")
    assert done.code == 0
    assert "2 directions only" in done.line()
    assert done.object["reason"] in done.line()
    better = shlex.split(done.object["instead"]["command"])
    assert better[0] == "plan"
    star = run(*better, "--sources", 3, "--spread", 10, "--area", "32,32", "--json")
    assert star.err == ""
    assert star.object["length_m"] == pytest.approx(done.object["length_m"], rel=0.02)
    there, here = np.array(done.object["vertices_m"]), np.array(star.object["vertices_m"])
    middle = 0.5 * (there.min(axis=0) + there.max(axis=0))
    assert np.allclose(0.5 * (here.min(axis=0) + here.max(axis=0)), middle, atol=0.1)
    figure = done.object["instead"]["predicted"]["source_error_m"]["median"]
    assert star.object["predicted"]["source_error_m"]["median"] == pytest.approx(figure, rel=0.05)
    assert figure < 0.5 * done.object["predicted"]["source_error_m"]["median"]


def test_a_single_source_needs_a_compass() -> None:
    done = run("plan", "--sources", 1)
    assert "Blind" in done.out
    assert "--heading-sd" in done.line()
    assert run("plan", "--sources", 1, "--heading-sd", 3).err == ""


def test_missions_that_climb_are_written_and_read_in_space(tmp_path: Path) -> None:
    file = tmp_path / "climb.plan"
    made = run("plan", "--climb", 30, "--area", "20,20,10", "--sources", 2, "-o", file, "--json").object
    heights = np.array(made["vertices_m"])[:, 2]
    assert np.ptp(heights) == pytest.approx(32.0 * np.tan(np.pi / 6), abs=0.02)
    again = run("plan", file, "--dimensions", 3, "--area", "20,20,10", "--sources", 2, "--json").object
    assert again["predicted"] == made["predicted"]
    flat = run("plan", file, "--json").object
    assert flat["length_m"] < again["length_m"]


def test_simulated_missions_are_the_same_whoever_flies_them() -> None:
    words = ("plan", "--sources", "2-3", "--snr", 35, "--simulate", 4, "--json")
    flown = run(*words, "--workers", 1).object["simulated"]
    assert flown["flights"] == 4
    assert flown["unanswered_share"] == 0.0
    assert 0.0 <= flown["second_answer_share"] <= 1.0
    ratio = flown["source_error_m"]["median"] / flown["predicted_source_error_m"]["median"]
    assert 0.2 < ratio < 5.0
    assert flown == run(*words, "--workers", 2).object["simulated"]


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


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--sources", 0), "'0'"),
        (("--sources", "3-2"), "'3-2'"),
        (("--sources", "2-9"), "'2-9'"),
        (("--noise-sd", -1), "'-1'"),
        (("--noise-sd", 1, "--snr", 20), "--snr"),
        (("--spread", "3..2"), "'3..2'"),
        (("--spread", 0), "'0'"),
        (("--spread", 0.001), "--spread"),
        (("--age", 5), "--diffusivity"),
        (("--age", 5, "--diffusivity", 1, "--spread", 3), "--spread"),
        (("--sources", 8, "--area", "10,10"), "--sources 8"),
        (("--area", "10"), "--area 10"),
        (("--area", "10,-5"), "--area 10,-5"),
        (("--climb", 90), "'90'"),
        (("--simulate", 0), "'0'"),
        (("--layouts", 0), "'0'"),
        (("--target-sd", 0.001), "out of reach"),
        (("--length", 100), "--pattern best"),
        (("--turn", 90), "--pattern best"),
        (("--pattern", "best", "--target-sd", 0.001), "out of reach"),
        (("--pattern", "best", "--turn", "0..10"), "--turn 0..10"),
        (("--pattern", "best", "--turn", "90..200"), "'90..200'"),
        (("--pattern", "best", "--leg", 10), "--leg 10"),
        (("--pattern", "best", "--legs", 2), "--legs 2"),
        (("--pattern", "best", "--legs", 99), "--legs 99"),
        (("--pattern", "best", "--length", 0.2), "--length 0.2"),
        (("--pattern", "best", "--climb", 10), "--climb"),
        (("--pattern", "best", "--closed"), "--closed"),
        (("--pattern", "best", "--fence", "none.plan"), "none.plan"),
    ],
)
def test_what_cannot_be_is_one_line(words: tuple[object, ...], named: str) -> None:
    done = run("plan", *words)
    assert (done.code, done.out) == (2, "")
    assert named in done.line()


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


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--snr", 5000), "--snr"),
        (("--snr", -5000), "--snr"),
        (("--noise-sd", 1e200), "--noise-sd"),
        (("--noise-sd", 1e-200), "--noise-sd"),
        (("--leg-sd", 1e200), "--leg-sd"),
        (("--leg-sd", 1e-200), "--leg-sd"),
        (("--peak", 1e-200), "--peak"),
        (("--heading-sd", 1e-200), "--heading-sd"),
        (("--spacing", 1e-200), "--spacing"),
        (("--rate", 1e300), "--rate"),
        (("--speed", 1e300), "--speed"),
        (("--diffusivity", 1e300, "--age", 1e10), "--diffusivity"),
        (("--diffusivity", 1e12, "--age", 1e10), "--age"),
        (("--area", "5e5,5e5"), "--snr"),
        (("--area", "5e8,5e8"), "--area"),
        (("--spacing", 1e-6, "--simulate", 1), "--simulate"),
    ],
)
def test_numbers_out_of_range_are_named_with_what_was_expected(words: tuple[object, ...], named: str) -> None:
    done = run("plan", "--sources", 3, *words)
    assert (done.code, done.out) == (2, "")
    assert named in done.line()
    assert "expected" in done.line()


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize(
    "words",
    [
        ("--area", "3000,3000"),
        ("--noise-sd", 1e15, "--peak", 1e-15),
        ("--noise-sd", 1e-15, "--peak", 1e15, "--leg-sd", 1e-6, "--heading-sd", 1e-6),
        ("--spread", 1e5, "--area", "1e7,1e7", "--noise-sd", 1e-15),
        ("--snr", 200, "--leg-sd", 1e7),
    ],
)
def test_numbers_at_the_ends_of_their_ranges_have_a_verdict(words: tuple[object, ...]) -> None:
    done = run("plan", "--sources", 3, *words, "--json")
    assert done.code == 0, done.err
    assert all(line.startswith("warning: ") for line in done.err.splitlines())
    assert done.object["verdict"]


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


def test_what_to_fly_instead_is_centred_to_a_decimetre() -> None:
    said = run("plan", "--pattern", "lawnmower", "--sources", 3, "--centre", "1234.56,-2345.67", "--json").object
    assert "--centre 1234.6,-2345.7" in said["instead"]["command"]


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
