"""`fly --adaptive`, from the first leg to the replay. What to propose is the adviser's own tests' affair."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from running import SCENE, Done, run, spawn_vehicle, stop

from dslam_mav.commands import launching, steering
from dslam_mav.log.reader import read_log
from dslam_mav.mav.mission import change, protocol, server
from dslam_mav.mission import leg_plan
from dslam_mav.records import Flight
from missions.adviser import Advice, Adviser
from missions.next_legs import Limits
from missions.plan_file import parse_plan
from sim_bridge.loopback.mission_service import MissionService

LEG_M = 24.0
TURN_RAD = math.radians(140.0)
PATH = [[0.0, 0.0], [24.0, 0.0], [4.34, 13.77], [12.55, -8.79], [20.76, 13.77]]
ADAPTIVE = ("--adaptive", "--sources", 2, "--ambient", 20, "--speedup", 4, "--json")


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(SCENE | {"path": {"vertices_m": PATH}}))
    return path


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Advice at once, and short waits: the flight is sped up."""
    monkeypatch.setattr(steering, "FIRST_ADVICE_S", 0.05)
    monkeypatch.setattr(steering, "TRANSFER_S", 0.2)
    monkeypatch.setattr(change, "PLACE_WAIT_S", 0.05)
    monkeypatch.setattr(protocol, "TIMEOUT_S", 0.5)


def advised(monkeypatch: pytest.MonkeyPatch, *, reached_after: int = 99) -> list[int]:
    """An adviser that always says the same; the list fills with how many legs it was asked after. It is told the turns
    that the mission has between them.
    """
    asked: list[int] = []

    def advise(_: Adviser, flight: Flight, limits: Limits, turn_rad: np.ndarray) -> Advice:
        asked.append(len(flight.legs))
        assert len(turn_rad) == len(flight.legs) - 1
        np.testing.assert_allclose(turn_rad[1:], TURN_RAD, atol=2e-3)
        if len(flight.legs) >= reached_after:
            return Advice((), (), 0.5, None, reached=True)
        n = max(1, round(limits.length_m / LEG_M))
        return Advice((TURN_RAD,) * n, (limits.length_m / n,) * n, 1.0, None, reached=False)

    monkeypatch.setattr(Adviser, "advise", advise)
    return asked


def fly(scene: Path, *words: object) -> Done:
    return run("fly", "--scene", scene, *ADAPTIVE, "--out", scene.parent / "logs", *words)


def path_of(done: Done) -> np.ndarray:
    return np.array(done.object["path"]["vertices_m"])


def held(done: Done) -> Any:
    """The mission the vehicle held last, by the log."""
    return leg_plan(parse_plan(read_log(Path(done.object["log"])).attachments["mission.waypoints"], "log").mission)


def assert_as_sure_as_said(done: Done) -> None:
    """Sped up, a leg may be bent by a change that came late (it is said): how sure four legs are depends on it."""
    off_m = np.array(done.object["errors"]["sources_m"])
    sd_m = np.array([source["sd_m"] for source in done.object["sources"]])
    assert (off_m < 4.0 * sd_m).all()
    assert done.object["errors"]["path_rms_m"] < 20.0 * sd_m.max()
    assert sd_m.max() < 1.0


def texts(done: Done) -> str:
    return "\n".join(text for _, _, text in read_log(Path(done.object["log"])).texts)


def test_the_vehicle_flies_what_is_proposed_and_replay_repeats_it(scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = advised(monkeypatch)
    done = fly(scene)
    assert done.code == 0, done.err
    assert asked[0] == 1
    assert "after leg 1: turn 140° left and fly 24 m" in texts(done)
    plan = held(done)
    turns = np.remainder(np.diff(plan.headings_rad), 2.0 * math.pi)
    np.testing.assert_allclose(turns, TURN_RAD, atol=2e-3)
    np.testing.assert_allclose(plan.lengths_m.sum(), 4 * LEG_M, atol=0.1)
    log = read_log(Path(done.object["log"]))
    assert log.truth is not None
    np.testing.assert_allclose(log.truth.vertices_m, plan.vertices_m)
    assert_as_sure_as_said(done)
    assert len(path_of(done)) == len(plan.vertices_m)
    assert run("replay", done.object["log"], "--json").object | {"report": done.object["report"]} == done.object


def test_a_change_that_fails_in_flight_leaves_the_old_mission_flying(
    scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    advised(monkeypatch)
    handle = MissionService.handle

    def refuses(self: MissionService, peer: Any, message: Any, now_s: float) -> Any:
        if message.get_type() == "MISSION_ITEM_INT" and message.seq == 5 and self._autopilot.in_mission:
            return []  # silence midway
        return handle(self, peer, message, now_s)

    monkeypatch.setattr(MissionService, "handle", refuses)
    monkeypatch.setattr(protocol, "RETRIES", 0)
    monkeypatch.setattr(server, "ITEM_TIMEOUT_S", 60.0)  # it does not ask again
    done = fly(scene)
    assert done.code == 0, done.err
    assert "the old mission stays and is flown on" in done.err
    np.testing.assert_allclose(held(done).vertices_m, PATH, atol=0.02)
    assert len(path_of(done)) == len(PATH)
    assert_as_sure_as_said(done)


def test_a_bug_in_the_adviser_does_not_end_the_flight_and_is_told(scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: Adviser, flight: Flight, limits: Limits, turn_rad: np.ndarray) -> Advice:
        raise ZeroDivisionError("of all things")

    monkeypatch.setattr(Adviser, "advise", broken)
    done = fly(scene)
    assert done.code == 0, done.err
    assert "of all things" in done.err
    np.testing.assert_allclose(held(done).vertices_m, PATH, atol=0.02)


def test_it_stops_where_every_source_is_as_sure_as_wanted_and_says_so(
    scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = advised(monkeypatch, reached_after=3)
    done = fly(scene, "--target-sd", 0.5)
    assert done.code == 0, done.err
    assert asked[-1] == 3
    assert "after leg 3: every source is known to 0.5 m, as wanted: no more legs" in texts(done)
    assert len(path_of(done)) == 4
    assert len(held(done).vertices_m) == 4


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--target-sd", 0.5), "--target-sd 0.5: only with --adaptive"),
        (("--adaptive", "--method", "paper"), "--method paper: legs are chosen by the joint estimate; expected joint"),
        (("--adaptive", "--distance", "plan"), "how far a leg is flown must be measured; expected odometry or speed"),
        (("--adaptive", "--heading", "plan"), "the plan changes in flight; expected none or vehicle"),
        (("--adaptive", "--closed"), "--adaptive with --closed: legs chosen in flight need not end where they began"),
        (("--adaptive", "--target-sd", -1), "argument --target-sd: '-1': expected a positive number"),
    ],
)
def test_what_does_not_go_together_is_one_line(scene: Path, words: tuple[object, ...], line: str) -> None:
    done = run("fly", "--scene", scene, "--out", scene.parent / "logs", *words)
    assert done.code == 2
    assert line in done.line()
    assert not (scene.parent / "logs").exists()


def test_logged_readings_cannot_follow_another_path(scene: Path, tmp_path: Path) -> None:
    readings = tmp_path / "readings.csv"
    readings.write_text("time_s,value\n0,1\n1,2\n")
    done = run("fly", "--readings", readings, "--adaptive", "--out", tmp_path / "logs")
    assert done.code == 2
    assert "logged readings are of the path they were taken on" in done.line()


SLOWER, AGAIN = "178\t1\t3\t-1\t0\t0\t0\t0", "177\t2\t3\t0\t0\t0\t0\t0"


def odd_plan(tmp_path: Path, between: str) -> Path:
    """Four corners with an item between the second and the third."""
    plan = tmp_path / "odd.waypoints"
    lines = ["0\t1\t0\t16\t0\t0\t0\t0\t47.3977\t8.5456\t488\t1", "1\t0\t3\t22\t0\t0\t0\t0\t0\t0\t10\t1"]
    corners = {2: (47.3977, 8.5456), 3: (47.3979, 8.5456), 5: (47.3979, 8.5459), 6: (47.3977, 8.5459)}
    lines += [f"{seq}\t0\t3\t16\t0\t0\t0\t0\t{x}\t{y}\t10\t1" for seq, (x, y) in corners.items()]
    lines.insert(4, f"4\t0\t2\t{between}\t1")
    plan.write_text("QGC WPL 110\n" + "\n".join(lines) + "\n")
    return plan


@pytest.mark.parametrize(
    ("between", "told"),
    [
        (SLOWER, "item 4 (DO_CHANGE_SPEED) with --adaptive: it would be lost"),
        (AGAIN, "item 4 (DO_JUMP) with --adaptive: items have other numbers"),
    ],
)
def test_a_mission_that_would_lose_an_item_is_refused_before_take_off(tmp_path: Path, between: str, told: str) -> None:
    plan = odd_plan(tmp_path, between)
    done = run("fly", plan, "--adaptive", "--sources", 2, "--out", tmp_path / "logs")
    assert (done.code, done.out) == (2, "")
    assert f"odd.waypoints: {told}" in done.line()
    assert not (tmp_path / "logs").exists()


def test_a_mission_in_the_vehicle_that_would_lose_an_item_is_refused_too(tmp_path: Path) -> None:
    process, url = spawn_vehicle("--speedup", 10)
    try:
        assert run("upload", odd_plan(tmp_path, SLOWER), "--connect", url).code == 0
        log = tmp_path / "flight.mcap"
        done = run("onboard", "--connect", url, "--out", log, "--sources", 2, "--adaptive")
    finally:
        stop(process)
    assert (done.code, done.out) == (2, "")
    assert "vehicle 1's mission: item 4 (DO_CHANGE_SPEED) with --adaptive" in done.line()
    assert not log.exists()


def test_without_a_word_on_its_pace_the_vehicle_leaves_time_for_proposals(
    scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ten times real time, as other flights are, every proposal would come too late."""
    advised(monkeypatch)
    begun: list[float] = []
    vehicle = launching.Vehicle

    def built(*words: Any, speedup: float, **more: Any) -> Any:
        begun.append(speedup)
        return vehicle(*words, speedup=8.0, **more)

    monkeypatch.setattr(launching, "Vehicle", built)
    for more in ((), ("--adaptive",), ("--adaptive", "--speedup", 3)):
        words = ("fly", "--scene", scene, "--sources", 2, "--ambient", 20, "--out", scene.parent / "logs", *more)
        assert run(*words).code == 0
    assert begun == [10.0, 1.0, 3.0]


def test_a_proposal_too_late_for_a_vehicle_in_a_hurry_says_so(scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    advised(monkeypatch)
    monkeypatch.setattr(steering, "TRANSFER_S", 20.0)
    done = fly(scene)
    assert done.code == 0, done.err
    told = (
        r"leg 1: the proposal came too late(: the vehicle's clock runs [34](\.\d)? times real time)?; the old mission"
    )
    assert re.search(told, done.err)
    assert "times real time" in done.err


def test_a_target_reached_with_the_last_leg_or_never_is_told(scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    advised(monkeypatch)
    done = fly(scene, "--target-sd", 8)
    assert "--target-sd 8: reached with the last leg: every source is known to " in texts(done)
    assert "--target-sd" not in done.err
    done = fly(scene, "--target-sd", 0.001)
    assert "--target-sd 0.001: not reached: the least sure source is known to " in done.err
