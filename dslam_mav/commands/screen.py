"""What a person sees: text and tables on standard output, progress on a terminal, one JSON object with --json."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

Advance = Callable[[float, float, str], None]


class Screen:
    """`json_only`: nothing but the JSON object goes to standard output."""

    def __init__(self, *, json_only: bool = False) -> None:
        self.json_only = json_only
        width = None if sys.stdout.isatty() else 110
        self._out = Console(highlight=False, soft_wrap=True, width=width)
        self._err = Console(stderr=True, highlight=False)

    def say(self, text: str = "") -> None:
        """One line of plain text."""
        if not self.json_only:
            self._out.print(text, markup=False)

    def table(self, table: Table) -> None:
        """A table."""
        if not self.json_only:
            self._out.print(table, soft_wrap=False)

    def warn(self, text: str) -> None:
        """One line on standard error."""
        self._err.print(f"warning: {text}", markup=False, soft_wrap=True)

    def result(self, value: Any) -> None:
        """The JSON object, where it was asked for."""
        if self.json_only:
            sys.stdout.write(json.dumps(value, allow_nan=False) + "\n")

    @contextmanager
    def progress(self, what: str) -> Iterator[Advance]:
        """A progress bar on a terminal, nothing on a pipe: yields advance(done, total, what)."""
        if not sys.stderr.isatty():
            yield lambda done, total, text: None  # noqa: ARG005
            return
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        with Progress(*columns, console=self._err, transient=True) as bar:
            task = bar.add_task(what, total=None)
            yield lambda done, total, text: bar.update(task, completed=done, total=total, description=text)
