"""What was predicted of a flight beside what came of it: rows of text, and a picture on one logarithmic axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dslam_mav.dslam.growth import Growth, path_sd_m
from dslam_mav.dslam.scoring import Score, has_positions
from dslam_mav.records import Estimate, Medium, Prediction
from dslam_mav.records.words import count
from dslam_mav.report.log_axis import LogAxis, log_axis
from dslam_mav.report.numbers import significant

WIDTH, _LEFT, _RIGHT = 600.0, 74.0, 20.0
_TOP, _ROW = 8.0, 44.0
NONE = "none"


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """What was assumed and expected of a flight, and what was known on the way.

    `medium` as assumed, `heading_sd_rad` of headings known; `prediction`, and whether it was made then, before
    take-off, or now; `under_way`: legs flown and the estimate after them.
    """

    medium: Medium
    heading_sd_rad: float | None = None
    prediction: Prediction | None = None
    predicted_then: bool = False
    under_way: Sequence[tuple[int, Estimate]] = ()


@dataclass(frozen=True, slots=True)
class Realised:
    """RMS errors in metres, of sources and the path's corners: by the bound at the layout found, by the result's own
    uncertainty, against truth; NaN where not known.
    """

    bound_m: tuple[float, float]
    own_m: tuple[float, float]
    error_m: tuple[float, float]

    @property
    def best_known_m(self) -> tuple[float, float]:
        """The error where truth is known, else what the result says of itself."""
        return self.error_m if math.isfinite(self.error_m[0]) else self.own_m


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table; `mark` names its mark in the picture."""

    mark: str
    name: str
    note: str
    source_m: str
    path_m: str


@dataclass(frozen=True, slots=True)
class Bar:
    """One line of the picture: the predicted range (from, to; None: unbounded or unknown) and marks at x."""

    name: str
    y: float
    range_x: tuple[float, float] | None
    open_end: bool
    marks: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class Foreseen:
    """All that the page shows of it."""

    sentence: str
    basis: str
    rows: tuple[Row, ...]
    bars: tuple[Bar, ...]
    axis: LogAxis | None
    width: float
    height: float


def realised(estimate: Estimate, result: Score | None, grown: Growth | None) -> Realised:
    """Every figure as an RMS distance, as predictions are."""
    unknown = (math.nan, math.nan)
    if not has_positions(estimate):
        return Realised(unknown, unknown, unknown)
    d = estimate.sources.position_m.shape[1]
    axes = math.sqrt(d)
    own = axes * _rms(estimate.sd_m), axes * path_sd_m(estimate)
    bound = unknown
    if grown is not None:
        bound = axes * _rms(grown.source_sd_m[-1]), axes * float(grown.path_sd_m[-1])
    error = unknown if result is None else (result.source_error_rms_m, _rms(result.vertex_error_m))
    return Realised(bound, own, error)


def foreseen(background: Background, got: Realised) -> Foreseen | None:
    """None where nothing was predicted."""
    prediction = background.prediction
    if prediction is None:
        return None
    ranges = prediction.source_error_m, prediction.path_error_m
    axis = _axis(prediction, got)
    bars = () if axis is None else tuple(_bar(i, ranges[i], got, axis) for i in range(2))
    return Foreseen(
        sentence=_sentence(prediction, got),
        basis=basis(prediction, background.predicted_then),
        rows=_rows(prediction, got),
        bars=bars,
        axis=axis,
        width=WIDTH,
        height=_TOP + 2 * _ROW + 40.0,
    )


def basis(prediction: Prediction, then: bool) -> str:
    """What a prediction is for, in words."""
    low, high = prediction.n_sources
    who = count(high, "source") if low == high else f"{low} to {high} sources"
    area = " × ".join(significant(side, 3) for side in prediction.area_m)
    blind = 100.0 * prediction.unidentifiable_share
    share = f"; {blind:.0f} % of such layouts cannot be identified" if blind >= 0.5 else ""
    when = "Recorded before take-off" if then else "Worked out now, the log says nothing"
    ratio_db = 20.0 * math.log10(prediction.peak / prediction.noise_sd)
    return (
        f"{when}: for {who} anywhere in {area} m, √C {significant(prediction.spread_m, 3)} m, noise {ratio_db:.0f} dB "
        f"below a usual peak, {significant(prediction.readings_per_m, 3)} readings a metre{share}. A second answer may "
        "fit as well, which no bound shows."
    )


def metres(value: float) -> str:
    """A length, or that there is none."""
    return NONE if math.isinf(value) else significant(value, 2)


def _rows(prediction: Prediction, got: Realised) -> tuple[Row, ...]:
    (source, source_90), (path, path_90) = prediction.source_error_m, prediction.path_error_m
    rows = [
        Row("range", "Predicted", "half of all flights", metres(source), metres(path)),
        Row("", "", "nine of ten", metres(source_90), metres(path_90)),
    ]
    for mark, name, note, (of_source, of_path) in (
        ("bound", "Bound", "at the sources found", got.bound_m),
        ("own", "Realised", "the result’s own ±", got.own_m),
        ("error", "Realised", "error against truth", got.error_m),
    ):
        if math.isfinite(of_source) or math.isfinite(of_path):
            rows.append(Row(mark, name, note, metres(of_source), metres(of_path)))
    return tuple(rows)


def _sentence(prediction: Prediction, got: Realised) -> str:
    median, p90 = prediction.source_error_m
    value = got.best_known_m[0]
    if not math.isfinite(value):
        return "No position came of the flight to compare with the prediction."
    what = "The sources’ error" if math.isfinite(got.error_m[0]) else "What the result says of its own error"
    if math.isinf(median):
        return f"{what}, {metres(value)} m, is there although the mission was expected to see no sources."
    times = f"{metres(value)} m, {value / median:.2g} times the predicted median"
    if value <= median:
        return f"{what} is {times}: as good as expected or better."
    if value <= p90:
        return f"{what} is {times}: within what nine of ten flights were expected to reach."
    return f"{what} is {times}: worse than nine of ten flights were expected to be."


def _axis(prediction: Prediction, got: Realised) -> LogAxis | None:
    values = [*prediction.source_error_m, *prediction.path_error_m, *got.bound_m, *got.own_m, *got.error_m]
    return log_axis(values, _LEFT, WIDTH - _LEFT - _RIGHT)


def _bar(i: int, predicted: tuple[float, float], got: Realised, axis: LogAxis) -> Bar:
    median, p90 = predicted
    span = None
    if math.isfinite(median) and median > 0.0:
        span = axis.units(median), axis.units(p90) if math.isfinite(p90) else axis.start + axis.length
    values = (("bound", got.bound_m[i]), ("own", got.own_m[i]), ("error", got.error_m[i]))
    marks = tuple((mark, axis.units(value)) for mark, value in values if math.isfinite(value) and value > 0.0)
    return Bar(("Sources", "Corners")[i], _TOP + (i + 0.5) * _ROW, span, math.isinf(p90), marks)


def _rms(values: Sequence[float] | np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
