"""Copies of a recorded diffusing spot as the field a vehicle flies over.

Diffusion has no scale of its own: with lengths times λ and times times θ a diffusing field is still one,
its diffusivity times λ²/θ. So a recording of micrometres may be flown in metres, its readings untouched.
It is linear, too: shifted copies added are a real field of several sources, the recording's noise and
faults included.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from dslam_mav.errors import BadInputError
from sim_bridge.fields.field import Array
from sim_bridge.fields.frame_stack import FrameStack, GaussianFit


@dataclass(frozen=True, slots=True)
class Copy:
    """One copy of the recording: where the spot's fitted centre lies (scene metres), and its gain."""

    east_m: float
    north_m: float
    gain: float = 1.0


@dataclass(frozen=True, slots=True)
class FilmClock:
    """What a flight sees of the recording: from `first` to `last` frame over `flight_s`, then still."""

    first: int
    last: int
    flight_s: float = 0.0

    def frame(self, stack: FrameStack, time_s: Array) -> Array:
        """Fractional frame (M,) at flight time (M,)."""
        if self.first == self.last or self.flight_s <= 0.0:
            return np.full(np.shape(time_s), float(self.first))
        begin, end = stack.time_s[self.first], stack.time_s[self.last]
        recorded_s = begin + np.clip(np.asarray(time_s) / self.flight_s, 0.0, 1.0) * (end - begin)
        return np.asarray(np.interp(recorded_s, stack.time_s, np.arange(len(stack.time_s))))


@dataclass(frozen=True)
class FrameField:
    """Copies of a recording added, at `metre_per_pixel`; the image's right is east, its top is north.

    Outside a copy's image that copy reads its ambient, as fitted on the clock's first frame; `check_inside`
    tells beforehand whether a flight gets there.
    """

    stack: FrameStack
    copies: tuple[Copy, ...]
    metre_per_pixel: float
    clock: FilmClock

    def __post_init__(self) -> None:
        if not (np.isfinite(self.metre_per_pixel) and self.metre_per_pixel > 0.0):
            raise ValueError(f"metre_per_pixel: expected a positive number, got {self.metre_per_pixel}")
        self.stack.check_frame(self.clock.first)
        self.stack.check_frame(self.clock.last)

    @cached_property
    def fit(self) -> GaussianFit:
        """The spot as fitted on the first frame flown."""
        return self.stack.fit(self.clock.first)

    def read(self, time_s: Array, place_m: Array) -> Array:
        """Readings (M,) at flight time (M,) and places (M, 2 or 3)."""
        frame = self.clock.frame(self.stack, time_s)
        total = np.zeros(len(place_m))
        for copy in self.copies:
            column, row = self._pixels(copy, place_m)
            value = self.stack.at(frame, column, row)
            total += copy.gain * np.where(np.isnan(value), self.fit.ambient, value)
        return total

    def check_inside(self, vertices_m: ArrayLike, margin_m: float = 0.0) -> None:
        """BadInputError if a flight along `vertices_m` (L+1, 2) comes nearer an image's edge than that."""
        vertices = np.asarray(vertices_m, dtype=np.float64)
        for k, copy in enumerate(self.copies):
            margins = self._margin_m(copy, vertices)  # images are convex: vertices inside, legs inside
            worst = int(np.argmin(margins))
            if margins[worst] < margin_m:
                place = vertices[worst].round(1).tolist()
                raise BadInputError(
                    f"{self.stack.name}: copy {k + 1}: vertex {worst} at {place} m is {margins[worst]:.1f} m "
                    f"inside the image, expected at least {margin_m:g} m"
                )

    def _pixels(self, copy: Copy, place_m: Array) -> tuple[Array, Array]:
        column = self.fit.column_px + (place_m[:, 0] - copy.east_m) / self.metre_per_pixel
        row = self.fit.row_px - (place_m[:, 1] - copy.north_m) / self.metre_per_pixel
        return column, row

    def _margin_m(self, copy: Copy, place_m: Array) -> Array:
        """(M,) metres to the nearest edge of the copy's image, negative outside."""
        column, row = self._pixels(copy, place_m)
        _, height, width = self.stack.frames.shape
        edges = np.stack([column, width - 1 - column, row, height - 1 - row])
        return np.asarray(edges.min(axis=0) * self.metre_per_pixel)
