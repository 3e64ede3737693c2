"""How every command introduces itself: a line, an example, --json."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn, TypeAlias

from dslam_mav.commands.live_options import live_apart
from dslam_mav.errors import BadInputError

Commands: TypeAlias = "argparse._SubParsersAction[Any]"


class Parser(argparse.ArgumentParser):
    """Bad usage is one line on standard error; the help stays behind --help. Options are not abbreviated."""

    def __init__(self, **settings: object) -> None:
        super().__init__(**{"allow_abbrev": False, **settings})  # type: ignore[arg-type]
        # -33.5,151.2 is a place in the south, no option
        self._negative_number_matcher = re.compile(r"-[\d.]")

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """`--live` may stand alone before a PLAN or LOG."""
        words = sys.argv[1:] if args is None else args
        return super().parse_known_args(live_apart(words), namespace)

    def error(self, message: str) -> NoReturn:
        """BadInputError."""
        raise BadInputError(f"{self.prog}: {message} (see {self.prog} --help)")


def add_command(
    commands: Commands, name: str, text: str, example: str, run: tuple[str, str]
) -> argparse.ArgumentParser:
    """The parser of one command, run by `run`: a module of this folder and its function."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=text,
        description=f"{text[0].upper()}{text[1:]}.",
        epilog=f"example: dslam-mav {name} {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    return parser
