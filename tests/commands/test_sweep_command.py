"""`dslam-mav sweep` as a researcher runs it: the same table whoever computes it and whatever interrupts it."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dataflash
import psutil
import pytest
from pyarrow import parquet
from running import SCENE, end, on_a_terminal, run, spawn, stop
from sweep_files import POINTS, SMALL, rows_in, written

ROOT = Path(__file__).parents[2]
LONG = SMALL.replace("[3, 4]", str(list(range(40))))


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a sweep on one worker."""
    folder = tmp_path_factory.mktemp("alone")
    done = run("sweep", written(folder), "--workers", 1, "--out", folder / "out", "--json")
    assert (done.code, done.err) == (0, "")
    assert (done.object["points"], done.object["computed"], done.object["failed"]) == (POINTS, POINTS, 0)
    return folder / "out"


def lines(out: Path) -> int:
    path = out / "points.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def until(said: Callable[[], bool], process: subprocess.Popen[str] | None = None) -> None:
    end_s = time.monotonic() + 120.0
    while not said():
        assert time.monotonic() < end_s
        assert process is None or process.poll() is None, process.communicate()
        time.sleep(0.02)


def test_the_table_has_a_row_for_every_point(alone):
    rows = rows_in(alone)
    assert len({tuple(row[name] for name in ("scene", "mission", "noise", "method", "seed")) for row in rows}) == POINTS
    for row in rows:
        assert row["failure"] is None
        assert row["verdict"] in ("IDENTIFIED", "AMBIGUOUS")
        assert row["noise_snr_db"] == pytest.approx(float(row["noise"].split()[0]))
        assert 0.0 < row["source_error_rms_m"] < 20.0 * row["bound_m"]
        assert 9.0 <= row["spread_m"] <= 11.0
    table = parquet.read_table(alone / "results.parquet")
    assert table.schema.metadata[b"sweep.toml"].decode() == SMALL
    assert b"NEES" not in table.schema.field("nees").metadata[b"description"]
    assert min(table["seconds"].to_pylist()) > 0.0
    by_seed = {row["seed"]: row["noise_sd"] for row in rows if row["scene"] == "random k2 1"}
    assert len(set(by_seed.values())) == 1
    errors = {row["source_error_rms_m"] for row in rows}
    assert len(errors) == POINTS, "every seed has noise of its own"


def test_a_dask_cluster_gives_the_same_table_bit_for_bit(alone, tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster:
        where = ("--scheduler", cluster.scheduler_address, "--out", tmp_path / "out", "--json")
        done = run("sweep", written(tmp_path), *where)
        assert (done.code, done.object["computed"]) == (0, POINTS), done.err
        again = run("sweep", written(tmp_path), *where)
    assert rows_in(tmp_path / "out") == rows_in(alone)
    assert again.object["computed"] == 0


def test_a_second_run_computes_nothing_and_shows_it_all_again(alone, tmp_path):
    out = shutil.copytree(alone, tmp_path / "out")
    again = run("sweep", written(tmp_path), "--out", out)
    assert (again.code, again.err) == (0, "")
    assert again.out.startswith("small.toml: 2 scenes × 2 missions × 2 noise levels × 1 method × 2 seeds = 16 points\n")
    assert f"{POINTS} of {POINTS} points are there from before" in again.out
    assert "computed" not in again.out
    assert re.search(r"^star5 40 m +25 dB +4 ", again.out, re.MULTILINE)
    assert "…" not in again.out
    assert rows_in(out) == rows_in(alone)
    if importlib.util.find_spec("matplotlib") is not None:
        for name in ("error.png", "verdicts.png"):
            assert f"Written {out / name}" in again.out
            assert (out / name).read_bytes()[:4] == b"\x89PNG"


def test_more_points_are_computed_alone_and_a_terminal_sees_how_far_it_is(alone, tmp_path):
    out = shutil.copytree(alone, tmp_path / "out")
    more = written(tmp_path, SMALL.replace("[25, 35]", "[35, 30]"))
    done = on_a_terminal("sweep", more, "--workers", 1, "--out", out, timeout_s=180.0)
    assert done.code == 0
    assert re.search(r"\d+ of 16, \d+ s left", done.out)
    assert f"{POINTS // 2} points computed in" in done.out
    kept = [row for row in rows_in(out) if row["noise"] == "35 dB"]
    assert kept == [row for row in rows_in(alone) if row["noise"] == "35 dB"]
    assert len(rows_in(out)) == POINTS


def test_a_sweep_on_two_workers_that_is_killed_goes_on_to_the_same_table(alone, tmp_path):
    out = tmp_path / "out"
    process = spawn("sweep", written(tmp_path, LONG), "--workers", 2, "--out", out)
    until(lambda: lines(out) >= 8, process)
    children = psutil.Process(process.pid).children(recursive=True)
    process.kill()
    process.communicate()
    assert not (out / "results.parquet").exists(), "killed amid the work"
    _, alive = psutil.wait_procs(children, timeout=30.0)
    assert alive == [], "no worker outlives its parent"
    # the small sweep is a part of the long one, some of it among what was finished
    whole = [line for line in (out / "points.jsonl").read_text().splitlines(keepends=True) if line.endswith("\n")]
    kept = [json.loads(line)["row"] for line in whole]
    kept = [row for row in kept if row["seed"] in (3, 4)]
    assert 1 <= len(kept) < POINTS
    done = run("sweep", written(tmp_path), "--workers", 1, "--out", out, "--json")
    assert (done.code, done.object["computed"]) == (0, POINTS - len(kept))
    assert rows_in(out) == rows_in(alone)
    seconds = parquet.read_table(out / "results.parquet")["seconds"].to_pylist()
    assert {row["seconds"] for row in kept} <= set(seconds), "what was finished is what is in the table"


def test_a_killed_worker_is_replaced_and_ctrl_c_says_what_is_kept(tmp_path):
    out = tmp_path / "out"
    process = spawn("sweep", written(tmp_path, LONG), "--workers", 1, "--out", out)
    try:
        until(lambda: lines(out) >= 2, process)
        for child in psutil.Process(process.pid).children():
            if "spawn_main" in " ".join(child.cmdline()):
                child.kill()
        before = lines(out)
        until(lambda: lines(out) >= before + 3, process)
        process.send_signal(signal.SIGINT)
        done = end(process)
    finally:
        stop(process)
    assert done.code == 130
    # killed between two points it costs none of them, and there is nothing to tell
    told = r"(warning: random .*: its worker process was killed or crashed; it is tried once more\n)?"
    assert re.fullmatch(told + "dslam-mav: interrupted\n", done.err)
    assert f"{lines(out)} of 320 points are kept in {out}: the same command goes on from there" in done.out
    assert [path.name for path in out.iterdir()] == ["points.jsonl"]
    assert all(json.loads(line)["row"]["verdict"] for line in (out / "points.jsonl").read_text().splitlines())


def test_the_example_runs(tmp_path):
    text = (ROOT / "docs" / "examples" / "sweep.toml").read_text()
    reduced = text.replace("random = 10 ", "random = 1 ").replace("[10.0, 20.0, 30.0, 40.0]", "[40.0]")
    assert len(reduced) < len(text)
    done = run("sweep", written(tmp_path, reduced), "--workers", 1, "--out", tmp_path / "out", "--json")
    assert (done.code, done.object["points"]) == (0, 4), done.err
    assert [group["labels"]["mission"] for group in done.object["groups"]] == ["star7 32 m", "star5 45 m"]
    assert run("sweep", ROOT / "docs" / "examples" / "sweep.toml", "--help").code == 0


def test_scene_files_evolving_with_all_that_can_be_said(tmp_path):
    scene = json.loads(json.dumps(SCENE))
    scene["medium"]["static"] = False
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    assert run("plan", "--leg", 16, "-o", tmp_path / "star.plan").code == 0
    text = """
        [scenes]
        files = ["*.json"]
        [[missions]]
        path = "scene"
        [[missions]]
        plan = "star.plan"
        name = "planned"
        [noise]
        sd = [0.02, 0.05]
        [sampling]
        interval_s = 0.1
        [estimate]
        n_sources = 2
        known = ["diffusivity", "activation"]
        closed = true
        heading_sd_deg = 2.0
    """
    done = run("sweep", written(tmp_path, text), "--workers", 1, "--out", tmp_path / "out", "--json")
    assert (done.code, done.object["points"]) == (0, 4), done.err
    rows = rows_in(tmp_path / "out")
    assert [(row["mission"], row["noise"]) for row in rows] == [
        ("scene's path", "sd 0.02"), ("scene's path", "sd 0.05"), ("planned", "sd 0.02"), ("planned", "sd 0.05"),
    ]  # fmt: skip
    for row in rows:
        assert (row["k_true"], row["k_found"]) == (2, 2)
        assert row["source_error_max_m"] < 1.0
        assert row["readings"] == pytest.approx(112.0 / 5.0 / 0.1, abs=3)


def test_a_folder_of_logs_gives_a_row_a_log(flown: Any, tmp_path):
    logs = tmp_path / "logs"
    (logs / "day1").mkdir(parents=True)
    shutil.copy(flown.log, logs / "day1" / "a.mcap")
    data = flown.log.read_bytes()
    (logs / "b.mcap").write_bytes(data[: len(data) // 50])
    (logs / "c.BIN").write_bytes(dataflash.formats())
    (logs / "latest").symlink_to(logs / "day1", target_is_directory=True)
    text = '[logs]\nfolder = "logs"\n[assume]\nsources = 2\n'
    done = run("sweep", written(tmp_path, text), "--workers", 1, "--out", tmp_path / "out")
    assert done.code == 1
    results = tmp_path / "out" / "results.parquet"
    assert done.line() == f"dslam-mav: 2 of 3 points failed: why is in column failure of {results}"
    assert re.search(r"^Failed: b\.mcap, joint: .+$", done.out, re.MULTILINE)
    assert re.search(r"^Failed: c\.BIN, joint: .*no NVAL records: .*$", done.out, re.MULTILINE)
    assert "small.toml: 3 logs × 1 method = 3 points" in done.out
    assert re.search(r"^b\.mcap +joint +failed +– ", done.out, re.MULTILINE)
    assert re.search(rf"^day1/a\.mcap +joint +{flown.result['verdict']} +2 ", done.out, re.MULTILINE)
    broken, _, whole = rows_in(tmp_path / "out")
    assert (broken["log"], broken["verdict"]) == ("b.mcap", None)
    assert (whole["log"], whole["verdict"]) == ("day1/a.mcap", flown.result["verdict"])
    errors = flown.result["errors"]["sources_m"]
    assert whole["source_error_max_m"] == pytest.approx(max(errors))
    assert whole["k_found"] == whole["k_true"] == 2
    (logs / "b.mcap").unlink()
    (logs / "c.BIN").unlink()
    again = run("sweep", written(tmp_path, text), "--workers", 1, "--out", tmp_path / "out", "--json")
    assert (again.code, again.object["points"], again.object["computed"]) == (0, 1, 0)


def test_what_cannot_be_reached_or_written_is_one_line(tmp_path, monkeypatch):
    path = written(tmp_path)
    monkeypatch.setattr("dslam_mav.sweep.cluster.PATIENCE_S", 1.0)
    nobody = run("sweep", path, "--out", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:9")
    assert nobody.code == 1
    assert nobody.line().startswith("dslam-mav: --scheduler tcp://127.0.0.1:9: no Dask scheduler can be reached: ")
    both = run("sweep", path, "--scheduler", "tcp://127.0.0.1:9", "--workers", 2)
    assert (both.code, "expected one of them" in both.line()) == (2, True)
    (tmp_path / "file").touch()
    assert run("sweep", path, "--out", tmp_path / "file" / "out").line().endswith("cannot be written: not a directory")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    bare = run("sweep", path, "--out", tmp_path / "out")
    assert (bare.code, bare.line().split(": ", 1)[1]) == (
        1, "results are Parquet, which needs pyarrow: pip install 'dslam-mav[parquet]'"
    )  # fmt: skip
