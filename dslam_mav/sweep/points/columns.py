"""What a row of a sweep says: names carry their unit, a value that is not there is None."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

Scalar = str | int | float | bool | None
Row = dict[str, Scalar]


@dataclass(frozen=True, slots=True)
class Column:
    """A column's name, the kind of its values, and what it means."""

    name: str
    kind: Literal["text", "whole", "number", "truth"]
    what: str


OF_SCENES = (
    Column("scene", "text", "name of the scene file, or of the random scene"),
    Column("mission", "text", "name of the mission"),
    Column("noise", "text", "level as asked for: 20 dB, sd 0.1, or the scene's own"),
    Column("method", "text", "joint or paper"),
    Column("seed", "whole", "of the file's seeds"),
)
OF_LOGS = (Column("log", "text", "path below the folder"), Column("method", "text", "joint or paper"))
RESULTS = (
    Column("k_true", "whole", "sources there are"),
    Column("k_found", "whole", "sources of the answer"),
    Column("verdict", "text", "IDENTIFIED, AMBIGUOUS, …; none where the point failed"),
    Column("source_error_median_m", "number", "over the sources, each beside the one it stands for; relative to leg 1"),
    Column("source_error_max_m", "number", "the worst of them"),
    Column("source_error_rms_m", "number", "root mean square of them"),
    Column("path_error_m", "number", "root mean square along the path, relative to leg 1"),
    Column("sd_m", "number", "what the answer says of itself: root of the sources' mean position variance"),
    Column("bound_m", "number", "the same by the Cramér–Rao bound at the truth"),
    Column("error_over_bound", "number", "source_error_rms_m / bound_m"),
    Column("nees", "number", "mean squared error in the answer's own covariance, per degree of freedom: 1 is honest"),
    Column("found", "truth", "the answer is the truth: every source within 5 sd, or √C/20"),
    Column("listed", "truth", "the answer or one of its alternatives is the truth"),
    Column("alternatives", "whole", "other answers that fit as well"),
    Column("nearest_error_m", "number", "source_error_rms_m of the best of all answers given"),
    Column("readings", "whole", "of the flight"),
    Column("legs", "whole", "of the flight"),
    Column("path_length_m", "number", "of the flight"),
    Column("spread_m", "number", "√C at the first reading, of scenes the true one"),
    Column("noise_sd", "number", "of a reading, of scenes the true one"),
    Column("noise_snr_db", "number", "of the flight's readings"),
    Column("reason", "text", "why the verdict is what it is"),
    Column("failure", "text", "why there is no verdict, where there is none"),
)
SECONDS = Column("seconds", "number", "the estimate took; the only column that differs from run to run")


def plain(row: Row) -> Row:
    """The row with Python's own numbers, None for what is not finite."""
    return {name: _plain(value) for name, value in row.items()}


def _plain(value: object) -> Scalar:
    own = value.item() if isinstance(value, np.generic) else value
    if isinstance(own, float) and not np.isfinite(own):
        return None
    return own  # type: ignore[return-value]


def whole_row(columns: Iterable[Column], row: Row) -> Row:
    """Every column in its order, None where the row has nothing to say."""
    return {column.name: row.get(column.name) for column in columns}
