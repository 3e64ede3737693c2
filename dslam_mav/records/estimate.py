"""What the readings tell: sources, path, how surely; and the truth to compare with."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Literal

import numpy as np

from dslam_mav.records.arrays import Array, read_only
from dslam_mav.records.medium import Medium

Gauge = Literal["canonical", "anchored"]


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

    @property
    def squared_spread_m2(self) -> Array:
        """(K,) C of each at the flight's first reading, whatever the medium: peak = a/(πC)^(d/2); NaN where unknown."""
        with np.errstate(all="ignore"):
            return np.asarray((self.amplitude / self.peak_reading) ** (2.0 / self.position_m.shape[1]) / np.pi)


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """The path flown: `vertices_m` (L+1, d) and `heading_rad` (L,), counter-clockwise from +x.

    A parametric path also has its `coefficients_m` (P, d); its vertices are the places of its N readings.
    """

    vertices_m: Array
    heading_rad: Array
    coefficients_m: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices_m", read_only(self.vertices_m, "vertices_m", (None, None)))
        object.__setattr__(self, "heading_rad", read_only(self.heading_rad, "heading_rad", (len(self.vertices_m) - 1,)))
        if self.coefficients_m is not None:
            coefficients = read_only(self.coefficients_m, "coefficients_m", (None, self.vertices_m.shape[1]))
            object.__setattr__(self, "coefficients_m", coefficients)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Sources and path as the readings tell them, how surely, and what else they allow.

    `position_covariance_m2` (K, d, d) has the gauge fixed by the first leg, `path_aligned_covariance_m2` by the whole
    path; where the model bends both are wider than the Cramér–Rao bound. `residual` is measured − model for all
    readings in leg order. `alternatives` are the other solutions within 2·Δ log-likelihood < 9, most likely first. For
    NOT_IDENTIFIABLE, NOT_CONVERGED and TOO_FEW_DATA positions are NaN. `reason` is one sentence that says why the
    verdict is what it is; `spread_m` is √C at the first reading.
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
