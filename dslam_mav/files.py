"""Files that are there whole or not at all."""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from pathlib import Path

from dslam_mav.errors import BadInputError, unwritable


def check_output(path: Path, endings: Sequence[str] = ()) -> None:
    """Before long work: BadInputError where the file could not be written in the end, or its ending is another format's
    than those of these `endings`.
    """
    if path.suffix and endings and path.suffix.lower() not in endings:
        raise BadInputError(f"{path}: ending {path.suffix!r}: expected {' or '.join(endings)}, what is written there")
    if path.is_dir():
        raise unwritable(path, OSError(errno.EISDIR, os.strerror(errno.EISDIR)))
    if path.exists() and not path.is_file():
        raise BadInputError(f"{path}: cannot be written: it is no file but a device or a pipe")
    _check_into(path.parent, path)


def check_folder(path: Path) -> None:
    """Before long work: BadInputError where files could not be put into the folder, which is made where it is not."""
    _check_into(next((above for above in (path, *path.absolute().parents) if above.exists()), path), path)


def _check_into(folder: Path, path: Path) -> None:
    if not (folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)):
        number = errno.ENOTDIR if folder.exists() else errno.ENOENT
        if folder.is_dir():
            number = errno.EROFS if _read_only(folder) else errno.EACCES
        raise unwritable(path, OSError(number, os.strerror(number)))


def _read_only(folder: Path) -> bool:
    """Whether the whole file system is, as far as can be told."""
    return hasattr(os, "statvfs") and bool(os.statvfs(folder).f_flag & os.ST_RDONLY)


def write_whole(path: Path, data: bytes, *, anew: bool = True) -> None:
    """Put `data` into the file, on the disk before it takes the name; raises `unwritable`.

    Without `anew` a file that exists, even since a moment, is a failure too.
    """
    check_output(path)
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
        raise unwritable(path, problem) from None


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
