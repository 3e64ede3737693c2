"""`replay` repeats a flight bit for bit, whatever was assumed and wherever home was."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import flown as frames_of
import pytest
from fakes import mission
from running import run

from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.assume import recorded_configuration
from dslam_mav.commands.attached import (
    CONFIGURATION_ATTACHMENT,
    MISSION_ATTACHMENT,
    as_logged,
    attach,
    logged_mission,
)
from dslam_mav.errors import BadInputError
from dslam_mav.log.reader import read_log
from dslam_mav.log.recorder import Recorder
from dslam_mav.mission import Home, leg_plan, with_home_item

ODD_HOME = [47.39774261938527, 8.545593799129643, 488.123456789]


@pytest.mark.parametrize("heading", ["none", "vehicle", "plan"])
@pytest.mark.parametrize("distance", ["odometry", "speed", "plan"])
def test_replay_is_the_flight_bit_for_bit(scene: Path, tmp_path: Path, distance: str, heading: str) -> None:
    plan = tmp_path / "odd.plan"
    assert run("plan", "--leg", 16, "-o", plan).code == 0
    body = json.loads(plan.read_text())
    body["mission"]["plannedHomePosition"] = ODD_HOME
    for item in body["mission"]["items"]:
        if item["command"] == 16:
            item["params"][4] += ODD_HOME[0] - 47.397742
            item["params"][5] += ODD_HOME[1] - 8.545594
    plan.write_text(json.dumps(body))
    assumed = ("--sources", 2, "--distance", distance, "--heading", heading)
    done = run("fly", plan, "--scene", scene, *assumed, "--out", tmp_path / "logs", "--speedup", 60, "--json")
    flown = done.object
    assert flown["verdict"] not in ("TOO_FEW_DATA", "NOT_CONVERGED"), done.err
    assert (flown["gauge"] == "anchored") is (heading != "none")
    assert run("replay", flown["log"], "--json").object | {"report": flown["report"]} == flown


@pytest.mark.parametrize("home_item", [True, False])
def test_the_mission_used_is_the_one_a_log_gives_back(tmp_path: Path, home_item: bool) -> None:
    held = replace(mission(), home=Home(*ODD_HOME[:2], 5.25))
    held = with_home_item(held) if home_item else held
    used = as_logged(held)
    assert used.items == held.items  # so that numbers are those of the wire, on PX4 as well
    assert leg_plan(used).sequence == leg_plan(held).sequence
    with Recorder(tmp_path / "a.mcap") as recorder:
        attach(recorder, used, Assumptions(), 7)
    log = read_log(tmp_path / "a.mcap")
    recorded = recorded_configuration(log.attachments[CONFIGURATION_ATTACHMENT], "a")
    assert (recorded.vehicle_system, recorded.home_item) == (7, home_item)
    assert logged_mission(log.attachments[MISSION_ATTACHMENT], "a", home_item=recorded.home_item) == used
    assert leg_plan(as_logged(used)).vertices_m.tobytes() == leg_plan(used).vertices_m.tobytes()


def test_replay_is_of_the_vehicle_that_was_flown(tmp_path: Path) -> None:
    log = tmp_path / "two.mcap"
    configuration = json.dumps({"assumptions": {"n_sources": 1}, "vehicle_system": 9}).encode()
    with Recorder(log) as recorder:
        recorder.attach(CONFIGURATION_ATTACHMENT, "application/json", configuration)
        for frame in frames_of.fly().frames:
            recorder.frame(frame.received_ns, frame.raw)
    done = run("replay", log)
    assert done.code == 2
    assert "two.mcap: no THERMAL readings" in done.line()  # of vehicle 9, whoever else is in the log


@pytest.mark.parametrize("system", ["nine", 0, 256, True, 1.5])
def test_a_system_that_is_none_is_refused(system: object) -> None:
    body = json.dumps({"assumptions": {}, "vehicle_system": system}).encode()
    with pytest.raises(BadInputError, match=r"configuration.json: vehicle_system .*: expected 1 to 255"):
        recorded_configuration(body, "a.mcap")
