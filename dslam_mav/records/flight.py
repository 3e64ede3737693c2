"""What was flown and read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from dslam_mav.records.arrays import Array, finite, number, read_only


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """One straight leg: `reading` (N,) taken at `distance_m` (N,) along its line, at `time_s` (N,).

    `corner_sd_m`: how far the next leg's line may begin from where this one's ends, a standard deviation along each
    axis (drift of the dead reckoning, corners flown round). Corners count as exact where they leave no more than noise.
    `beside_m`: how far from this leg's line it began, where the one before ended: on that one's line, past the corner
    (overshot) or before it (cut). Of the first leg: how far off its line its two ends lie, to which side nobody knows;
    the answer's frame, which begins and ends there, is uncertain by that.
    `overshot_m`: how far the vehicle flew past this leg's end, and back; it tells overshot from cut.
    """

    length_m: float
    distance_m: Array
    time_s: Array
    reading: Array
    length_sd_m: float = 0.0
    rise_m: float | None = None
    corner_sd_m: float = 0.0
    beside_m: float = 0.0
    overshot_m: float = 0.0

    def __post_init__(self) -> None:
        for name in ("distance_m", "time_s", "reading"):
            array = read_only(getattr(self, name), name, (None,))
            finite(array, name)
            object.__setattr__(self, name, array)
        if not (self.distance_m.size == self.time_s.size == self.reading.size):
            raise ValueError(
                f"reading: expected as many as distance_m and time_s, got {self.reading.size}, "
                f"{self.distance_m.size} and {self.time_s.size}"
            )
        length = number(self.length_m, "length_m", "a positive length")
        if length <= 0.0:
            raise ValueError(f"length_m: expected a positive length, got {self.length_m}")
        for name in ("length_sd_m", "corner_sd_m", "beside_m", "overshot_m"):
            if number(getattr(self, name), name, "0 or more") < 0.0:
                raise ValueError(f"{name}: expected 0 or more, got {getattr(self, name)}")
        wanted = f"at most the leg's length {length}"
        if self.rise_m is not None and abs(number(self.rise_m, "rise_m", wanted)) > length:
            raise ValueError(f"rise_m: expected {wanted}, got {self.rise_m}")
        if (np.diff(self.time_s) <= 0.0).any():
            raise ValueError("time_s: expected strictly increasing times")


@dataclass(frozen=True, slots=True, eq=False)
class ParametricPath:
    """A curved flight r(t) = Σ_i c_i φ_i(t) (IV-C): `basis` (N, P) holds the known φ_i at every `time_s` (N,)."""

    basis: Array
    time_s: Array
    reading: Array

    def __post_init__(self) -> None:
        for name, shape in (("basis", (None, None)), ("time_s", (None,)), ("reading", (None,))):
            array = read_only(getattr(self, name), name, shape)
            finite(array, name)
            object.__setattr__(self, name, array)
        if not self.basis.shape[1]:
            raise ValueError("basis: expected at least one function, got none")
        if not (len(self.basis) == self.time_s.size == self.reading.size):
            raise ValueError(
                f"reading: expected as many as time_s and rows of basis, got {self.reading.size}, "
                f"{self.time_s.size} and {len(self.basis)}"
            )
        if (np.diff(self.time_s) <= 0.0).any():
            raise ValueError("time_s: expected strictly increasing times")


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """The legs in the order flown, times strictly increasing over the whole flight; or one `parametric` path instead.

    `closed` says that the path ends where it began.
    """

    legs: tuple[Leg, ...] = ()
    parametric: ParametricPath | None = None
    closed: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.legs, Iterable):
            raise ValueError(f"legs: expected a tuple of Legs, got {self.legs!r}")
        legs = tuple(self.legs)
        for j, leg in enumerate(legs):
            if not isinstance(leg, Leg):
                raise ValueError(f"legs[{j}]: expected a Leg, got {leg!r}")
        object.__setattr__(self, "legs", legs)
        if self.parametric is not None and not isinstance(self.parametric, ParametricPath):
            raise ValueError(f"parametric: expected a ParametricPath, got {self.parametric!r}")
        if not isinstance(self.closed, (bool, np.bool_)):
            raise ValueError(f"closed: expected True or False, got {self.closed!r}")
        if self.parametric is not None and self.legs:
            raise ValueError("parametric: expected either legs or a parametric path, got both")
        last = -np.inf
        for j, leg in enumerate(self.legs):
            if leg.time_s.size and leg.time_s[0] <= last:
                raise ValueError(f"legs[{j}].time_s: expected times after leg {j - 1}'s last, {last}")
            last = leg.time_s[-1] if leg.time_s.size else last

    @property
    def n_readings(self) -> int:
        """Readings of the whole flight."""
        if self.parametric is not None:
            return self.parametric.reading.size
        return sum(leg.reading.size for leg in self.legs)

    @property
    def lengths_m(self) -> Array:
        """(L,) leg lengths."""
        return np.array([leg.length_m for leg in self.legs])
