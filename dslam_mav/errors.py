"""What can go wrong, as a person should read it: one sentence that names what, where and what would be right.

`BadInputError` ends a command with exit code 2, every other `DslamError` with 1. Misuse of the Python API is a plain
`ValueError` that names the argument. A failure of the mathematics is no exception at all: it is a `Verdict`.
"""

from __future__ import annotations

import errno


class DslamError(Exception):
    """A failure at run time that the person at the keyboard should read; the message is one line."""


class BadInputError(DslamError):
    """A file, URL or option that cannot be used as given; names the file, the field and the value."""


class LinkError(DslamError):
    """A connection that could not be opened, or that went silent."""


class MissionError(DslamError):
    """A mission transfer or mission start that the vehicle refused or never finished."""


class LogError(DslamError):
    """A log that could not be written or read."""


_THE_DISKS_FAULT = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EMFILE, errno.ENFILE})
"""Another name would not help: all else is a path that cannot be used as given."""


def why(problem: Exception) -> str:
    """The reason alone, as it stands within a sentence."""
    reason = getattr(problem, "strerror", None) or str(problem) or type(problem).__name__
    return reason[0].lower() + reason[1:] if reason[1:2].islower() else reason


def unreadable(path: object, problem: Exception) -> BadInputError:
    """One line."""
    return BadInputError(f"{path}: cannot be read: {why(problem)}")


def unwritable(path: object, problem: Exception, told: str = "cannot be written") -> DslamError:
    """One line: a BadInputError where the path is to blame (no such folder, not permitted, there already), a LogError
    where the disk is (full, broken).
    """
    number = problem.errno if isinstance(problem, OSError) else None
    return (LogError if number in _THE_DISKS_FAULT else BadInputError)(f"{path}: {told}: {why(problem)}")
