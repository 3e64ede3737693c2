"""Where a command is to write: one rule for all of them, and told before anything slow is done."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from running import left, run

WRITES = {
    "plan -o": (("plan", "--pattern", "best", "-o"), "out.plan"),
    "download -o": (("download", "--connect", "udpin:127.0.0.1:0", "--timeout", 60, "-o"), "out.waypoints"),
    "onboard --out": (("onboard", "--connect", "udpin:127.0.0.1:0", "--timeout", 60, "--out"), "out.mcap"),
    "check --saved": (("check", "--connect", "udpin:127.0.0.1:0", "--timeout", 60, "--fix", "--saved"), "out.json"),
    "report -o": (("report", "LOG", "-o"), "out.html"),
    "report of many -o": (("report", "LOG", "LOG", "-o"), "out.html"),
    "replay --report": (("replay", "LOG", "--report"), "out.html"),
    "replay --set --report": (("replay", "LOG", "--set", "sources=1", "--report"), "out.html"),
    "export -o": (("export", "LOG", "--to", "csv", "-o"), "out.csv"),
    "recover -o": (("recover", "LOG", "-o"), "out.mcap"),
    "layout -o": (("layout", "-o"), "out.json"),
    "fly --out": (("fly", "--out"), "out"),
    "paper --out": (("paper", "fig8", "--trials", 1, "--out"), "out"),
    "paper scenes --out": (("paper", "scenes", "--out"), "out"),
    "sweep --out": (("sweep", "SWEEP", "--out"), "out"),
}
FOLDERS = {"fly --out", "paper --out", "paper scenes --out", "sweep --out"}
SWEEP = '[scenes]\nrandom = 1\n[[missions]]\npattern = "star5"\nleg_m = 32\n[noise]\nsnr_db = 20\n'


@pytest.mark.parametrize("name", WRITES)
def test_what_cannot_be_written_is_bad_input_and_told_first(name: str, flown: Any, tmp_path: Path) -> None:
    words, file = WRITES[name]
    (tmp_path / "file").touch()
    (tmp_path / "sweep.toml").write_text(SWEEP)
    (tmp_path / "flight.mcap").write_bytes(flown.log.read_bytes())
    stand_ins = {"LOG": tmp_path / "flight.mcap", "SWEEP": tmp_path / "sweep.toml"}
    named = [stand_ins.get(str(word), word) for word in words]
    before = left(tmp_path)
    for folder in (tmp_path / "file", *(() if name in FOLDERS else (tmp_path / "nowhere",))):
        done = run(*named, folder / file)
        assert done.code == 2, done
        assert f"{folder / file}" in done.line()
        assert "directory" in done.line()
        assert "Traceback" not in done.err
    assert left(tmp_path) == before


@pytest.mark.parametrize("name", sorted(set(WRITES) - FOLDERS))
def test_a_format_we_do_not_write_is_told_with_those_we_do(name: str, flown: Any, tmp_path: Path) -> None:
    words, file = WRITES[name]
    named = [flown.log if word == "LOG" else word for word in words]
    done = run(*named, tmp_path / "out.pdf")
    assert (done.code, done.out) == (2, "")
    assert f"{tmp_path / 'out.pdf'}: ending '.pdf': expected " in done.line()
    assert Path(file).suffix in done.line()


def test_assumptions_of_ones_own_have_a_page_of_their_own(flown: Any, tmp_path: Path) -> None:
    log = tmp_path / "flight.mcap"
    log.write_bytes(flown.log.read_bytes())
    page = tmp_path / "report.html"
    assert run("report", log).out == f"{page}\n"
    before = page.read_bytes()
    other = tmp_path / "report.sources-3.closed-yes.html"
    assert run("report", log, "--sources", 3, "--closed").out == f"{other}\n"
    assert run("report", log, "--sources", 3, "--closed").out == f"{other}, in place of the one that was there\n"
    assert page.read_bytes() == before
    assert other.read_bytes() != before
    assert run("report", log, "--sources", 2, "--json").object["reports"][0]["report"] == str(page), "as it was flown"
    assert left(tmp_path) == {"flight.mcap", page.name, other.name}


def test_input_files_are_read_before_a_vehicle_is_waited_for(tmp_path: Path) -> None:
    """A minute's patience for a vehicle that is not there: the test would run into it."""
    nobody = ("--connect", "udpin:127.0.0.1:0", "--timeout", 60)
    bad, short = tmp_path / "bad.json", tmp_path / "short.plan"
    bad.write_text("{")
    run("plan", "--pattern", "star5", "-o", short)
    plan = json.loads(short.read_text())
    plan["mission"]["items"] = plan["mission"]["items"][:3]
    short.write_text(json.dumps(plan))
    for words, named in (
        (("bridge", "--scene", bad), "bad.json"),
        (("bridge", "--readings", tmp_path / "none.csv"), "none.csv"),
        (("bridge", "--readings", tmp_path / "none.npz"), "none.npz"),
        (("bridge", "--plan", bad), "bad.json"),
        (("bridge", "--plan", short), "short.plan: 1 waypoint: expected 2"),
        (("bridge", "--signing-key-file", bad), "bad.json"),
        (("onboard", "--out", tmp_path / "o.mcap", "--plan", bad), "bad.json"),
        (("onboard", "--out", tmp_path / "o.mcap", "--plan", bad, "--adaptive"), "bad.json"),
        (("onboard", "--out", tmp_path / "o.mcap", "--plan", short), "short.plan: 1 waypoint"),
        (("upload", bad), "bad.json"),
        (("check", "--restore", "--saved", bad), "bad.json"),
        (("fly", short), "short.plan: 1 waypoint"),
        (("fly", "--scene", bad), "bad.json"),
    ):
        done = run(*words, *nobody)
        assert (done.code, done.out) == (2, ""), words
        assert named in done.line(), words
