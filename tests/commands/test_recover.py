"""`recover`: exit codes, what is said, and that a recovered log answers as the part it holds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from running import left, run

from dslam_mav.log import Recorder, read_log


@pytest.fixture
def cut(flown: Any, tmp_path: Path) -> Path:
    """The log of a flight cut off in the middle of its fifth leg or so."""
    data = flown.log.read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(data[: len(data) * 6 // 10])
    return path


def test_a_whole_log_is_recovered_cleanly(flown: Any, tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    done = run("recover", flown.log, "-o", out, "--json")
    assert (done.code, done.err) == (0, "")
    info = run("info", flown.log, "--json").object
    assert {topic: count["kept"] for topic, count in done.object["topics"].items()} == info["topics"]
    assert (done.object["clean"], done.object["lost"], done.object["attachments_lost"]) == (True, 0, [])
    again = run("info", out, "--json").object
    assert again.pop("recovered")["lost"] == 0
    assert again == info
    replayed = run("replay", out)
    assert (replayed.code, replayed.err) == (0, "")  # nothing lost: nothing to warn of


def test_a_cut_log_is_recovered_with_losses(flown: Any, cut: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    done = run("recover", cut, "-o", out)
    assert (done.code, done.err) == (3, "")
    assert f"{cut} ends early" in done.out
    assert "how many are lost is unknown" in done.out
    before, after = run("info", cut, "--json").object, run("info", out, "--json").object
    assert after["topics"] == before["topics"]
    assert (before["complete"], after["complete"]) == (False, True)
    assert after["recovered"]["source"] == "cut.mcap"
    assert "recovered from cut.mcap: " in run("info", out).out
    assert left(tmp_path) == {"cut.mcap", "out.mcap"}


def test_a_recovered_log_answers_as_the_part_it_holds(flown: Any, cut: Path, tmp_path: Path) -> None:
    out, part = tmp_path / "out.mcap", tmp_path / "part.mcap"
    assert run("recover", cut, "-o", out).code == 3
    held, whole = read_log(out), read_log(flown.log)
    assert 0 < len(held.frames) < len(whole.frames)
    with Recorder(part) as recorder:  # what the undamaged log held until then
        for name, data in whole.attachments.items():
            recorder.attach(name, "", data)
        for received_ns, raw in whole.frames[: len(held.frames)]:
            recorder.frame(received_ns, raw)
        assert whole.truth is not None
        recorder.truth(1, whole.truth)
    answers = []
    for log in (cut, out, part):
        done = run("replay", log, "--json")
        assert done.code == 0, done.err
        assert ("cut short or damaged" in done.err) == (log == cut)
        assert ("recovered from cut.mcap" in done.err) == (log == out)
        answers.append({name: value for name, value in done.object.items() if name not in ("log", "report")})
    assert answers[0] == answers[1] == answers[2]
    assert len(answers[0]["path"]["vertices_m"]) > 3


def test_a_damaged_summary_costs_nothing(flown: Any, tmp_path: Path) -> None:
    log, out = tmp_path / "flight.mcap", tmp_path / "out.mcap"
    data = flown.log.read_bytes()
    log.write_bytes(data[:-300] + bytes(300))
    done = run("recover", log, "-o", out, "--json")
    assert (done.code, done.object["clean"], done.object["lost"]) == (0, True, 0)
    assert run("info", out, "--json").object["topics"] == run("info", flown.log, "--json").object["topics"]


def test_nothing_salvageable_is_one_line_and_no_file(tmp_path: Path) -> None:
    log, out = tmp_path / "zeros.mcap", tmp_path / "out.mcap"
    log.write_bytes(bytes(10_000))
    done = run("recover", log, "-o", out)
    assert (done.code, done.out) == (1, "")
    assert done.line().startswith(f"dslam-mav: {log}: nothing can be salvaged")
    assert left(tmp_path) == {"zeros.mcap"}


def test_nothing_is_overwritten_and_bad_names_are_named(flown: Any, cut: Path, tmp_path: Path) -> None:
    before = cut.read_bytes()
    link = tmp_path / "link.mcap"
    link.symlink_to(tmp_path / "nowhere.mcap")
    for out in (cut, flown.log, tmp_path, link):
        done = run("recover", cut, "-o", out)
        assert (done.code, done.out) == (2, "")
        assert done.line() == f"dslam-mav: -o {out}: exists already, and a log is never overwritten"
    assert cut.read_bytes() == before
    missing = run("recover", tmp_path / "missing.mcap", "-o", tmp_path / "out.mcap")
    assert (missing.code, missing.line()) == (
        2,
        f"dslam-mav: {tmp_path}/missing.mcap: cannot be read: no such file or directory",
    )
    assert "is no file" in run("recover", tmp_path, "-o", tmp_path / "out.mcap").line()
    nowhere = run("recover", cut, "-o", tmp_path / "no" / "out.mcap")
    assert (nowhere.code, nowhere.line()) == (
        2,
        f"dslam-mav: {tmp_path}/no/out.mcap: cannot be written: no such file or directory",
    )
    assert left(tmp_path) == {"cut.mcap"}
