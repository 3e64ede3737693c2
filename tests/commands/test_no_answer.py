"""Readings that carry no answer: a verdict in words, one line, exit 1, and the log is there."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import flown as frames_of
import pytest
from running import SCENE, run, the_log

from dslam_mav.log.reader import read_log
from dslam_mav.log.recorder import Recorder
from dslam_mav.mav.frames import Frame


def flight(scene: Path, tmp_path: Path, *more: object) -> Any:
    return run("fly", "--scene", scene, "--out", tmp_path / "logs", "--speedup", 60, "--json", *more)


def test_more_sources_than_the_legs_can_carry(tmp_path: Path) -> None:
    scene = tmp_path / "two_legs.json"
    path = {"vertices_m": [[0, 0], [16, 0], [1.6, 7]]}
    scene.write_text(json.dumps({**SCENE, "path": path}))
    done = flight(scene, tmp_path, "--sources", 8)
    assert done.code == 1
    assert done.object["verdict"] == "TOO_FEW_DATA"
    assert "2 legs can be used; 8 sources need at least 3" in done.line()
    assert (
        done.object["sources"]
        == [{"position_m": [None, None], "amplitude": None, "peak_reading": None, "activation_s": None, "sd_m": None}]
        * 8
    )
    assert Path(done.object["report"]).exists()
    assert read_log(the_log(tmp_path / "logs")).complete


def test_without_json_the_verdict_is_shown_and_the_reason_told_once(tmp_path: Path) -> None:
    scene = tmp_path / "two_legs.json"
    scene.write_text(json.dumps({**SCENE, "path": {"vertices_m": [[0, 0], [16, 0], [1.6, 7]]}}))
    done = run("fly", "--scene", scene, "--out", tmp_path / "logs", "--speedup", 60, "--sources", 8)
    assert done.code == 1
    assert "TOO_FEW_DATA: Too few legs or readings" in done.out
    assert (done.out + done.err).count("2 legs can be used") == 1
    assert done.line().startswith("dslam-mav: no position can be given: 2 legs")
    assert str(the_log(tmp_path / "logs")) in done.out


def test_a_field_that_is_the_same_everywhere(flown: Any, tmp_path: Path) -> None:
    csv = tmp_path / "stuck.csv"
    csv.write_text("time_s,value\n" + "".join(f"{k * 0.1:.1f},21.5\n" for k in range(600)))
    done = run("fly", flown.plan, "--readings", csv, "--sources", 2, "--out", tmp_path / "logs", "--speedup", 60)
    assert done.code == 1
    assert "NOT_IDENTIFIABLE" in done.out
    assert done.err.splitlines()[-1].startswith("dslam-mav: no position can be given: All ")
    assert "21.5" in done.err
    assert "Traceback" not in done.err


def value_at(north_m: float, east_m: float) -> float:
    far, near = (north_m - 12) ** 2 + (east_m - 9) ** 2, (north_m - 20) ** 2 + (east_m - 2) ** 2
    return 20.0 + 5.0 * math.exp(-far / 100.0) + 3.0 * math.exp(-near / 100.0)


def logged(path: Path, value: Callable[[float, float], float], keep: Callable[[Frame], bool] = lambda _: True) -> Path:
    """The log of a flight of four legs through a field."""
    with Recorder(path) as recorder:
        for frame in frames_of.fly(value=value).frames:
            if keep(frame):
                recorder.frame(frame.received_ns, frame.raw)
    return path


def test_readings_that_are_no_number(tmp_path: Path) -> None:
    log = logged(tmp_path / "nan.mcap", lambda north, east: math.nan)
    done = run("replay", log, "--sources", 2)
    assert (done.code, done.out) == (2, "")
    assert "nan.mcap: none of the THERMAL readings is a finite number" in done.line()


def test_some_readings_that_are_no_number_are_told_and_left_out(tmp_path: Path) -> None:
    log = logged(tmp_path / "some.mcap", lambda n, e: math.nan if 14 < n < 15 else value_at(n, e))
    done = run("replay", log, "--sources", 2, "--json")
    assert done.code == 0, done.err
    assert "not finite" in done.line()
    assert len(done.object["sources"]) == 2


@pytest.mark.parametrize(
    ("legs", "said", "why"),
    [
        (
            (1,),
            ["leg 2 has 0 readings: legs 3 to 4 are used, leg 1 here is leg 3"],
            "2 legs can be used; 2 sources need",
        ),
        ((2,), ["leg 3 has 0 readings: legs 1 to 2 are used"], "2 legs can be used; 2 sources need at least 3"),
        ((1, 2), ["leg 2 of 4 has no readings", "leg 3 of 4 has no readings"], "Leg 2 has 0 readings"),
    ],
)
def test_legs_without_readings(tmp_path: Path, legs: tuple[int, ...], said: list[str], why: str) -> None:
    flight_flown = frames_of.fly(value=value_at)
    gone = {ms for ms, (j, _) in flight_flown.distance_m.items() if j in legs}

    def keep(frame: Frame) -> bool:
        return frame.message.get_type() != "NAMED_VALUE_FLOAT" or frame.message.time_boot_ms not in gone

    log = logged(tmp_path / "gap.mcap", value_at, keep)
    done = run("replay", log, "--sources", 2)
    assert done.code == 1
    assert "TOO_FEW_DATA" in done.out
    *warnings, last = done.err.splitlines()
    assert warnings == [f"warning: {line}" for line in said]
    assert last.startswith(f"dslam-mav: no position can be given: {why}")


def test_a_log_without_any_reading(tmp_path: Path) -> None:
    log = logged(tmp_path / "mute.mcap", value_at, lambda frame: frame.message.get_type() != "NAMED_VALUE_FLOAT")
    done = run("replay", log)
    assert (done.code, done.out) == (2, "")
    assert "mute.mcap: no THERMAL readings" in done.line()


def test_headings_nobody_heard(tmp_path: Path) -> None:
    log = logged(tmp_path / "still.mcap", value_at)
    done = run("replay", log, "--sources", 2, "--heading", "vehicle")
    assert (done.code, done.out) == (2, "")
    assert "still.mcap: --heading vehicle: no ATTITUDE was heard on leg 1" in done.line()
    done = run("replay", log, "--sources", 2, "--heading", "plan")
    assert (done.code, done.out) == (2, "")
    assert "--heading plan: no plan is known" in done.line()
