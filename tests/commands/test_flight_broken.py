"""What befalls a flight: no vehicle, one that refuses, one that disappears, Ctrl-C, SIGTERM, a lost terminal."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
from fakes import ScriptedVehicle
from running import Done, end, left, run, spawn, spawn_vehicle, stop, the_log, wait_for

from dslam_mav.log.reader import read_log
from dslam_mav.mav.frames import messages

SILENT = "udpout:127.0.0.1:9"


@pytest.mark.parametrize("command", ["fly", "upload", "download", "clear", "onboard", "bridge"])
def test_a_vehicle_that_does_not_answer(flown: Any, tmp_path: Path, command: str) -> None:
    words = {
        "fly": ("fly", "--out", tmp_path / "logs"),
        "upload": ("upload", flown.plan, "--start"),
        "download": ("download", "-o", tmp_path / "held.plan"),
        "clear": ("clear",),
        "onboard": ("onboard", "--out", tmp_path / "flight.mcap"),
        "bridge": ("bridge",),
    }[command]
    begin_s = time.monotonic()
    done = run(*words, "--connect", SILENT, "--timeout", 0.3)
    assert time.monotonic() - begin_s < 3.0
    assert (done.code, done.out) == (1, "")
    assert done.line() == f"dslam-mav: no vehicle answered on {SILENT} within 0.3 s"
    assert not left(tmp_path)
    assert not list(tmp_path.glob("logs/*"))


@pytest.mark.parametrize("command", ["fly", "upload"])
def test_a_vehicle_that_refuses_the_mission(flown: Any, tmp_path: Path, command: str) -> None:
    dialect = messages()

    def full(message: Any) -> list[Any]:
        if message.get_type() != "MISSION_COUNT":
            return []
        return [dialect.MAVLink_mission_ack_message(255, 190, dialect.MAV_MISSION_NO_SPACE)]

    with ScriptedVehicle(full) as vehicle:
        out = ("--out", tmp_path / "logs") if command == "fly" else ()
        done = run(command, flown.plan, "--connect", vehicle.url, *out)
    assert (done.code, done.out) == (1, "")
    assert "vehicle 1 refused" in done.line()
    assert "too many items" in done.line()
    assert not left(tmp_path)


def during_a_flight(scene: Path, tmp_path: Path, *more: object, **settings: Any) -> tuple[subprocess.Popen[str], Path]:
    """A flight under way, some of whose readings are logged."""
    process = spawn("fly", "--scene", scene, "--sources", 2, "--out", tmp_path / "logs", *more, **settings)
    until_s = time.monotonic() + 60.0
    while not list((tmp_path / "logs").glob("*Z*/flight.mcap")):
        assert time.monotonic() < until_s
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    log = the_log(tmp_path / "logs")
    wait_for(log, 60_000)
    return process, log


def readable_after(done: Done, log: Path, *, partly: bool = True) -> None:
    """The log is closed and whole, no temporary file is left, and what was flown can be replayed."""
    assert "Traceback" not in done.err
    assert run("info", log, "--json").object["complete"] is True
    assert left(log.parent) <= {"flight.mcap", "report.html"}
    again = run("replay", log, "--json")
    assert again.code == (0 if partly else 1), again.err
    (final,) = [entry for entry in read_log(log).estimates if entry.final]
    assert len(again.object["sources"]) == len(final.estimate.sources)
    if partly:
        assert final.estimate.sources.position_m.tolist() == [s["position_m"] for s in again.object["sources"]]


def test_a_vehicle_that_disappears_in_the_middle(scene: Path, tmp_path: Path) -> None:
    vehicle, url = spawn_vehicle("--speedup", 10)
    try:
        process, log = during_a_flight(scene, tmp_path, "--connect", url, "--json")
    finally:
        stop(vehicle)
    done = end(process)
    assert done.code == 1
    assert "vehicle 1 fell silent for 5 s" in done.err.splitlines()[-1]
    assert done.err.count("fell silent") == 1
    assert done.object["log"] == str(log)
    assert Path(done.object["report"]).read_text().count("fell silent") >= 1
    legs = len(done.object["path"]["vertices_m"]) - 1
    assert 1 <= legs <= 7
    readable_after(done, log, partly=done.object["sources"][0]["position_m"][0] is not None)


@pytest.mark.parametrize(
    ("number", "code", "said"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
def test_ctrl_c_and_sigterm_lose_nothing(
    scene: Path, tmp_path: Path, number: signal.Signals, code: int, said: str
) -> None:
    process, log = during_a_flight(scene, tmp_path, "--speedup", 12)
    process.send_signal(number)
    done = end(process)
    assert done.code == code, done
    assert done.err.splitlines()[-1] == f"dslam-mav: {said}"
    assert str(log) in done.out  # what was learnt until then is shown
    assert (log.parent / "report.html").exists()
    flown_until_then = read_log(log).readings
    assert 30 <= len(flown_until_then) < 7 * 32
    final = [entry for entry in read_log(log).estimates if entry.final]
    readable_after(done, log, partly=final[0].estimate.verdict.name not in ("TOO_FEW_DATA", "NOT_IDENTIFIABLE"))


def test_a_terminal_that_goes_away_takes_neither_log_nor_report_with_it(scene: Path, tmp_path: Path) -> None:
    """As when an SSH connection is lost: whatever is still said there fails."""
    ours, theirs = pty.openpty()
    process, log = during_a_flight(scene, tmp_path, "--speedup", 12, stdout=theirs)
    os.close(theirs)
    os.close(ours)
    process.send_signal(signal.SIGHUP)
    done = end(process)
    assert done.code == 129, done
    assert done.err.splitlines()[-1] == "dslam-mav: the terminal is gone"
    assert read_log(log).complete
    assert left(log.parent) == {"flight.mcap", "report.html"}


def test_a_background_job_whose_terminal_goes_away_closes_its_log(scene: Path, tmp_path: Path) -> None:
    """No signal comes: the next line it says there fails."""
    ours, theirs = pty.openpty()
    process, log = during_a_flight(scene, tmp_path, "--speedup", 12, stdout=theirs)
    os.close(theirs)
    os.close(ours)
    done = end(process)
    assert done.code == 129, done
    assert done.err.splitlines()[-1] == "dslam-mav: the terminal is gone"
    assert read_log(log).complete


def test_a_vehicle_server_ends_with_a_signal() -> None:
    ends = ((signal.SIGINT, 130), (signal.SIGTERM, 143))
    for (process, _), (number, code) in zip([spawn_vehicle() for _ in ends], ends, strict=True):
        process.send_signal(number)
        done = end(process)
        assert done.code == code
        assert "Traceback" not in done.err
