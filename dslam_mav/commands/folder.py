"""Where a flight's files go: logs/<UTC time>/, with `latest` pointing at the newest."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from dslam_mav.errors import LogError, unwritable


@contextlib.contextmanager
def flight_folder(parent: Path, now: datetime | None = None) -> Iterator[Path]:
    """A new folder `parent`/<UTC>/, gone again at the end of the block if nothing was put in it."""
    folder = new_flight_folder(parent, now)
    try:
        yield folder
    finally:
        with contextlib.suppress(OSError):  # not empty: it stays
            folder.rmdir()


def new_flight_folder(parent: Path, now: datetime | None = None) -> Path:
    """Make `parent`/<UTC>/, with a number behind it where that exists; `files.unwritable` where that cannot be."""
    name = (now or datetime.now(UTC)).strftime("%Y%m%dT%H%M%SZ")
    try:
        parent.mkdir(parents=True, exist_ok=True)
        for number in range(1, 1000):
            folder = parent / (name if number == 1 else f"{name}-{number}")
            try:
                folder.mkdir()
            except FileExistsError:
                continue
            return folder
    except OSError as problem:
        raise unwritable(parent, problem, "no log folder can be made there") from None
    raise LogError(f"{parent}: a thousand folders begin with {name}")


def point_latest(folder: Path) -> None:
    """Make `latest` beside the folder point at it, unless that is somebody's own file."""
    latest = folder.parent / "latest"
    if latest.exists() and not latest.is_symlink():
        return
    temporary = folder.parent / f".latest-{os.getpid()}"
    try:
        temporary.unlink(missing_ok=True)
        temporary.symlink_to(folder.name)
        temporary.replace(latest)
    except OSError:
        return  # a file system without links: the log itself matters more
