"""[assume] of a sweep over logs: the options of `replay`, by their names."""

from __future__ import annotations

import argparse
from argparse import Namespace
from pathlib import Path
from typing import Any, NoReturn

from dslam_mav.commands.options import assumptions
from dslam_mav.errors import BadInputError


class _Options(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise BadInputError(message)


def assumed(table: dict[str, Any], method: str, file: Path) -> Namespace:
    """Options as `replay` has them, from keys such as `sources` or `heading_sd`; BadInputError names `file` and key."""
    parser = _Options(add_help=False, allow_abbrev=False)
    assumptions(parser)
    known = {action.dest: action for action in parser._actions if action.dest != "method"}
    words = [f"--method={method}"]
    for key, value in table.items():
        if key not in known:
            names = ", ".join(known)
            raise BadInputError(f"{file}: assume.{key}: unknown key, expected one of {names}")
        option = known[key].option_strings[-1]
        if known[key].nargs == 0:
            if not isinstance(value, bool):
                raise BadInputError(f"{file}: assume.{key}: expected true or false, got {value!r}")
            words += [option] if value else []
        elif isinstance(value, bool) or not isinstance(value, (int, float, str)):
            raise BadInputError(f"{file}: assume.{key}: expected a number or a word, got {value!r}")
        else:
            words.append(f"{option}={value}")
    try:
        return parser.parse_args(words)
    except BadInputError as problem:
        raise BadInputError(f"{file}: assume: {problem}") from None
