"""What flows: flights in, estimates out. Frozen, checked on creation, arrays read-only float64, SI units.

The meaning of every field is public (README, "Python"); shapes: K sources, L legs, N readings on a leg, d dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Gauge = Literal["canonical", "anchored"]


def read_only(value: ArrayLike, argument: str, shape: tuple[int | None, ...] | None = None) -> Array:
    """A private read-only float64 copy of `value`; a wrong shape (None: any length) is a ValueError."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{argument}: expected numbers") from None
    if shape is not None and (
        array.ndim != len(shape) or any(w is not None and w != h for w, h in zip(shape, array.shape, strict=True))
    ):
        wanted = ", ".join("any" if w is None else str(w) for w in shape)
        raise ValueError(f"{argument}: expected shape ({wanted}), got {array.shape}")
    array.setflags(write=False)
    return array


def _finite(array: Array, argument: str) -> None:
    if not np.isfinite(array).all():
        bad = int(np.flatnonzero(~np.isfinite(array.ravel()))[0])
        raise ValueError(f"{argument}[{bad}]: expected a finite number, got {array.ravel()[bad]}")


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """One straight leg: `reading` (N,) taken at `distance_m` (N,) along its line, at `time_s` (N,)."""

    length_m: float
    distance_m: Array
    time_s: Array
    reading: Array
    length_sd_m: float = 0.0
    rise_m: float | None = None

    def __post_init__(self) -> None:
        for name in ("distance_m", "time_s", "reading"):
            array = read_only(getattr(self, name), name, (None,))
            _finite(array, name)
            object.__setattr__(self, name, array)
        if not (self.distance_m.size == self.time_s.size == self.reading.size):
            raise ValueError(
                f"reading: expected as many as distance_m and time_s, got {self.reading.size}, "
                f"{self.distance_m.size} and {self.time_s.size}"
            )
        if not (np.isfinite(self.length_m) and self.length_m > 0.0):
            raise ValueError(f"length_m: expected a positive length, got {self.length_m}")
        if not (np.isfinite(self.length_sd_m) and self.length_sd_m >= 0.0):
            raise ValueError(f"length_sd_m: expected 0 or more, got {self.length_sd_m}")
        if self.rise_m is not None and not (np.isfinite(self.rise_m) and abs(self.rise_m) <= self.length_m):
            raise ValueError(f"rise_m: expected at most the leg's length {self.length_m}, got {self.rise_m}")
        if (np.diff(self.time_s) <= 0.0).any():
            raise ValueError("time_s: expected strictly increasing times")


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """The legs in the order flown; times increase strictly over the whole flight.

    `closed` says that the path ends where it began.
    """

    legs: tuple[Leg, ...]
    closed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "legs", tuple(self.legs))
        last = -np.inf
        for j, leg in enumerate(self.legs):
            if leg.time_s.size and leg.time_s[0] <= last:
                raise ValueError(f"legs[{j}].time_s: expected times after leg {j - 1}'s last, {last}")
            last = leg.time_s[-1] if leg.time_s.size else last

    @property
    def n_readings(self) -> int:
        """Readings on all legs together."""
        return sum(leg.reading.size for leg in self.legs)

    @property
    def lengths_m(self) -> Array:
        """(L,) leg lengths."""
        return np.array([leg.length_m for leg in self.legs])


@dataclass(frozen=True, slots=True, eq=False)
class Medium:
    """What is known of the medium; None means: estimate it.

    `spread_m` is √C of a static field and stands for μ and τ. `static` holds the field still at the flight's first
    reading. `activation_s`: a number for all sources, or "shared" for one unknown common to all; None, which would
    be one unknown per source, only where nothing but the spread is asked for.
    """

    diffusivity_m2_s: float | None = None
    activation_s: float | Literal["shared"] | None = None
    spread_m: float | None = None
    ambient: float | None = 0.0
    static: bool = False
    dimensions: int = 2
    sensor_lag_s: float | None = 0.0

    def __post_init__(self) -> None:
        for name in ("diffusivity_m2_s", "spread_m"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name}: expected a positive number or None, got {value}")
        if self.ambient is not None and not np.isfinite(self.ambient):
            raise ValueError(f"ambient: expected a finite number or None, got {self.ambient}")
        if self.dimensions not in (2, 3):
            raise ValueError(f"dimensions: expected 2 or 3, got {self.dimensions}")
        if self.spread_m is not None and not self.static:
            raise ValueError("spread_m: only a static field has one spread; set static=True or give μ and τ")
        if isinstance(self.activation_s, str):
            if self.activation_s != "shared":
                raise ValueError(f'activation_s: expected a number, None or "shared", got {self.activation_s!r}')
        elif self.activation_s is not None and not np.isfinite(self.activation_s):
            raise ValueError(f"activation_s: expected a finite number or None, got {self.activation_s}")


class Verdict(IntEnum):
    """How far an estimate can be trusted; the number is sent as `DSLAM_ST`."""

    IDENTIFIED = 0
    AMBIGUOUS = 1
    NOT_IDENTIFIABLE = 2
    MODEL_MISFIT = 3
    NOT_CONVERGED = 4
    TOO_FEW_DATA = 5

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        return _SENTENCES[self]


_SENTENCES = {
    Verdict.IDENTIFIED: "Sources and path are identified.",
    Verdict.AMBIGUOUS: "Other solutions fit the readings too: see the alternatives.",
    Verdict.NOT_IDENTIFIABLE: "The readings cannot tell where the sources are on this path.",
    Verdict.MODEL_MISFIT: "The readings do not fit the diffusion model: the answer is uncertain beyond its noise.",
    Verdict.NOT_CONVERGED: "The search found no solution that fits the readings.",
    Verdict.TOO_FEW_DATA: "Too few legs or readings for this many sources.",
}


@dataclass(frozen=True, slots=True, eq=False)
class Sources:
    """K sources, largest amplitude first: `position_m` (K, d), `amplitude` (reading·m^d), `activation_s` (K,)."""

    position_m: Array
    amplitude: Array
    peak_reading: Array
    activation_s: Array

    def __post_init__(self) -> None:
        n = len(self.amplitude)
        object.__setattr__(self, "position_m", read_only(self.position_m, "position_m", (n, None)))
        for name in ("amplitude", "peak_reading", "activation_s"):
            object.__setattr__(self, name, read_only(getattr(self, name), name, (n,)))

    def __len__(self) -> int:
        return int(self.amplitude.size)


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """The path flown: `vertices_m` (L+1, d) and `heading_rad` (L,), counter-clockwise from +x."""

    vertices_m: Array
    heading_rad: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices_m", read_only(self.vertices_m, "vertices_m", (None, None)))
        object.__setattr__(self, "heading_rad", read_only(self.heading_rad, "heading_rad", (len(self.vertices_m) - 1,)))


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Sources and path as the readings tell them, how surely, and what else they allow.

    `position_covariance_m2` (K, d, d) has the gauge fixed by the first leg, `path_aligned_covariance_m2` by the whole
    path. `residual` is measured − model for all readings in leg order. `alternatives` are the other solutions within
    2·Δ log-likelihood < 9, most likely first. For NOT_IDENTIFIABLE, NOT_CONVERGED and TOO_FEW_DATA positions are NaN.
    `reason` is one sentence that says why the verdict is what it is; `spread_m` is √C at the first reading.
    """

    sources: Sources
    path: Path
    medium: Medium
    verdict: Verdict
    reason: str
    spread_m: float
    position_covariance_m2: Array
    path_aligned_covariance_m2: Array
    parameter_covariance: Array
    parameter_names: tuple[str, ...]
    noise_sd: float
    log_likelihood: float
    residual: Array
    gauge: Gauge = "canonical"
    unseen_directions: tuple[str, ...] = ()
    alternatives: tuple[Estimate, ...] = ()
    diagnostics: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        k, d = self.sources.position_m.shape
        for name in ("position_covariance_m2", "path_aligned_covariance_m2"):
            object.__setattr__(self, name, read_only(getattr(self, name), name, (k, d, d)))
        p = len(self.parameter_names)
        object.__setattr__(
            self, "parameter_covariance", read_only(self.parameter_covariance, "parameter_covariance", (p, p))
        )
        object.__setattr__(self, "residual", read_only(self.residual, "residual", (None,)))

    @property
    def sd_m(self) -> Array:
        """(K,) one number a source: √(trace of its position covariance / d)."""
        k, d = self.sources.position_m.shape
        variance = np.trace(self.position_covariance_m2, axis1=1, axis2=2) / d
        return np.asarray(np.sqrt(variance), dtype=np.float64).reshape(k)

    def with_alternatives(self, alternatives: Sequence[Estimate]) -> Estimate:
        """The same estimate with these alternatives."""
        return replace(self, alternatives=tuple(alternatives))


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The simulated or surveyed truth of a flight, in the scene's frame; never an input of an estimate.

    `source_position_m` (K, d), `amplitude` (K,), `vertices_m` (L+1, d), in metres east and north of home.
    """

    source_position_m: Array
    amplitude: Array
    vertices_m: Array

    def __post_init__(self) -> None:
        k = len(self.amplitude)
        object.__setattr__(self, "source_position_m", read_only(self.source_position_m, "source_position_m", (k, None)))
        object.__setattr__(self, "amplitude", read_only(self.amplitude, "amplitude", (k,)))
        object.__setattr__(self, "vertices_m", read_only(self.vertices_m, "vertices_m", (None, None)))
