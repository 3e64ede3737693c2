"""An experiment and its result, whatever it is about."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from dslam_mav.experiments.trials import Row, Statistic
from dslam_mav.experiments.world import World

Worlds = Mapping[str, World]
"""By name; a recording that is missing is missing here too."""
Average = Literal["mean", "rms"]


class Drawn(Protocol):
    """A picture, as matplotlib's figures are."""

    def savefig(self, fname: Any, /) -> None:
        """Write it to a file of the ending's kind."""


@dataclass(frozen=True, slots=True)
class Shown:
    """An error the table shows for every method: its name, unit, how it is averaged, and the methods that have it."""

    error: str
    unit: str = ""
    average: Average = "mean"
    methods: tuple[str, ...] = ("paper", "joint")


@dataclass(frozen=True, slots=True, eq=False)
class Experiment:
    """A figure or table of the paper.

    `worlds`: names of scene files or recordings. `rows` makes the rows over them; `picture` draws the result, from the
    rows and a seed. `notes` state what the paper leaves open and how it was chosen.
    """

    name: str
    title: str
    worlds: tuple[str, ...]
    columns: tuple[str, ...]
    shown: tuple[Shown, ...]
    rows: Callable[[Worlds], list[Row]]
    picture: Callable[[Result, int], Drawn]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """Rows with their statistics by "method.error"; a row without any has not been run."""

    experiment: Experiment
    rows: Sequence[Row]
    statistics: Sequence[Mapping[str, Statistic]]

    def value(self, row: int, method: str, shown: Shown) -> float:
        """What the table prints for a method ("printed" and "bound" are the row's own); NaN where there is nothing."""
        if method in ("printed", "bound"):
            given = self.rows[row].printed if method == "printed" else self.rows[row].limits
            return float(given.get(shown.error, float("nan")))
        found = self.statistics[row].get(f"{method}.{shown.error}")
        return float("nan") if found is None else float(getattr(found, shown.average))
