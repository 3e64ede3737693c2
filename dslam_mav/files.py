"""Files that are there whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from dslam_mav.errors import DslamError


def write_whole(path: Path, data: bytes, failure: type[DslamError]) -> None:
    """Put `data` into the file, on the disk before it takes the name; `failure` names the file and why not."""
    beside = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        try:
            with beside.open("wb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            os.replace(beside, path)
        finally:
            beside.unlink(missing_ok=True)
    except OSError as problem:
        raise failure(f"{path}: cannot be written: {problem.strerror}") from None
