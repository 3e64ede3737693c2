"""`--signing-key-file`: the key that all packets are signed with. No text written here ever holds a part of it."""

from __future__ import annotations

import os
import re
import stat
from argparse import Namespace
from pathlib import Path

from dslam_mav.commands.screen import Screen
from dslam_mav.errors import BadInputError, unreadable
from dslam_mav.mav.signing import KEY_BYTES, Signing

_DIGITS = 2 * KEY_BYTES
_MOST_BYTES = 4096
_OTHERS_MAY_READ = stat.S_IRGRP | stat.S_IROTH


def signing_from(options: Namespace, screen: Screen) -> Signing | None:
    """What the options ask for: a key read from its file, or None; BadInputError, one line, on a bad file."""
    if not options.signing_key_file:
        return None
    path = Path(options.signing_key_file)
    key, mode = read_key(path)
    if mode & _OTHERS_MAY_READ:
        screen.warn(f"--signing-key-file {path}: others may read it: chmod 600 keeps it to yourself")
    return Signing(key)


def read_key(path: Path) -> tuple[bytes, int]:
    """The key (32 bytes) and the file's mode; BadInputError names the file and what is wrong, never its content."""
    name = f"--signing-key-file {path}"
    if re.fullmatch(r"[0-9a-fA-F]{32,}", str(path)) and not path.exists():
        raise BadInputError(
            "--signing-key-file: expected the name of a file that holds the key, got what looks like one"
        )
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            data = file.read(_MOST_BYTES)
    except (OSError, ValueError) as problem:
        raise unreadable(name, problem) from None
    digits = data.strip()
    wrong = re.search(rb"[^0-9a-fA-F]", digits)
    if wrong is not None and digits.isascii():
        raise BadInputError(
            f"{name}: character {wrong.start() + 1} is no hexadecimal digit: expected {_DIGITS} of them"
        )
    if wrong is not None or len(digits) != _DIGITS:
        found = f"{len(digits)} digits" if wrong is None else "bytes that are no text"
        raise BadInputError(f"{name}: {found}: expected {_DIGITS} hexadecimal digits ({KEY_BYTES} bytes)")
    key = bytes.fromhex(digits.decode())
    if not any(key):
        raise BadInputError(f"{name}: all zeros, which is MAVLink's word for no signing: expected a key")
    return key, mode
