"""A flight killed, and one whose disk fills up: what its log is good for as it lies there."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from mcap.reader import NonSeekingReader, make_reader
from running import end, left, run
from test_flight_broken import during_a_flight

from dslam_mav.log import read_log


def test_a_killed_flights_log_is_read_as_it_lies_there(scene: Path, tmp_path: Path) -> None:
    process, log = during_a_flight(scene, tmp_path, "--speedup", 12)
    process.kill()
    assert end(process).code == -9
    assert run("info", log, "--json").object["complete"] is False
    replayed = run("replay", log, "--json")
    assert replayed.code in (0, 1)
    if replayed.code == 0:
        page = tmp_path / "report.html"
        assert run("report", log, "-o", page).code == 0
        assert "cut short or damaged" in page.read_text()
    else:  # too few legs until then
        assert "no position can be given" in replayed.err
    out = tmp_path / "out.mcap"
    assert run("recover", log, "-o", out).code == 3
    frames = read_log(log).frames
    assert len(frames) > 100
    with out.open("rb") as file:
        messages = [m for _, c, m in make_reader(file, validate_crcs=True).iter_messages() if c.topic == "/mavlink/raw"]
    assert len(messages) == len(frames)
    again = run("replay", out, "--json")
    assert again.code == replayed.code
    if again.code == 0:
        assert again.object | {"log": None} == replayed.object | {"log": None}


@pytest.mark.skipif(sys.platform != "linux", reason="another process's limits can be set on Linux alone")
def test_a_disk_that_fills_up_ends_the_flight_with_what_is_known(scene: Path, tmp_path: Path) -> None:
    import resource

    process, log = during_a_flight(scene, tmp_path, "--speedup", 12)
    limit = log.stat().st_size + 30_000
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (limit, limit))
    done = end(process)
    assert done.code == 1
    last = done.err.splitlines()[-1]
    assert last == f"dslam-mav: {log}: cannot be written: file too large; the log ends here"
    assert "Traceback" not in done.err
    assert str(log) in done.out  # the answer is shown all the same
    assert left(log.parent) <= {"flight.mcap", "report.html"}
    assert run("info", log, "--json").object["complete"] is False
    for reader in (make_reader, NonSeekingReader):
        with log.open("rb") as file:
            messages = sum(1 for _ in reader(file, validate_crcs=True).iter_messages())
        assert messages == sum(read_log(log).topics.values()) > 100
