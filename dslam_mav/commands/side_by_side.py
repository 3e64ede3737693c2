"""Two answers of one flight beside each other, on a terminal."""

from __future__ import annotations

from rich import box
from rich.table import Table

from dslam_mav.records import Estimate, Truth
from dslam_mav.report.beside import beside


def comparison(before: Estimate, after: Estimate, truth: Truth | None, heads: tuple[str, str]) -> Table:
    """A row for each thing the answers say, a column for each answer."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, padding=(0, 2, 0, 0))
    table.add_column("")
    for head in heads:
        table.add_column(head, overflow="fold")
    for name, cells in beside((before, after), truth, heads).rows:
        table.add_row(name, *cells)
    return table
