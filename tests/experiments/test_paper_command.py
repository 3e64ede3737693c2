"""`dslam-mav paper`: every experiment runs, says what the paper prints, draws its picture; scenes; tables' claims."""

from __future__ import annotations

import importlib.util
import json
import signal
import sys
import time
from pathlib import Path

import pytest

from dslam_mav.commands.paper_options import WHAT
from dslam_mav.commands.paper_world import RECORDINGS, SCENES, find_world
from dslam_mav.experiments.catalogue import EXPERIMENTS
from dslam_mav.experiments.tables import TABLE_II, TABLE_III
from sim_bridge.fields.scene import read_scene

sys.path.insert(0, str(Path(__file__).parents[1] / "commands"))

from running import end, run, spawn

PICTURES = importlib.util.find_spec("matplotlib") is not None
NAMES = [name for name in WHAT if name != "all"]


def test_every_experiment_has_its_subcommand():
    assert list(EXPERIMENTS) == NAMES


@pytest.mark.parametrize("name", [*NAMES, "all"])
def test_every_subcommand_helps_with_an_example(name):
    done = run("paper", name, "--help")
    assert done.code == 0
    assert f"example: dslam-mav paper {name}" in done.out


@pytest.mark.parametrize("file", sorted(SCENES.glob("*.json")), ids=lambda file: file.stem)
def test_a_scene_file_loads_and_is_flown_by_an_experiment(file):
    world = find_world(file.stem)
    assert world is not None
    assert len(world.truth.amplitude) == len(world.sources)
    assert [name for name, experiment in EXPERIMENTS.items() if file.stem in experiment.worlds]


def test_every_scene_is_there():
    wanted = {w for name, e in EXPERIMENTS.items() if name != "fig14" for w in e.worlds}
    assert wanted == {file.stem for file in SCENES.glob("*.json")}


@pytest.mark.parametrize("name", [name for name in NAMES if not name.startswith("table")])
def test_a_figure_runs_and_draws_its_picture(name, tmp_path):
    if name == "fig14" and not RECORDINGS.exists():
        pytest.skip("no recordings in ../shared/data")
    done = run("paper", name, "--trials", 1, "--workers", 1, "--out", tmp_path, "--json")
    assert done.code == 0, done.err
    found = done.object[name]
    assert found["complete"]
    assert found["rows"]
    answered = [e["paper_answered"] for row in found["rows"] for e in row["errors"].values()]
    assert max(answered) == 1
    if PICTURES:
        (picture,) = found["pictures"]
        assert Path(picture).read_bytes()[:4] == b"\x89PNG"


def test_fig8_is_exact():
    errors = run("paper", "fig8", "--workers", 1, "--json").object["fig8"]["rows"][0]["errors"]
    printed = {"E_sources": 4.6036e-10, "E_amp": 3.8365e-9, "E_lines": 9.2052e-10}
    assert {name: error["printed"] for name, error in errors.items()} == printed
    assert all(error["paper"] <= 1e-9 for error in errors.values())


def test_a_pipe_gets_the_table_with_the_papers_figures(tmp_path):
    done = run("paper", "table3", "--trials", 1, "--workers", 1, "--out", tmp_path)
    assert done.code == 0
    assert done.err == ""
    for row in TABLE_III:
        for figure in row[4:]:
            assert f"{figure:.3g}" in done.out or f"{figure:.3f}" in done.out
    assert (f"Written {tmp_path}" in done.out) == PICTURES


def test_results_do_not_depend_on_the_workers(tmp_path):
    one, two = (
        run("paper", "fig11", "--trials", 6, "--workers", n, "--out", tmp_path, "--json").object["fig11"]["rows"]
        for n in (1, 2)
    )
    assert json.dumps(one) == json.dumps(two)


def test_table2_keeps_what_it_claims(tmp_path):
    rows = run("paper", "table2", "--trials", 4, "--workers", 2, "--out", tmp_path, "--json").object["table2"]["rows"]
    assert len(rows) == len(TABLE_II)
    for row, (k, snr, _, e_sources, e_lines) in zip(rows, TABLE_II, strict=True):
        assert (row["label"]["K"], row["label"]["SNR (dB)"]) == (str(k), str(snr))
        for name, printed in (("E_sources", e_sources), ("E_lines", e_lines)):
            error = row["errors"][name]
            assert error["printed"] == printed
            assert error["paper"] is None or printed / 10.0 < error["paper"] < 10.0 * printed, row
            if snr >= 20:
                assert error["joint"] < printed / 2.0, row


def test_scenes_are_chosen_again_alike(tmp_path):
    asked = ("paper", "scenes", "--scene", "table2_k2_static_10dB", "--draws", 1, "--json", "--out")
    one, two = (run(*asked, tmp_path / name).object for name in ("a", "b"))
    (found,) = one.values()
    assert found["off"] == next(iter(two.values()))["off"] < 10.0
    first, second = ((tmp_path / name / "table2_k2_static_10dB.json").read_bytes() for name in ("a", "b"))
    assert first == second
    assert read_scene(Path(found["file"])).noise.snr_db == 10.0


def test_without_matplotlib_one_line_says_what_is_missing(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    done = run("paper", "fig8", "--workers", 1, "--out", tmp_path)
    assert done.code == 0
    assert "pip install 'dslam-mav[plots]'" in done.out
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_prints_what_there_is(tmp_path):
    process = spawn("paper", "fig11", "--trials", 100000, "--workers", 2, "--out", tmp_path)
    time.sleep(8.0)
    process.send_signal(signal.SIGINT)
    done = end(process)
    assert done.code == 130
    assert "interrupted after" in done.out
    assert "Traceback" not in done.err
