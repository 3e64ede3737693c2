"""The recorder's promises: what may be lost, what is refused, who is told when the disk is full."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from mcap.reader import NonSeekingReader, make_reader

from dslam_mav.errors import BadInputError, LogError
from dslam_mav.log import Recorder, log_info, read_log
from dslam_mav.log.recover import salvage
from dslam_mav.observations import Reading


def test_a_log_is_never_overwritten(tmp_path):
    path = tmp_path / "flight.mcap"
    with Recorder(path) as first:
        first.reading(1, Reading(1, 2.0))
        with pytest.raises(BadInputError, match=r"flight\.mcap: exists already"):
            Recorder(path)
    assert len(read_log(path).readings) == 1
    before = path.read_bytes()
    with pytest.raises(BadInputError, match="exists already"):
        Recorder(path)
    assert path.read_bytes() == before


def test_a_folder_that_is_missing_or_no_folder_is_named(tmp_path):
    with pytest.raises(BadInputError, match=r"nowhere/flight\.mcap: cannot be created: no such file") as caught:
        Recorder(tmp_path / "nowhere" / "flight.mcap")
    assert "\n" not in str(caught.value)
    (tmp_path / "file").write_text("")
    with pytest.raises(BadInputError, match="cannot be created"):
        Recorder(tmp_path / "file" / "flight.mcap")


@pytest.mark.skipif(not Path("/proc/version").exists(), reason="needs Linux's /proc as a folder nobody can write")
def test_a_read_only_folder_is_named():
    with pytest.raises(BadInputError, match=r"^/proc/flight\.mcap: cannot be created: "):
        Recorder(Path("/proc/flight.mcap"))


FULL = """
import resource, sys, time
from pathlib import Path
from dslam_mav.errors import LogError
from dslam_mav.log import Recorder
from dslam_mav.observations import Reading
import random
limit = int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
told = 0
try:
    recorder = Recorder(Path(sys.argv[1]))
except LogError as error:
    print(error); sys.exit(4)
i = 0
deadline = time.monotonic() + 20
while told < 1 and time.monotonic() < deadline:
    for _ in range(500):
        try:
            recorder.reading(10**18 + i, Reading(i, random.random()))
        except LogError as error:
            told += 1
            print(error)
        i += 1
    time.sleep(0.02)
for _ in range(10):
    recorder.reading(10**18, Reading(i, 0.0))
    recorder.text(10**18, 20, "ignored")
recorder.close()
recorder.close()
print("told", told)
"""


def run_full(path: Path, limit: int) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", FULL, str(path), str(limit)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_a_full_disk_is_told_once_and_the_log_so_far_is_whole(tmp_path):
    path = tmp_path / "flight.mcap"
    done = run_full(path, 150_000)
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert len(lines) == 2
    assert lines[0].startswith(f"{path}: cannot be written: file too large")
    assert lines[1] == "told 1"
    log = read_log(path)
    assert not log.complete
    assert len(log.readings) > 1000
    assert [r.time_boot_ms for _, r in log.readings] == list(range(len(log.readings)))
    with path.open("rb") as file:  # closed, so that the library reads it too
        messages = list(make_reader(file, validate_crcs=True).iter_messages())
    assert len(messages) == len(log.readings)
    with path.open("rb") as file:
        messages = list(NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False))
    assert len(messages) == len(log.readings)
    salvaged = salvage(path)
    assert (salvaged.kept, salvaged.exact, salvaged.clean) == (len(messages), False, False)


def test_a_disk_that_is_full_from_the_start_leaves_no_file(tmp_path):
    path = tmp_path / "flight.mcap"
    done = run_full(path, 10)
    assert (done.returncode, done.stderr) == (4, "")
    assert done.stdout.startswith(f"{path}: cannot be written: file too large")
    assert not path.exists()


def test_a_failure_at_the_very_end_is_told_by_close(tmp_path, monkeypatch):
    path = tmp_path / "flight.mcap"
    recorder = Recorder(path)
    recorder.reading(1, Reading(1, 2.0))

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(LogError, match="no space left on device"):
        recorder.close()
    recorder.close()


@pytest.mark.parametrize("late", [1, 2, 3, 4])
def test_a_disk_full_while_the_log_is_closed_costs_its_index_alone(tmp_path, monkeypatch, late):
    """Of the four writes that end a log each may be the one that fails, with a part of it done."""
    path = tmp_path / "flight.mcap"
    recorder = Recorder(path)
    recorder.reading(1, Reading(1, 2.0))
    recorder._disk.sync()
    write, hold, counted = os.write, recorder._disk.hold, []

    def held() -> None:
        hold()
        monkeypatch.setattr(os, "write", failing)

    def failing(descriptor: int, data: bytes) -> int:
        counted.append(len(data))
        if len(counted) == late:
            return write(descriptor, data[: len(data) // 2])
        if len(counted) == late + 1:
            raise OSError(28, "No space left on device")
        return write(descriptor, data)

    monkeypatch.setattr(recorder._disk, "hold", held)
    with pytest.raises(LogError, match="no space left on device"):
        recorder.close()
    log = read_log(path)
    assert (len(log.readings), log.complete) == (1, False)
    with path.open("rb") as file:
        assert len(list(make_reader(file, validate_crcs=True).iter_messages())) == 1


def test_an_error_on_its_way_out_is_not_hidden_by_the_log(tmp_path, monkeypatch):
    def leave() -> None:
        with Recorder(tmp_path / "flight.mcap") as recorder:
            recorder.reading(1, Reading(1, 2.0))
            monkeypatch.setattr(os, "fsync", lambda _: (_ for _ in ()).throw(OSError(5, "Input/output error")))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        leave()


def test_a_closed_log_takes_nothing_more(tmp_path):
    recorder = Recorder(tmp_path / "flight.mcap")
    recorder.close()
    recorder.close()
    with pytest.raises(LogError, match=r"flight\.mcap: is closed"):
        recorder.reading(1, Reading(1, 2.0))
    assert read_log(tmp_path / "flight.mcap").complete


@pytest.mark.parametrize("time_ns", [-1, 2**63])
def test_impossible_times_are_the_callers_mistake(tmp_path, time_ns):
    with Recorder(tmp_path / "flight.mcap") as recorder:
        with pytest.raises(ValueError, match="received_ns"):
            recorder.text(time_ns, logging.INFO, "when?")
        recorder.text(5, logging.INFO, "now")
    assert len(read_log(tmp_path / "flight.mcap").texts) == 1


def test_several_threads_may_write(tmp_path):
    path = tmp_path / "flight.mcap"

    def write(number: int) -> None:
        for i in range(2000):
            recorder.reading(i, Reading(i, float(number)))

    with Recorder(path) as recorder:
        threads = [threading.Thread(target=write, args=(n,)) for n in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    log = read_log(path)
    for number in range(4):
        mine = [r.time_boot_ms for _, r in log.readings if r.value == number]
        assert mine == list(range(2000))


def test_a_log_being_written_can_be_read(tmp_path):
    path = tmp_path / "flight.mcap"
    with Recorder(path) as recorder:
        recorder.reading(1, Reading(1, 2.0))
        deadline = time.monotonic() + 5
        while not log_info(path)["topics"] and time.monotonic() < deadline:
            time.sleep(0.05)
        assert log_info(path) == {"topics": {"/thermal": 1}, "duration_s": 0.0, "complete": False}


def test_an_hours_log_loads_in_seconds(tmp_path):
    """A tenth of an hour at 200 frames and 50 readings a second, with a wide margin for a busy machine."""
    path = tmp_path / "flight.mcap"
    raw = bytes.fromhex("fd0900000001010000000000000002030004030000")
    with Recorder(path) as recorder:
        for i in range(72_000):
            recorder.frame(i * 5_000_000, raw)
            if i % 4 == 0:
                recorder.reading(i * 5_000_000, Reading(i, i / 7))
    started = time.process_time()
    log = read_log(path)
    assert time.process_time() - started < 2.0
    assert (len(log.frames), len(log.readings), log.complete) == (72_000, 18_000, True)
