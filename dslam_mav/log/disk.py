"""The bytes of a log on their way to the disk: created once, written without a buffer, synced."""

from __future__ import annotations

import contextlib
import os
import zlib
from collections.abc import Callable
from pathlib import Path


class Disk:
    """A new file as the MCAP writer sees it: `write`, `tell`, `flush`.

    Unbuffered: an error surfaces where it happens, and nothing is written again later behind our back.
    """

    def __init__(self, path: Path) -> None:
        """FileExistsError where `path` exists (also as a link), any OSError where it cannot be created."""
        self._path = path
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        self._offset = 0
        self._whole = 0  # so many bytes are whole records
        self._checksum = 0  # of those
        self._held = False
        for folder in (path.parent, path.parent.parent):  # a flight's folder is as new as its log
            _sync_folder(folder)

    def write(self, data: bytes) -> int:
        """All of `data`, whole records, or OSError."""
        rest = memoryview(data)
        while rest:
            count = os.write(self._descriptor, rest)
            self._offset += count
            rest = rest[count:]
        if not self._held:
            self._whole, self._checksum = self._offset, zlib.crc32(data, self._checksum)
        return len(data)

    def tell(self) -> int:
        """Bytes written."""
        return self._offset

    def flush(self) -> None:
        """Nothing waits here."""

    def sync(self) -> None:
        """Everything written survives a power cut from now on."""
        os.fsync(self._descriptor)

    def hold(self) -> None:
        """What is written from now on is the file's end: without all of it, it counts for nothing."""
        self._held = True

    def end_early(self, end: Callable[[int], bytes]) -> None:
        """After a failed write: the whole records alone, and behind them `end` of their checksum, if that fits."""
        with contextlib.suppress(OSError):
            self._cut()
            try:
                self.write(end(self._checksum))
            except OSError:
                self._cut()
            self.sync()

    def _cut(self) -> None:
        os.ftruncate(self._descriptor, self._whole)
        os.lseek(self._descriptor, self._whole, os.SEEK_SET)
        self._held = True

    def close(self) -> None:
        """Close the file; a late error cannot be helped any more."""
        with contextlib.suppress(OSError):
            os.close(self._descriptor)

    def discard(self) -> None:
        """Close and remove a file that never began."""
        self.close()
        with contextlib.suppress(OSError):
            self._path.unlink()


def _sync_folder(folder: Path) -> None:
    """The new file's name survives a power cut too; some file systems cannot sync a folder."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
