"""`fly` and what comes after: the log, replay, report, info; on a pipe and on a terminal."""

from __future__ import annotations

import io
import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from running import SCENE, left, on_a_terminal, run, the_log

from dslam_mav.commands.folder import flight_folder, new_flight_folder, point_latest
from dslam_mav.commands.summary import table
from dslam_mav.errors import BadInputError
from dslam_mav.log.reader import read_log

RESULT_KEYS = {
    "verdict", "gauge", "sources", "path", "noise_sd", "medium", "alternatives", "errors", "log", "report",
}  # fmt: skip


def same_answer(result: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in result.items() if key not in ("log", "report")}


def test_the_json_object_is_what_scripts_rely_on(flown: Any) -> None:
    result = flown.result
    assert set(result) >= RESULT_KEYS
    assert (result["verdict"], result["gauge"]) == ("IDENTIFIED", "canonical")
    for source in result["sources"]:
        assert set(source) == {"position_m", "amplitude", "peak_reading", "activation_s", "sd_m"}
    assert len(result["path"]["vertices_m"]) == 8
    assert max(result["errors"]["sources_m"]) < 0.5
    assert result["log"] == str(flown.log)
    assert result["report"] == str(flown.log.with_name("report.html"))


def test_the_flight_leaves_a_log_a_page_and_a_link_to_the_newest(flown: Any) -> None:
    assert re.fullmatch(r"\d{8}T\d{6}Z", flown.log.parent.name)
    assert left(flown.folder) == {"flight.mcap", "report.html"}
    assert os.readlink(flown.folder / "latest") == flown.log.parent.name
    page = (flown.folder / "latest" / "report.html").read_text()
    assert page.startswith("<!doctype html>")
    assert "IDENTIFIED" in page.upper()


def test_info_tells_what_is_in_the_log(flown: Any) -> None:
    info = run("info", flown.log, "--json").object
    assert info["complete"] is True
    assert info["duration_s"] > 0.0
    n_readings = len(read_log(flown.log).readings)
    assert info["topics"]["/thermal"] == n_readings
    assert n_readings > 7 * 32 + 7, "the sensor is read before the first leg, too"
    assert info["topics"]["/estimate"] >= 1
    lines = run("info", flown.log).out.splitlines()
    assert "complete" in lines[0]
    assert any(line.split() == ["/thermal", str(n_readings)] for line in lines)


def test_replay_is_the_flight_bit_for_bit_and_twice_the_same(flown: Any) -> None:
    first = run("replay", flown.log, "--json")
    assert (first.code, first.err) == (0, "")
    assert same_answer(first.object) == same_answer(flown.result)
    assert first.out == run("replay", flown.log, "--json").out
    (final,) = [e.estimate for e in read_log(flown.log).estimates if e.final]
    assert final.sources.position_m.tolist() == [s["position_m"] for s in first.object["sources"]]


def test_replay_under_other_assumptions_is_another_answer(flown: Any) -> None:
    other = run("replay", flown.log, "--json", "--spread", 5.2).object
    assert other["medium"]["spread_m"] == 5.2
    assert other["sources"] != flown.result["sources"]
    anchored = run("replay", flown.log, "--json", "--heading", "plan").object
    assert anchored["gauge"] == "anchored"
    truth = np.array([source["position_m"] for source in SCENE["sources"]])
    found = np.array([source["position_m"] for source in anchored["sources"]])
    assert np.linalg.norm(found - truth, axis=1).max() < 0.5


def test_replay_evolving_of_a_log_flown_with_a_spread_is_refused_or_answered_in_one_line(flown: Any) -> None:
    done = run("replay", flown.log, "--evolving", "--json")
    assert done.code in (0, 1)
    assert done.err.count("\n") <= 2
    assert set(done.object) >= RESULT_KEYS


def test_a_log_that_was_cut_is_read_with_a_warning(flown: Any, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    data = flown.log.read_bytes()
    cut.write_bytes(data[: int(len(data) * 0.8)])
    info = run("info", cut, "--json")
    assert (info.code, info.object["complete"]) == (0, False)
    done = run("replay", cut, "--json", "--sources", 2)
    assert done.code == 0, done.err
    assert "cut.mcap: the log is cut short" in done.line()
    assert run("report", cut).code == 0


def test_on_a_pipe_there_is_the_result_and_nothing_else(flown: Any, tmp_path: Path) -> None:
    done = run("replay", flown.log, "--report", tmp_path / "page.html")
    assert (done.code, done.err) == (0, "")
    assert done.out.count("IDENTIFIED") == 1
    assert "\x1b" not in done.out
    assert max(map(len, done.out.splitlines())) <= 100
    for source in flown.result["sources"]:
        assert str(source["position_m"][0])[:4] in done.out.replace("−", "-")
    assert "m rms" in done.out
    assert done.out.endswith(f"report          {tmp_path / 'page.html'}\n")


def test_on_a_terminal_the_flight_is_seen_going_on(scene: Path, tmp_path: Path) -> None:
    done = on_a_terminal("fly", "--scene", scene, "--sources", 2, "--out", tmp_path / "logs", "--speedup", 10)
    assert done.code == 0, done.out
    assert {f"leg {j} of 7" for j in range(1, 8)} <= set(re.findall(r"leg \d of 7", done.out))
    metres = [int(m) for m in re.findall(r"(\d+) of 112 m", done.out)]
    assert len(set(metres)) >= 10
    assert metres == sorted(metres)
    assert re.search(r"after leg [3-6] of 7: +[A-Z_]+", done.out)
    assert done.out.count("Sources and path are identified.") == 1
    table = done.out[done.out.index("Sources and path are identified.") :]
    assert max(map(len, table.splitlines())) <= 100


@pytest.mark.parametrize("columns", [80, 60])
def test_no_terminal_is_too_narrow_for_the_numbers(flown: Any, columns: int) -> None:
    log = read_log(flown.log)
    page = io.StringIO()
    Console(file=page, width=columns).print(table(log.estimates[-1].estimate, log.truth))
    assert "…" not in page.getvalue()
    assert max(map(len, page.getvalue().splitlines())) <= columns
    assert sum(line.startswith("S") for line in page.getvalue().splitlines()) == 2


def test_two_flights_in_one_second_get_a_folder_each(tmp_path: Path) -> None:
    from datetime import UTC, datetime

    now = datetime(2031, 5, 6, 7, 8, 9, tzinfo=UTC)
    names = [new_flight_folder(tmp_path / "logs", now).name for _ in range(3)]
    assert names == ["20310506T070809Z", "20310506T070809Z-2", "20310506T070809Z-3"]


def test_a_folder_nothing_was_put_in_is_gone(tmp_path: Path) -> None:
    with flight_folder(tmp_path) as folder:
        assert folder.is_dir()
    assert list(tmp_path.iterdir()) == []
    with flight_folder(tmp_path) as folder:
        (folder / "flight.mcap").touch()
    assert folder.is_dir()


def test_a_file_where_the_logs_should_go(tmp_path: Path, scene: Path) -> None:
    (tmp_path / "logs").write_text("mine")
    done = run("fly", "--scene", scene, "--out", tmp_path / "logs")
    assert (done.code, done.out) == (2, "")
    assert f"{tmp_path / 'logs'}: no log folder can be made there" in done.line()
    with pytest.raises(BadInputError):
        new_flight_folder(tmp_path / "logs" / "deeper")
    assert (tmp_path / "logs").read_text() == "mine"


def test_latest_points_at_the_newest_but_replaces_nobodys_file(tmp_path: Path) -> None:
    for name in ("one", "two"):
        point_latest(tmp_path / name)
        assert os.readlink(tmp_path / "latest") == name
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "latest").write_text("mine")
    point_latest(tmp_path / "mine" / "three")
    assert (tmp_path / "mine" / "latest").read_text() == "mine"


def test_a_plan_and_logged_readings(flown: Any, tmp_path: Path) -> None:
    """What one flight read, played back by time on the same plan: the same field."""
    csv = tmp_path / "flown.csv"
    assert run("export", flown.log, "--to", "csv", "-o", csv).code == 0
    csv.write_text(csv.read_text().replace("time_s,value", "seconds,temperature", 1))
    for more in (("--readings", csv, "--columns", "time_s=seconds,value=temperature"), ("--readings", flown.log)):
        logs = tmp_path / f"logs{len(str(more))}"
        done = run("fly", flown.plan, *more, "--sources", 2, "--out", logs, "--speedup", 60, "--json")
        assert done.code == 0, done.err
        assert done.object["errors"] is None
        before = np.array([source["position_m"] for source in flown.result["sources"]])
        after = np.array([source["position_m"] for source in done.object["sources"]])
        assert np.linalg.norm(after - before, axis=1).max() < 0.5


def test_readings_that_end_before_the_flight_are_told(tmp_path: Path) -> None:
    csv, plan = tmp_path / "short.csv", tmp_path / "triangle.plan"
    assert run("plan", "--pattern", "triangle", "--leg", 20, "-o", plan).code == 0
    csv.write_text("time_s,value\n" + "".join(f"{k * 0.1:.1f},{20 + k % 7}\n" for k in range(60)))
    done = run("fly", plan, "--readings", csv, "--sources", 2, "--out", tmp_path / "logs", "--speedup", 60)
    assert done.code == 1
    *warnings, last = done.err.splitlines()
    assert re.match(r"warning: short.csv: \d+ readings left out", warnings[0])
    assert last.startswith("dslam-mav: no position can be given: ")
    assert read_log(the_log(tmp_path / "logs")).complete


def test_a_configuration_in_the_log_says_how_it_was_flown(flown: Any) -> None:
    attachments = read_log(flown.log).attachments
    assert {"configuration.json", "plan.plan", "scene.json"} <= set(attachments)
    assert json.loads(attachments["configuration.json"])["assumptions"]["n_sources"] == 2


def test_a_scene_in_space_is_seen_as_the_slice_flown(tmp_path: Path) -> None:
    """A plane cuts Gaussians in space in Gaussians: their places on the map stay."""
    places = [[23.0, 7.7, 16.0], [8.0, 9.7, 24.0]]
    scene = {
        "medium": {"diffusivity_m2_s": 0.5, "dimensions": 3, "ambient": 20.0, "static": True},
        "sources": [{"position_m": p, "amplitude": 40000.0, "activation_s": -50.0} for p in places],
        "path": {
            "vertices_m": [
                [0.0, 0.0, 20.0], [32.0, 0.0, 20.0], [3.17, 13.88, 20.0], [23.12, -11.13, 20.0],
                [16.0, 20.06, 20.0], [8.88, -11.13, 20.0], [28.83, 13.88, 20.0], [0.0, 0.0, 20.0],
            ]
        },
        "sampling": {"spacing_m": 0.5, "speed_m_s": 5.0},
        "noise": {"snr_db": 45.0},
    }  # fmt: skip
    path = tmp_path / "space.json"
    path.write_text(json.dumps(scene))
    done = run("fly", "--scene", path, "--sources", 2, "--out", tmp_path / "logs", "--speedup", 30, "--json")
    assert done.code == 0, done.err
    found = sorted(source["position_m"] for source in done.object["sources"])
    for place, expected in zip(found, sorted(p[:2] for p in places), strict=True):
        assert place == pytest.approx(expected, abs=0.6)
    scene["path"]["vertices_m"][3][2] = 25.0
    path.write_text(json.dumps(scene))
    refused = run("fly", "--scene", path, "--sources", 2, "--out", tmp_path / "logs")
    assert refused.code == 2
    assert "expected one height, got 20 to 25 m" in refused.err
