"""`--live [HOST:]PORT`: where Foxglove finds a flight."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence

HOST, PORT = "127.0.0.1", 8765

_ADDRESS = re.compile(r"(?:(.*):)?(\d+)")


def live(parser: argparse.ArgumentParser, what: str = "serve what is logged to Foxglove as it comes") -> None:
    """The option; its value is (host, port), None where it is not given."""
    parser.add_argument(
        "--live", metavar="[HOST:]PORT", nargs="?", type=_address, const=(HOST, PORT),
        help=f"{what} (default: {HOST}:{PORT})",
    )  # fmt: skip


def live_apart(words: Sequence[str]) -> list[str]:
    """The words of a command line, `--live` without an address made such that what follows is not taken for one."""
    following = [*words, ""][1:]
    return [
        f"--live={HOST}:{PORT}" if word == "--live" and not _ADDRESS.fullmatch(then) else word
        for word, then in zip(words, following, strict=True)
    ]


def _address(text: str) -> tuple[str, int]:
    found = _ADDRESS.fullmatch(text)
    if found is None or int(found[2]) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r}: expected [HOST:]PORT, a port of 65535 or less")
    return (found[1] or HOST).strip("[]"), int(found[2])
