"""Jobs that leave a file for every time they are run, and some that do worse; importable by worker processes."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

from dslam_mav.errors import BadInputError
from dslam_mav.sweep.points.columns import Column

COLUMNS = (
    Column("n", "whole", "which"), Column("square", "number", "of n"), Column("failure", "text", "why not")
)  # fmt: skip


@dataclass(frozen=True)
class Square:
    n: int
    folder: Path
    seconds: float = 0.0

    @property
    def key(self) -> str:
        return f"square {self.n}"

    @property
    def coordinates(self) -> dict[str, Any]:
        return {"n": self.n}

    def run(self) -> dict[str, Any]:
        (self.folder / f"{self.n}-{uuid4().hex}").touch()
        time.sleep(self.seconds)
        return {"square": float(self.n**2)}

    def times_run(self) -> int:
        return len(list(self.folder.glob(f"{self.n}-*")))


class Dies(Square):
    """Its process is killed, every time or only the first."""

    def run(self) -> dict[str, Any]:
        row = super().run()
        if self.seconds >= 0.0 and (self.seconds > 0.0 or self.times_run() == 1):
            os.kill(os.getpid(), signal.SIGKILL)
        return row


class Raises(Square):
    def run(self) -> dict[str, Any]:
        raise ZeroDivisionError("one\ntwo")


class Refuses(Square):
    def run(self) -> dict[str, Any]:
        raise BadInputError("file.mcap: nothing in it")


class Tells(Square):
    """What the worker's libraries were told about threads."""

    def run(self) -> dict[str, Any]:
        return {"square": float(os.environ["OPENBLAS_NUM_THREADS"] + os.environ["NUMBA_NUM_THREADS"])}
