"""Commands run as a user runs them: in this process where that is enough, as a process of their own where not."""

from __future__ import annotations

import contextlib
import io
import json
import os
import pty
import re
import select
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dslam_mav.cli import main

COMMAND = [sys.executable, "-m", "dslam_mav"]

# `python -m dslam_mav`, also where the tests run in the background: a shell lets those ignore Ctrl-C.
INTERRUPTIBLE = (
    "import runpy, signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "runpy.run_module('dslam_mav', run_name='__main__', alter_sys=True)"
)

SCENE: dict[str, Any] = {
    "medium": {"diffusivity_m2_s": 0.5, "ambient": 20.0, "static": True},
    "sources": [
        {"position_m": [11.5, 4.0], "amplitude": 700.0, "activation_s": -12.5},
        {"position_m": [4.0, 4.8], "amplitude": 570.0, "activation_s": -12.5},
    ],
    "path": {
        "vertices_m": [
            [0.0, 0.0], [16.0, 0.0], [1.58, 6.94], [11.56, -5.57],
            [8.0, 10.03], [4.44, -5.57], [14.42, 6.94], [0.0, 0.0],
        ]
    },
    "sampling": {"spacing_m": 0.5, "speed_m_s": 5.0},
    "noise": {"snr_db": 35.0},
    "seed": 3,
}  # fmt: skip


@dataclass(frozen=True)
class Done:
    code: int
    out: str
    err: str

    @property
    def object(self) -> Any:
        """The one JSON object that standard output is."""
        assert self.out.count("\n") == 1, self.out
        return json.loads(self.out)

    def line(self) -> str:
        """The one line that standard error is."""
        assert self.err.count("\n") == 1, self.err
        assert "Traceback" not in self.err
        return self.err.rstrip("\n")


def run(*words: object) -> Done:
    """A command in this process, on pipes."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main([str(word) for word in words])
        except SystemExit as leave:  # --help
            code = int(leave.code or 0)
    return Done(code, out.getvalue(), err.getvalue())


def spawn(*words: object, **settings: Any) -> subprocess.Popen[str]:
    """A command in a process of its own, on pipes."""
    return subprocess.Popen(
        [sys.executable, "-c", INTERRUPTIBLE, *(str(word) for word in words)],
        text=True,
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **settings},
    )


def end(process: subprocess.Popen[str], timeout_s: float = 60.0) -> Done:
    """Wait for a process."""
    try:
        out, err = process.communicate(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        out, err = process.communicate()
        raise AssertionError(f"still running after {timeout_s} s: {out}{err}") from None
    return Done(process.returncode, out, err)


def stop(process: subprocess.Popen[str]) -> None:
    """End a process that may have ended already."""
    process.kill()
    process.communicate()


def spawn_vehicle(*words: object) -> tuple[subprocess.Popen[str], str]:
    """A loopback vehicle in a process of its own, and the URL to reach it at."""
    process = spawn("vehicle", "--listen", "udpin:127.0.0.1:0", "--json", *words)
    assert process.stdout is not None
    first = process.stdout.readline()
    assert first, process.communicate()[1]
    return process, json.loads(first)["urls"][0].replace("udpin", "udpout")


def on_a_terminal(*words: object, columns: int = 100, timeout_s: float = 60.0) -> Done:
    """A command whose output is a terminal so many columns wide; colours and cursor movements are taken out."""
    master, slave = pty.openpty()
    environment = {**os.environ, "COLUMNS": str(columns), "TERM": "xterm-256color"}
    process = subprocess.Popen(
        [*COMMAND, *(str(word) for word in words)], stdin=slave, stdout=slave, stderr=slave, env=environment
    )
    os.close(slave)
    data, until_s = b"", time.monotonic() + timeout_s
    try:
        while time.monotonic() < until_s:
            if not select.select([master], [], [], 0.1)[0]:
                continue
            try:
                piece = os.read(master, 65536)
            except OSError:
                break
            if not piece:
                break
            data += piece
        code = process.wait(max(0.1, until_s - time.monotonic()))
    finally:
        process.kill()
        os.close(master)
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", data.decode("utf-8"))
    return Done(code, text, "")


def wait_for(path: Path, size: int, timeout_s: float = 30.0) -> None:
    """Until a file is so large."""
    until_s = time.monotonic() + timeout_s
    while not (path.exists() and path.stat().st_size >= size):
        assert time.monotonic() < until_s, f"{path} is not {size} bytes large"
        time.sleep(0.05)


def the_log(folder: Path) -> Path:
    """The one flight log under a folder."""
    (log,) = folder.glob("*Z*/flight.mcap")
    return log


def left(folder: Path) -> set[str]:
    """Names of all files under a folder, hidden ones as well."""
    return {path.name for path in folder.rglob("*") if path.is_file()}
