"""Finished points on disk, a line each, as they come: whatever ends the process, they need not be computed again.

A line is a JSON object with `key` and `row`. A line cut short by a crash is dropped; the last line of a key counts.
"""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

from dslam_mav.errors import DslamError, unwritable
from dslam_mav.sweep.points.columns import Row

try:
    import fcntl
except ImportError:  # Windows: nobody keeps a second sweep away
    fcntl = None  # type: ignore[assignment]

SYNC_S = 1.0


class Journal:
    """The journal at `path`, made where there is none. DslamError: not readable or writable, or in use."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._synced_s = time.monotonic()
        self.rows: dict[str, Row] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: BinaryIO = path.open("ab+")
            self._lock()
            self._read()
        except OSError as problem:
            raise self._failure(problem) from None

    def add(self, key: str, row: Row) -> None:
        """Keep a row. It outlives this process at once, and a loss of power within a second."""
        self.rows[key] = row
        try:
            self._file.write(json.dumps({"key": key, "row": row}, allow_nan=False).encode() + b"\n")
            self._file.flush()
            if time.monotonic() - self._synced_s > SYNC_S:
                os.fsync(self._file.fileno())
                self._synced_s = time.monotonic()
        except OSError as problem:
            raise self._failure(problem) from None

    def close(self) -> None:
        """All on the disk."""
        try:
            os.fsync(self._file.fileno())
            self._file.close()
        except OSError as problem:
            raise self._failure(problem) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _lock(self) -> None:
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._file.close()
            raise DslamError(f"{self._path}: another sweep is writing it; wait for it or give another --out") from None

    def _read(self) -> None:
        self._file.seek(0)
        whole = 0
        for line in self._file:
            if line.endswith(b"\n"):
                whole += len(line)
                self._take(line)
        self._file.truncate(whole)

    def _take(self, line: bytes) -> None:
        try:
            entry = json.loads(line)
            key, row = entry["key"], entry["row"]
        except (ValueError, KeyError, TypeError):
            return  # damaged: the point is computed again
        if isinstance(key, str) and isinstance(row, dict):
            self.rows[key] = row

    def _failure(self, problem: OSError) -> DslamError:
        return unwritable(self._path, problem)
