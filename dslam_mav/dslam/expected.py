"""Before take-off: what errors a path leaves to expect, over many layouts of sources at once (theory, section 9).

The bound of `predict.bound`, its sums over readings compiled and over points instead of single readings where those
lie closer than a Gaussian needs; and the derivatives of its logarithm by the path's vertices, for `missions.best`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dslam_mav.dslam.inverses import factors, finite, inverses
from dslam_mav.dslam.kernels.expected import Scene, Unknown, informations, pulled
from dslam_mav.dslam.layouts import Layouts
from dslam_mav.dslam.priors import CLOSED_SHARE
from dslam_mav.dslam.rigid import rigid, rigid_of

Array = NDArray[np.float64]

UNIDENTIFIED_SPREADS = 2.0  # of √C: a source less sure than this is not identified
POINTS_PER_SPREAD = 10.0  # a sum over Gaussians is exact to rounding from 5 on, but for a leg's ends
LEAST_POINTS = 4
MOST_POINTS = 4000  # in all: on very long paths the points lie up to half a spread apart
LONGEST_SPREADS = 2000.0
MOST_NUMBERS = 4_000_000  # of one batch of information matrices
FLIGHTS_A_LAYOUT = 16
QUIET = np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what overflows is counted as not seen
UNBOUNDED = 1e300
SURE_OF = 2.0  # radians of a heading, e-foldings of a strength, √C of a place: so much is known of anything


@dataclass(frozen=True, slots=True)
class Sensing:
    """What is read, and what is known besides: noise of a reading, readings a metre, speed; the sd of headings (None:
    no compass), of every leg's length, whether the path is said to close, whether ambient level and √C are unknown.
    """

    noise_sd: float
    readings_per_m: float
    speed_m_s: float = 1.0
    heading_sd_rad: float | None = None
    length_sd_m: float = 0.0
    closed: bool = False
    ambient_unknown: bool = False
    spread_unknown: bool = False

    @property
    def unknown(self) -> Unknown:
        """As the kernels have it."""
        return Unknown(self.length_sd_m > 0.0, self.spread_unknown, self.ambient_unknown)


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Errors in metres (N,), RMS over a layout's sources and over the path's vertices: relative to the first leg and
    (`aligned`) to the whole path. Infinite where a source's place is not bounded to two spreads.
    """

    source: Array
    source_aligned: Array
    path: Array
    path_aligned: Array

    @property
    def blind(self) -> NDArray[np.bool_]:
        """(N,) whether the layout cannot be identified."""
        return ~np.isfinite(self.source)


def errors_on(path: ArrayLike, layouts: Layouts, sensing: Sensing) -> Errors:
    """(M,) the bound on every layout; a ValueError where the path (L+1, d) is over 2000 spreads long."""
    return _in_batches(path, layouts, sensing, None)


def errors_flown(path: ArrayLike, layouts: Layouts, sensing: Sensing, rng: np.random.Generator) -> Errors:
    """(M · 16,) what flights come to whose errors are Gaussian with the bound's covariance: half of all flights do
    better than the bound, which is a root mean square, says.
    """
    return _in_batches(path, layouts, sensing, rng)


def joined(parts: Sequence[Errors]) -> Errors:
    """Errors of some layouts, then of others."""
    return Errors(
        np.concatenate([e.source for e in parts]),
        np.concatenate([e.source_aligned for e in parts]),
        np.concatenate([e.path for e in parts]),
        np.concatenate([e.path_aligned for e in parts]),
    )


def _in_batches(path: ArrayLike, layouts: Layouts, sensing: Sensing, rng: np.random.Generator | None) -> Errors:
    b = np.asarray(path, dtype=np.float64)
    spreads = float(np.linalg.norm(np.diff(b, axis=0), axis=1).sum() / layouts.spread_m.min())
    if spreads > LONGEST_SPREADS:
        raise ValueError(f"the path is {spreads:.0f} √C long: expected at most {LONGEST_SPREADS:.0f}")
    return joined([_errors(b, part, sensing, rng) for part in _batches(b, layouts)])


def _batches(b: Array, layouts: Layouts) -> Iterator[Layouts]:
    step = max(1, MOST_NUMBERS // (2 * len(b) + 4 * layouts.k_sources) ** 2)
    return (layouts.part(i, i + step) for i in range(0, len(layouts), step))


@QUIET
def place_errors(path: ArrayLike, layouts: Layouts, sensing: Sensing, rng: np.random.Generator) -> Array:
    """(M, K, 16) what flights come to, as `errors_flown`, but of every source by itself."""
    b, errors = np.asarray(path, dtype=np.float64), []
    for part in _batches(b, layouts):
        own, bounded = _factors(b, part, sensing)[1:]
        drawn = own @ rng.standard_normal((len(part), 1, own.shape[3], FLIGHTS_A_LAYOUT))
        errors.append(np.where(bounded[:, :, None], np.linalg.norm(drawn, axis=2), np.inf))
    return np.concatenate(errors)


def _factors(b: Array, layouts: Layouts, sensing: Sensing) -> tuple[Array, Array, NDArray[np.bool_]]:
    """(M, P, F) ways the unknowns may be off, (M, K, d, F) the sources' part of them, (M, K) which are bounded."""
    k, d, at = layouts.k_sources, b.shape[1], _place_start(b, sensing)
    paths = np.broadcast_to(b, (len(layouts), *b.shape)).copy()
    factor = factors(_information(paths, layouts, sensing, POINTS_PER_SPREAD) / sensing.noise_sd**2)
    own = factor[:, at : at + k * d].reshape(len(layouts), k, d, -1)
    covariance = finite(own @ np.swapaxes(own, 2, 3), UNBOUNDED * np.eye(d))
    worst = np.sqrt(np.linalg.eigvalsh(covariance).max(axis=2))
    return factor, own, np.asarray(worst < UNIDENTIFIED_SPREADS * layouts.spread_m[:, None])


@QUIET
def _errors(b: Array, layouts: Layouts, sensing: Sensing, rng: np.random.Generator | None) -> Errors:
    """Every error is a sum of squares over ways the unknowns may be off: the covariance's own, or drawn at random."""
    k, d, at = layouts.k_sources, b.shape[1], _place_start(b, sensing)
    factor, _, bounded = _factors(b, layouts, sensing)
    blind = np.any(~bounded, axis=1)
    if rng is not None:
        factor = factor @ rng.standard_normal((len(layouts), factor.shape[2], FLIGHTS_A_LAYOUT))
    by_path = vertex_columns(b, sensing.unknown).reshape(b.size, -1)
    motion = np.linalg.pinv(rigid(b)) @ by_path
    path_off = by_path @ factor[:, :at]
    path_left = (by_path - rigid(b) @ motion) @ factor[:, :at]
    source_off = factor[:, at : at + k * d]
    moved = rigid_of(layouts.places).reshape(len(layouts), k * d, -1) @ (motion @ factor[:, :at])

    def rms(off: Array, count: int) -> Array:
        squares = off**2 if rng is not None else (off**2).sum(axis=2, keepdims=True)
        error = np.sqrt(squares.sum(axis=1) / count)
        return np.where(blind[:, None], np.inf, error).ravel()

    return Errors(rms(source_off, k), rms(source_off - moved, k), rms(path_off, len(b)), rms(path_left, len(b)))


@QUIET
def log_errors(
    paths: Array, layouts: Layouts, sensing: Sensing, points_per_spread: float = 6.0, gradient: bool = True
) -> tuple[Array, Array]:
    """(M,) ln RMS source error of each layout on a path of its own (M, L+1, d), and its derivatives (M, L+1, d).

    What is not seen counts as known to two spreads, radians or e-foldings: the logarithm stays smooth and bounded.
    """
    k, d, at = layouts.k_sources, paths.shape[2], _place_start(paths[0], sensing)
    place = np.arange(at, at + k * d)
    noise2 = sensing.noise_sd**2
    information = _information(paths, layouts, sensing, points_per_spread)
    own = np.arange(information.shape[1])
    unit = np.ones((len(layouts), own.size))
    unit[:, place] = layouts.spread_m[:, None]
    if sensing.ambient_unknown:
        unit[:, -1] = layouts.peak.max(axis=1)
    known = noise2 / (SURE_OF * unit) ** 2
    information[:, own, own] += known
    inverse = inverses(information, known)
    square = np.einsum("mpp->m", inverse[:, place[:, None], place[None, :]])
    value = 0.5 * np.log(noise2 * square / k)
    if not gradient:
        return value, np.zeros_like(paths)
    pull = -0.5 * np.einsum("mps,mqs->mpq", inverse[:, :, place], inverse[:, :, place]) / square[:, None, None]
    moves = pulled(
        paths, _scene(layouts, sensing), sensing.unknown, _points(paths, layouts, sensing, points_per_spread)[0],
        sensing.readings_per_m, 0.5, np.ascontiguousarray(pull),
    )  # fmt: skip
    return value, moves


def vertex_columns(b: Array, unknown: Unknown) -> Array:
    """(L+1, d, path unknowns): what headings 2 … L and, where unknown, lengths do to the vertices `b` (L+1, d)."""
    n_legs, d = len(b) - 1, b.shape[1]
    step = np.diff(b, axis=0)
    turn = np.zeros((n_legs - 1, d))
    turn[:, 0], turn[:, 1] = -step[1:, 1], step[1:, 0]
    after = np.arange(n_legs + 1)[:, None] > np.arange(n_legs)[None, :]
    columns = np.where(after[:, None, 1:], turn.T[None], 0.0)
    if unknown.lengths:
        along = step / np.linalg.norm(step, axis=1)[:, None]
        columns = np.concatenate([columns, np.where(after[:, None, :], along.T[None], 0.0)], axis=2)
    return columns


def _information(paths: Array, layouts: Layouts, sensing: Sensing, points_per_spread: float) -> Array:
    """(M, P, P) JᵀJ with the priors' share, in units of the noise."""
    points, offset = _points(paths, layouts, sensing, points_per_spread)
    scene = _scene(layouts, sensing)
    out = informations(paths, scene, sensing.unknown, points, sensing.readings_per_m, offset)
    n_legs, noise2 = paths.shape[1] - 1, sensing.noise_sd**2
    if sensing.heading_sd_rad is not None:
        # The compass's own frame is unknown to the canonical gauge: the mean of all legs says nothing.
        legs = np.eye(n_legs) - 1.0 / n_legs
        out[:, : n_legs - 1, : n_legs - 1] += legs[1:, 1:] * noise2 / sensing.heading_sd_rad**2
    if sensing.length_sd_m > 0.0:
        own = np.arange(n_legs - 1, 2 * n_legs - 1)
        out[:, own, own] += noise2 / sensing.length_sd_m**2
    if sensing.closed:
        for i, b in enumerate(paths):
            columns = vertex_columns(b, sensing.unknown)[-1]
            sd = CLOSED_SHARE * np.linalg.norm(np.diff(b, axis=0), axis=1).sum()
            n = columns.shape[1]
            out[i, :n, :n] += columns.T @ columns * noise2 / sd**2
    return np.asarray(out)


def _points(
    paths: Array, layouts: Layouts, sensing: Sensing, points_per_spread: float
) -> tuple[NDArray[np.int64], float]:
    """(M, L) how many points stand for a leg's readings, and where in its share of the leg each lies."""
    length = np.linalg.norm(np.diff(paths, axis=1), axis=2)
    if sensing.readings_per_m <= points_per_spread / float(layouts.spread_m.min()):
        # the readings themselves, from the leg's start on
        return np.maximum(np.round(length * sensing.readings_per_m), 1).astype(np.int64), 0.0
    per_m = points_per_spread / layouts.spread_m[:, None]
    per_m = np.minimum(per_m, MOST_POINTS / length.sum(axis=1, keepdims=True))
    return np.maximum(np.ceil(length * per_m), LEAST_POINTS).astype(np.int64), 0.5


def _scene(layouts: Layouts, sensing: Sensing) -> Scene:
    return Scene(
        np.ascontiguousarray(layouts.places), layouts.peak, layouts.spread_m**2, layouts.rate_m2_s,
        1.0 / sensing.speed_m_s,
    )  # fmt: skip


def _place_start(b: Array, sensing: Sensing) -> int:
    n_legs = len(b) - 1
    return n_legs - 1 + (n_legs if sensing.length_sd_m > 0.0 else 0)
