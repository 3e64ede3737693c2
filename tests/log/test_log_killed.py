"""Fifty processes killed, each at a moment of its own: what their logs hold of what they had given the recorder."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import NonSeekingReader, make_reader

from dslam_mav.log import read_log
from dslam_mav.log.recover import salvage

KILLED = 50
LONGEST_S = 2.5

# One process that has everything imported becomes many by fork; each tells by a pipe of its own what it gave, and when.
WRITERS = """
import os, struct, sys, time
from pathlib import Path
from dslam_mav.log import Recorder
from dslam_mav.observations import Reading

def write(path, pipe):
    recorder = Recorder(path)
    recorder.attach("plan.plan", "application/json", b"{}")
    i, end_s = 0, time.monotonic() + 60
    while time.monotonic() < end_s:
        now_ns = time.time_ns()
        recorder.reading(now_ns, Reading(i, i / 3))
        os.write(pipe, struct.pack("<Q", now_ns))
        i += 1
        time.sleep(0.02)

for name, pipe in zip(sys.argv[1::2], sys.argv[2::2]):
    child = os.fork()
    if not child:
        write(Path(name), int(pipe))
        os._exit(0)
    print(child, flush=True)
time.sleep(60)
"""


def started(folder: Path, count: int) -> tuple[subprocess.Popen[str], list[tuple[int, Path, Any]]]:
    """The parent of the writers; of each its process, its log and the end of its pipe."""
    paths = [folder / f"{number}.mcap" for number in range(count)]
    pipes = [os.pipe() for _ in paths]
    words = [word for path, (_, writing) in zip(paths, pipes, strict=True) for word in (str(path), str(writing))]
    parent = subprocess.Popen(
        [sys.executable, "-c", WRITERS, *words],
        stdout=subprocess.PIPE,
        text=True,
        pass_fds=[writing for _, writing in pipes],
    )
    assert parent.stdout is not None
    children = []
    for path, (reading, writing) in zip(paths, pipes, strict=True):
        os.close(writing)
        children.append((int(parent.stdout.readline()), path, os.fdopen(reading, "rb")))
    return parent, children


def killed(folder: Path, after_s: np.ndarray) -> list[tuple[Path, int, list[int]]]:
    """Of each writer: its log, when it was killed, and what it had given until then."""
    parent, children = started(folder, len(after_s))
    begin_s, ends = time.monotonic(), []
    for (child, path, pipe), moment_s in sorted(zip(children, after_s, strict=True), key=lambda pair: pair[1]):
        time.sleep(max(0.0, begin_s + moment_s - time.monotonic()))
        ends.append((path, time.time_ns(), pipe))
        os.kill(child, signal.SIGKILL)
    parent.kill()
    parent.communicate()
    found = []
    for path, end_ns, pipe in ends:
        with pipe:
            given = pipe.read()
        found.append((path, end_ns, [time_ns for (time_ns,) in struct.iter_unpack("<Q", given)]))
    return found


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Path, int, list[int]]]:
    folder = tmp_path_factory.mktemp("killed")
    moments_s = np.random.default_rng(7).uniform(0.0, LONGEST_S, KILLED)
    return killed(folder, moments_s)


def test_killed_at_fifty_moments_a_log_lacks_at_most_its_last_second(logs):
    read = 0
    for path, end_ns, given_ns in logs:
        due = [time_ns for time_ns in given_ns if time_ns <= end_ns - 1_000_000_000]
        if not (path.exists() and path.stat().st_size):  # killed before the log began
            assert not due
            continue
        log = read_log(path)
        assert not log.complete
        kept_ns = [time_ns for time_ns, _ in log.readings]
        assert kept_ns[: len(given_ns)] == given_ns[: len(kept_ns)]  # the last may be logged and not yet told
        assert len(kept_ns) >= len(due)
        assert [r.time_boot_ms for _, r in log.readings] == list(range(len(kept_ns)))
        assert log.attachments == {"plan.plan": b"{}"} or not kept_ns
        read += bool(due)
    assert read > KILLED / 3


def test_recovered_they_open_everywhere(logs, tmp_path):
    for path, _, _ in logs:
        if not (path.exists() and path.stat().st_size):
            continue
        log = read_log(path)
        if not (log.readings or log.attachments):
            continue
        out = tmp_path / path.name
        salvaged = salvage(path)
        out.write_bytes(salvaged.data)
        assert (salvaged.kept, salvaged.lost, salvaged.clean) == (len(log.readings), 0, False)
        for reader in (make_reader, NonSeekingReader):
            with out.open("rb") as file:
                times_ns = [m.log_time for _, _, m in reader(file, validate_crcs=True).iter_messages()]
                assert times_ns == [time_ns for time_ns, _ in log.readings]
        assert read_log(out).complete
