"""`plan`: makes missions and looks at those that others drew."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from running import run

from dslam_mav.mission import leg_plan
from missions.plan_file import read_plan

MISSIONS = Path(__file__).parents[3] / "shared" / "data" / "missions"
PATTERNS = ("star7", "star5", "triangle", "square", "lawnmower", "spiral", "random")


@pytest.mark.parametrize("pattern", PATTERNS)
def test_every_pattern_can_be_planned_and_written(tmp_path: Path, pattern: str) -> None:
    for ending in (".plan", ".waypoints"):
        file = tmp_path / f"p{ending}"
        done = run("plan", "--pattern", pattern, "--leg", 20, "-o", file, "--json")
        assert done.code == 0
        assert done.err == "" if pattern.startswith("star") else done.err.startswith("warning: ")
        said = done.object
        assert {"predicted", "length_m", "verdict", "plan"} <= set(said)
        assert said["plan"] == str(file)
        legs = leg_plan(read_plan(file).mission)
        assert len(legs.lengths_m) == said["legs"]
        assert legs.lengths_m.sum() == pytest.approx(said["length_m"], abs=0.1)


def test_a_new_plan_replaces_an_old_one_whole(tmp_path: Path) -> None:
    file = tmp_path / "p.plan"
    run("plan", "--pattern", "star7", "-o", file)
    run("plan", "--pattern", "triangle", "-o", file)
    assert len(leg_plan(read_plan(file).mission).lengths_m) == run("plan", file, "--json").object["legs"]
    assert [path.name for path in tmp_path.iterdir()] == ["p.plan"]


def test_home_speed_and_legs_are_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "p.plan"
    done = run("plan", "--leg", 20, "--home", "-33.5,-70.25,12", "--centre", "-5,.5", "--speed", 3, "-o", file)
    assert done.code == 0, done.err
    mission = json.loads(file.read_text())["mission"]
    assert mission["plannedHomePosition"] == pytest.approx([-33.5, -70.25, 12.0])
    done = run("plan", file)
    assert done.out.startswith("p.plan: 7 legs, 140.0 m\n")
    assert done.out.count("left") + done.out.count("right") == 6


def test_the_same_seed_gives_the_same_random_plan() -> None:
    first, again, other = (run("plan", "--pattern", "random", "--seed", seed).out for seed in (1, 1, 2))
    assert first == again != other


@pytest.mark.skipif(not MISSIONS.exists(), reason=f"needs the recorded missions in {MISSIONS}")
@pytest.mark.parametrize(
    "name",
    [
        "qgroundcontrol_sample.plan",
        "qgroundcontrol_sample_with_survey.plan",
        "mission_planner_sample.txt",
        "sonoma_copter.waypoints",
    ],
)
def test_a_plan_somebody_else_drew(tmp_path: Path, name: str) -> None:
    done = run("plan", MISSIONS / name, "-o", tmp_path / "again.plan", "--json")
    assert done.code == 0
    assert all(line.startswith("warning: ") for line in done.err.splitlines())
    again = run("plan", tmp_path / "again.plan", "--json").object
    assert again["length_m"] == pytest.approx(done.object["length_m"], abs=0.1)


@pytest.mark.skipif(not MISSIONS.exists(), reason=f"needs the recorded missions in {MISSIONS}")
def test_a_plan_of_a_wrong_version() -> None:
    done = run("plan", MISSIONS / "qgroundcontrol_sample_wrong_mission_version.plan")
    assert done.code == 2
    assert "wrong_mission_version.plan" in done.line()
    assert "version" in done.line()
