"""Recorded diffusing fields: stacks of frames (.npz: frames (T, H, W), time_s (T,), pixel_m).

A frame is interpolated by cubic splines in space and linearly in time. Measured on a Gaussian of √C = 15
pixels (the recordings'): splines err by at most 1.3e-6 of the peak, bilinear interpolation by 2.2e-3. Linear
steps between the first five frames of `spot_bilayer_a` err by at most 0.6 % of the peak, below its noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import map_coordinates, spline_filter
from scipy.optimize import least_squares

from dslam_mav.errors import BadInputError, unreadable
from sim_bridge.fields.field import Array

FIT_RADIUS_SPREADS = 2.6  # wide enough for the ambient, narrow enough for uneven light to stay outside
_FIT_ROUNDS = 4


@dataclass(frozen=True, slots=True)
class GaussianFit:
    """ambient + peak·exp(−r²/spread²) fitted to one frame, in pixels; `spread_px` is √C."""

    column_px: float
    row_px: float
    spread_px: float
    peak: float
    ambient: float


class FrameStack:
    """A recording: `frames` (T, H, W), `time_s` (T,) increasing; `pixel_m` is NaN where no scale is known."""

    def __init__(self, frames: ArrayLike, time_s: ArrayLike, pixel_m: float = np.nan, name: str = "frames") -> None:
        self.frames = np.asarray(frames, dtype=np.float64)
        self.time_s = np.asarray(time_s, dtype=np.float64)
        self.pixel_m = float(pixel_m)
        self.name = name
        if self.frames.ndim != 3 or min(self.frames.shape, default=0) < 1 or min(self.frames.shape[1:]) < 4:
            raise BadInputError(f"{name}: frames: expected (T, H, W) of at least 4×4 pixels, got {self.frames.shape}")
        if self.time_s.shape != self.frames.shape[:1] or not (np.diff(self.time_s) > 0.0).all():
            raise BadInputError(
                f"{name}: time_s: expected {len(self.frames)} increasing times, got shape {self.time_s.shape}"
            )
        bad = np.argwhere(~np.isfinite(self.frames))
        if len(bad):
            raise BadInputError(f"{name}: frames{bad[0].tolist()}: expected finite values, got {len(bad)} others")
        self._splines: dict[int, Array] = {}
        self._fits: dict[int, GaussianFit] = {}

    @classmethod
    def read(cls, path: Path) -> FrameStack:
        """The stack in an .npz file; BadInputError names the file and the array."""
        try:
            with np.load(path, allow_pickle=False) as arrays:
                missing = {"frames", "time_s", "pixel_m"} - set(arrays)
                if missing:
                    there = ", ".join(arrays) or "none"
                    raise BadInputError(f"{path}: {', '.join(sorted(missing))}: missing array, it has {there}")
                loaded = [np.asarray(arrays[key], dtype=np.float64) for key in ("frames", "time_s", "pixel_m")]
        except OSError as error:
            raise unreadable(path, error) from None
        except BadInputError:
            raise
        except Exception as error:  # zipfile, zlib, numpy's format: whatever a broken file sets off
            raise BadInputError(f"{path}: expected a .npz file of numbers, got: {_first_line(error)}") from None
        if loaded[2].size != 1:
            raise BadInputError(f"{path}: pixel_m: expected one number, got shape {loaded[2].shape}")
        return cls(loaded[0], loaded[1], float(loaded[2].reshape(())), str(path))

    def check_frame(self, frame: int) -> None:
        """BadInputError if there is no such frame."""
        if not 0 <= frame < len(self.frames):
            raise BadInputError(f"{self.name}: frame {frame}: expected 0 to {len(self.frames) - 1}")

    def fit(self, frame: int) -> GaussianFit:
        """One Gaussian fitted to the frame: the truth of a demonstration. BadInputError: no spot in it.

        Only pixels within 2.6 √C of the fitted centre count, so that uneven light further out does not pull;
        the loss hardly hears dead pixels.
        """
        self.check_frame(frame)
        if frame not in self._fits:
            self._fits[frame] = _fit_gaussian(self.frames[frame], f"{self.name}: frame {frame}")
        return self._fits[frame]

    def spline(self, frame: int) -> Array:
        """(H, W) cubic spline coefficients of a frame."""
        if frame not in self._splines:
            self._splines[frame] = np.asarray(spline_filter(self.frames[frame], order=3, mode="mirror"))
        return self._splines[frame]

    def at(self, frame: ArrayLike, column_px: Array, row_px: Array) -> Array:
        """Values (M,) at fractional `frame` (M,) or scalar and pixels; NaN outside the image."""
        _, height, width = self.frames.shape
        wanted = np.broadcast_to(np.asarray(frame, dtype=np.float64), column_px.shape)
        inside = (column_px >= 0) & (column_px <= width - 1) & (row_px >= 0) & (row_px <= height - 1)
        lower = np.clip(np.floor(wanted).astype(int), 0, len(self.frames) - 1)
        value = np.full(column_px.shape, np.nan)
        for first in np.unique(lower[inside]):
            here = inside & (lower == first)
            places = np.stack([row_px[here], column_px[here]])
            share = wanted[here] - first
            value[here] = self._spatial(int(first), places) * (1.0 - share)
            if (share > 0.0).any():
                value[here] += self._spatial(min(int(first) + 1, len(self.frames) - 1), places) * share
        return value

    def _spatial(self, frame: int, places_px: Array) -> Array:
        return np.asarray(map_coordinates(self.spline(frame), places_px, order=3, mode="mirror", prefilter=False))


def _first_line(error: Exception) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)


def _fit_gaussian(image: Array, name: str) -> GaussianFit:
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]].astype(np.float64)
    ambient = float(np.median(image))
    high = np.clip(image - 0.5 * (ambient + float(np.percentile(image, 99.9))), 0.0, None)
    if not high.sum() > 0.0:
        raise BadInputError(f"{name}: expected a bright spot, got a flat image")
    row, column = float((high * rows).sum() / high.sum()), float((high * columns).sum() / high.sum())
    spread = np.sqrt(np.count_nonzero(high) / (np.pi * np.log(2.0)))  # a disk of half the peak has C ln 2
    p = np.array([column, row, spread, float(np.percentile(image, 99.9)) - ambient, ambient])
    noise = 1.4826 * float(np.median(np.abs(image - ambient))) + 1e-12
    for _ in range(_FIT_ROUNDS):
        near = (columns - p[0]) ** 2 + (rows - p[1]) ** 2 < (FIT_RADIUS_SPREADS * p[2]) ** 2
        x, y, z = columns[near], rows[near], image[near]

        def misfit(q: Array, x: Array = x, y: Array = y, z: Array = z) -> Array:
            return np.asarray(q[4] + q[3] * np.exp(-((x - q[0]) ** 2 + (y - q[1]) ** 2) / q[2] ** 2) - z)

        if len(z) <= len(p):
            break
        p = np.asarray(least_squares(misfit, p, loss="soft_l1", f_scale=2.0 * noise).x)
    inside = 0.0 <= p[0] <= image.shape[1] - 1 and 0.0 <= p[1] <= image.shape[0] - 1
    if not (inside and p[3] > 0.0):
        raise BadInputError(f"{name}: expected one bright spot inside the image, found none")
    column, row, spread, peak, ambient = p.tolist()
    return GaussianFit(column, row, abs(spread), peak, ambient)
