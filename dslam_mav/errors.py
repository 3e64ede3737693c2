"""What can go wrong, as a person should read it: one sentence that names what, where and what would be right.

`BadInputError` ends a command with exit code 2, every other `DslamError` with 1. Misuse of the Python API is a plain
`ValueError` that names the argument. A failure of the mathematics is no exception at all: it is a `Verdict`.
"""

from __future__ import annotations


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
