"""Where a flight's files go: logs/<UTC time>/, with `latest` pointing at the newest."""

from __future__ import annotations

import os
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from dslam_mav.errors import LogError


def new_flight_folder(parent: Path, now: datetime | None = None) -> Path:
    """Make logs/<UTC>/ (with a number behind it where that exists) and point `latest` at it."""
    name = (now or datetime.now(UTC)).strftime("%Y%m%dT%H%M%SZ")
    try:
        parent.mkdir(parents=True, exist_ok=True)
        for number in range(1, 1000):
            folder = parent / (name if number == 1 else f"{name}-{number}")
            try:
                folder.mkdir()
            except FileExistsError:
                continue
            _point_latest(parent, folder.name)
            return folder
    except OSError as problem:
        raise LogError(f"{parent}: no log folder can be made there: {problem.strerror}") from None
    raise LogError(f"{parent}: a thousand folders begin with {name}")


def _point_latest(parent: Path, name: str) -> None:
    latest = parent / "latest"
    if latest.exists() and not latest.is_symlink():
        return  # somebody's own folder of that name
    temporary = parent / f".latest-{os.getpid()}"
    temporary.unlink(missing_ok=True)
    temporary.symlink_to(name)
    temporary.replace(latest)


def write_whole(path: Path, text: str) -> None:
    """Write a text file whole or not at all; LogError where it cannot be written."""
    try:
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", dir=path.parent, prefix=f".{path.name}.", delete=False
        ) as file:
            file.write(text)
        try:
            os.chmod(file.name, 0o644)  # temporary files are made private
            os.replace(file.name, path)
        except OSError:
            os.unlink(file.name)
            raise
    except OSError as problem:
        raise LogError(f"{path}: cannot be written: {problem.strerror}") from None
