"""Files that are there whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from dslam_mav.errors import DslamError


def write_whole(path: Path, data: bytes, failure: type[DslamError], *, anew: bool = True) -> None:
    """Put `data` into the file, on the disk before it takes the name; `failure` names the file and why not.

    Without `anew` a file that exists, even since a moment, is a failure too.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        try:
            with beside.open("wb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            if anew or not _linked(beside, path):
                os.replace(beside, path)
        finally:
            beside.unlink(missing_ok=True)
    except OSError as problem:
        raise failure(f"{path}: cannot be written: {problem.strerror}") from None


def _linked(beside: Path, path: Path) -> bool:
    """Whether `path` is a second name for the file now; FileExistsError where it names one already."""
    try:
        os.link(beside, path)
    except FileExistsError:
        raise
    except OSError:  # a file system without links, as on memory cards
        if os.path.lexists(path):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST)) from None
        return False
    return True
