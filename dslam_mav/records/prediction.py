"""What a mission was expected to see, before it was flown."""

from __future__ import annotations

import math
from dataclasses import dataclass

# what is taken where nothing is said
LEG_SPREADS = 3.2  # √C is the longest leg over this: the leg the figures of star {7/3} are for
READINGS_PER_SPREAD = 20.0
SNR_DB = 20.0
FAINTEST = 1e-15  # of the peak: no sensor's noise
MOST_LEGS, FEWEST_LAYOUTS = 60, 20

Range = tuple[float, float]
"""Median and 90 % over flights, in metres; infinite where so many have no answer."""


def layouts_for(wanted: int, n_legs: int) -> int:
    """How many layouts to predict over: fewer for missions of many legs, as the time grows with their cube."""
    return max(FEWEST_LAYOUTS, round(wanted * min(1.0, (MOST_LEGS / n_legs) ** 2)))


@dataclass(frozen=True, slots=True)
class Prediction:
    """Errors to expect of a mission, RMS over its sources or its path's vertices: relative to the first leg, and
    (`aligned`) to the whole path.

    For `n_sources` from … to, anywhere in a box of `area_m` about the path; √C `spread_m`, sources' peaks within a
    factor four about `peak`, noise `noise_sd`, both in the sensor's unit. `length_m` is the mission's.
    """

    n_sources: tuple[int, int]
    spread_m: float
    area_m: tuple[float, ...]
    peak: float
    noise_sd: float
    readings_per_m: float
    length_m: float
    source_error_m: Range
    path_error_m: Range
    source_error_aligned_m: Range
    path_error_aligned_m: Range
    unidentifiable_share: float

    def __post_init__(self) -> None:
        low, high = self.n_sources
        if not 1 <= low <= high:
            raise ValueError(f"n_sources: expected 1 or more, from … to, got {self.n_sources}")
        for name in ("spread_m", "peak", "noise_sd", "readings_per_m", "length_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name}: expected a positive number, got {value}")
        for name in ("source_error_m", "path_error_m", "source_error_aligned_m", "path_error_aligned_m"):
            median, p90 = getattr(self, name)
            if not 0.0 <= median <= p90:
                raise ValueError(f"{name}: expected a median and no smaller 90 %, got {median} and {p90}")
        if not 0.0 <= self.unidentifiable_share <= 1.0:
            raise ValueError(f"unidentifiable_share: expected 0 to 1, got {self.unidentifiable_share}")
