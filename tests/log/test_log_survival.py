"""A process killed, interrupted or left alone: what of its log is on disk."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from io import BytesIO
from typing import Any

import pytest
from mcap.reader import NonSeekingReader
from mcap.writer import Writer

from dslam_mav.log import Recorder, read_log
from dslam_mav.observations import Reading

WRITER = """
import sys, time
from pathlib import Path
from dslam_mav.log import Recorder
from dslam_mav.observations import Reading
recorder = Recorder(Path(sys.argv[1]))
recorder.attach("plan.plan", "application/json", b"{}")
i = 0
while True:
    now_ns = time.time_ns()
    recorder.reading(now_ns, Reading(i, i / 3))
    print(now_ns, flush=True)
    i += 1
    time.sleep(float(sys.argv[2]))
"""

PIPES: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}


@pytest.mark.parametrize(("period_s", "run_s"), [(0.002, 1.7), (0.4, 2.9)])
def test_a_killed_process_loses_at_most_the_last_second(tmp_path, period_s, run_s):
    path = tmp_path / "flight.mcap"
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path), str(period_s)], **PIPES) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        time.sleep(run_s)
        killed_ns = time.time_ns()
        process.send_signal(signal.SIGKILL)
        given_ns = [int(line) for line in [first, *process.stdout.read().split()]]
    log = read_log(path)
    assert not log.complete
    assert log.attachments == {"plan.plan": b"{}"}
    kept_ns = [time_ns for time_ns, _ in log.readings]
    assert kept_ns == given_ns[: len(kept_ns)]
    assert [r for _, r in log.readings] == [Reading(i, i / 3) for i in range(len(kept_ns))]
    assert len(kept_ns) >= sum(time_ns <= killed_ns - 1_000_000_000 for time_ns in given_ns)


def test_ctrl_c_loses_nothing(tmp_path):
    path = tmp_path / "flight.mcap"

    with subprocess.Popen([sys.executable, "-c", WRITER, str(path), "0"], **PIPES) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        given_ns = [int(line) for line in [first, *process.stdout.read().split()]]
    log = read_log(path)
    assert log.complete
    assert len(given_ns) > 100
    assert [time_ns for time_ns, _ in log.readings][: len(given_ns)] == given_ns


def test_what_is_written_is_synced_within_a_second(tmp_path, monkeypatch):
    path = tmp_path / "flight.mcap"
    synced: list[int] = []
    fsync = os.fsync

    def watch(descriptor: int) -> None:
        fsync(descriptor)
        synced.append(os.fstat(descriptor).st_size)

    with Recorder(path) as recorder:
        monkeypatch.setattr(os, "fsync", watch)
        recorder.reading(1, Reading(1, 2.0))
        time.sleep(1.0)
        assert synced == [path.stat().st_size]
        assert len(read_log(path).readings) == 1
        time.sleep(0.6)
        assert len(synced) == 1  # nothing new, nothing to do


def test_a_recorder_nobody_closed_is_finished_at_the_end(tmp_path):
    path = tmp_path / "flight.mcap"
    script = WRITER.replace("while True", "while i < 3")
    subprocess.run([sys.executable, "-c", script, str(path), "0"], check=True, capture_output=True, timeout=30)
    log = read_log(path)
    assert log.complete
    assert len(log.readings) == 3


def test_flush_of_the_library_closes_a_readable_chunk():
    """The recorder stands on `mcap.writer.Writer.flush` (mcap 1.5 or newer)."""
    stream = BytesIO()
    writer = Writer(stream)
    writer.start()
    channel = writer.register_channel("/a", "", 0)
    writer.add_message(channel, 1, b"one", 1)
    writer.flush()
    read = [message.data for _, _, message in _until_the_end(stream.getvalue())]
    assert read == [b"one"]


def _until_the_end(data: bytes):
    try:
        yield from NonSeekingReader(BytesIO(data)).iter_messages(log_time_order=False)
    except Exception:  # the file is not finished
        return
