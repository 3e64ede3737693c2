"""`plan` says how well a mission will see, and what to fly instead."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from running import run

from sim_bridge.vehicle import DEFAULT_HOME


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
    star = run(*better, "--json")
    assert star.err == ""
    assert star.object["length_m"] == pytest.approx(done.object["length_m"], rel=0.02)
    there, here = np.array(done.object["vertices_m"]), np.array(star.object["vertices_m"])
    middle = 0.5 * (there.min(axis=0) + there.max(axis=0))
    assert np.allclose(0.5 * (here.min(axis=0) + here.max(axis=0)), middle, atol=0.1)
    assert star.object["predicted"] == done.object["instead"]["predicted"]
    figure = star.object["predicted"]["source_error_m"]["median"]
    assert figure < 0.5 * done.object["predicted"]["source_error_m"]["median"]


@pytest.mark.parametrize(
    "asked",
    [
        "--sources 2-4 --spread 8..12 --noise-sd 0.05 --rate 10 --ambient auto --centre -20,-30 --layouts 60 --seed 3",
        "--sources 3 --diffusivity 0.5 --age 30..60 --peak 4 --noise-sd 0.2 --spacing 0.7 --speed 3 --area 40,25",
        "--sources 2 --leg 50 --snr 26 --leg-sd 0.2 --first-heading 30 --target-sd 40",
        "--sources 2 --dimensions 2 --climb 20 --altitude 15 --hold 1 --home -33.5,151.2,20",
    ],
)
def test_the_command_for_what_to_fly_instead_holds_all_that_was_asked(asked: str, tmp_path: Path) -> None:
    words = ["plan", "--pattern", "lawnmower", *asked.split(), "-o", tmp_path / "a b.plan"]
    done = run(*words, "--json")
    instead = done.object["instead"]
    star = run(*shlex.split(instead["command"]), "--json").object
    assert star["predicted"] == instead["predicted"]
    assert f"{instead['predicted']['source_error_m']['median']:.2g} m: {instead['command']}" in done.err
    mower, other = done.object["for"], star["for"]
    assert [other[name] for name in ("sources", "layouts", "seed")] == [
        mower[name] for name in ("sources", "layouts", "seed")
    ]
    for name in ("spread_m", "noise_sd", "readings_per_m", "area_m"):
        assert other[name] == pytest.approx(mower[name], rel=0.01)
    assert star["plan"] == str(words[-1])


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


def test_what_to_fly_instead_is_centred_to_a_decimetre() -> None:
    said = run("plan", "--pattern", "lawnmower", "--sources", 3, "--centre", "1234.56,-2345.67", "--json").object
    assert "--centre 1234.6,-2345.7" in said["instead"]["command"]


def fenced(tmp_path: Path, change: Any) -> Path:
    """A lawnmower in a fence of its own, which `change` spoils."""
    plan = tmp_path / "mower.plan"
    run("plan", "--pattern", "lawnmower", "--centre", "0,0", "-o", plan)
    root = json.loads(plan.read_text())
    north, east = 30.0 / 111_190.0, 30.0 / 75_260.0
    corners = [(-1, -1), (-1, 1), (1, 1), (1, -1)]
    outline = [[DEFAULT_HOME.latitude_deg + a * north, DEFAULT_HOME.longitude_deg + b * east] for a, b in corners]
    zones = {"version": 2, "polygons": [{"inclusion": True, "version": 1, "polygon": outline}], "circles": []}
    change(zones)
    plan.write_text(json.dumps({**root, "geoFence": zones}))
    return plan


def keep_out(zones: dict[str, Any]) -> None:
    """About the middle, between two lanes of the mower."""
    centre = [DEFAULT_HOME.latitude_deg, DEFAULT_HOME.longitude_deg]
    zones["circles"] = [{"circle": {"center": centre, "radius": 2.0}, "inclusion": False, "version": 1}]


def test_what_to_fly_instead_keeps_to_the_plans_own_geofence(tmp_path: Path) -> None:
    plan = fenced(tmp_path, keep_out)
    instead = run("plan", plan, "--sources", 3, "--spread", 10, "--json").object["instead"]
    words = shlex.split(instead["command"])
    assert words[-2:] == ["--fence", str(plan)]
    star = run(*words, "--json")
    assert (star.code, star.err) == (0, "")
    assert star.object["predicted"] == instead["predicted"]
    middle_m = np.array(star.object["vertices_m"])
    steps = np.linspace(middle_m[:-1], middle_m[1:], 200)
    assert np.linalg.norm(steps, axis=2).min() > 2.0
    assert np.abs(middle_m).max() < 30.1


def test_a_plan_that_leaves_its_own_geofence_is_told_so_and_one_nobody_understands_is_no_obstacle(
    tmp_path: Path,
) -> None:
    assert "leaves its own geofence" not in run("plan", fenced(tmp_path, keep_out), "--sources", 3).err

    def small(zones: dict[str, Any]) -> None:
        zones["circles"] = [
            {"circle": {"center": zones["polygons"][0]["polygon"][0], "radius": 25.0}, "inclusion": True}
        ]

    assert "mower.plan leaves its own geofence" in run("plan", fenced(tmp_path, small), "--sources", 3).err

    def odd(zones: dict[str, Any]) -> None:
        zones["polygons"][0]["polygon"] = "all over"

    done = run("plan", fenced(tmp_path, odd), "--sources", 3)
    assert done.code == 0
    assert "geoFence.polygons[0].polygon" in done.err
    assert "what is advised does not keep to this geofence" in done.err
