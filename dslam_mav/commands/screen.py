"""What a person sees: text and tables on standard output, progress on a terminal, one JSON object with --json."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

WIDTH = 100
"""Text is broken at the terminal's width, but no wider than this; on a pipe a sentence stays one line."""


class Advance(Protocol):
    """Moves a progress bar; a `total` of None: no telling how long it takes."""

    def __call__(self, what: str, done: float, total: float | None, detail: str = "") -> None: ...  # noqa: D102


class Screen:
    """`json_only`: nothing but the JSON object goes to standard output."""

    def __init__(self, *, json_only: bool = False) -> None:
        self.json_only = json_only
        self._terminal = sys.stdout.isatty()
        self._out = Console(highlight=False, width=None if self._terminal else WIDTH)
        if self._terminal and self._out.width > WIDTH:
            self._out = Console(highlight=False, width=WIDTH)
        self._err = Console(stderr=True, highlight=False)

    def say(self, text: str = "") -> None:
        """A paragraph of plain text."""
        if not self.json_only:
            self._out.print(text, markup=False, soft_wrap=not self._terminal)

    def follow(self, text: str) -> None:
        """News of long work: on a terminal only."""
        if self._terminal:
            self.say(text)

    def table(self, table: Table) -> None:
        """A table; on a pipe no line of it ends in blanks."""
        if self.json_only:
            return
        if self._terminal:
            self._out.print(table)
            return
        with self._out.capture() as drawn:
            self._out.print(table)
        self.say("\n".join(line.rstrip() for line in drawn.get().splitlines()))

    def warn(self, text: str) -> None:
        """One line on standard error."""
        self._err.print(f"warning: {text}", markup=False, soft_wrap=True)

    def result(self, value: Any) -> None:
        """The JSON object, where it was asked for."""
        if self.json_only:
            sys.stdout.write(json.dumps(value, allow_nan=False) + "\n")
            sys.stdout.flush()

    @contextmanager
    def progress(self, what: str) -> Iterator[Advance]:
        """A progress bar on a terminal, nothing on a pipe; it is gone when the work is done."""
        if not sys.stderr.isatty():
            yield _nothing
            return
        columns = (
            SpinnerColumn("line"),
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=24),
            TextColumn("{task.fields[detail]}", markup=False),
            TimeElapsedColumn(),
        )
        # What is said meanwhile goes above the bar, but only where both are the same terminal.
        bar = Progress(*columns, console=self._err, transient=True, redirect_stdout=self._terminal)
        with bar:
            task = bar.add_task(what, total=None, detail="")

            def advance(what: str, done: float, total: float | None, detail: str = "") -> None:
                bar.update(task, description=what, completed=done, total=total, detail=detail)

            yield advance


def _nothing(what: str, done: float, total: float | None, detail: str = "") -> None:
    pass
