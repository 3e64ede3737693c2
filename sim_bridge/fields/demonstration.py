"""A real field of several sources from a recording of one spot: the demonstration's second flight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dslam_mav.errors import BadInputError
from dslam_mav.records import Truth
from sim_bridge.fields.field import Array
from sim_bridge.fields.frame_field import Copy, FilmClock, FrameField
from sim_bridge.fields.frame_stack import FrameStack

BOX_SPREADS = 1.6  # copies lie within ± this of their mean
APART_SPREADS = 0.8
GAINS = (0.6, 1.4)
_TRIES = 1000


@dataclass(frozen=True, slots=True, eq=False)
class RecordedDemo:
    """The field, and what is true of it: places (K, 2), amplitudes (K,) in reading·m², √C and ambient.

    Truth is the centre and the Gaussian fitted to the recording's own frame, moved and scaled with it.
    `recorded_m_per_m` says how many metres of the recording one metre flown stands for (NaN: scale unknown).
    """

    field: FrameField
    source_position_m: Array
    amplitude: Array
    spread_m: float
    ambient: float
    recorded_m_per_m: float

    def truth(self, vertices_m: ArrayLike) -> Truth:
        """What a flight along `vertices_m` (L+1, 2) is judged against."""
        return Truth(self.source_position_m, self.amplitude, np.asarray(vertices_m, dtype=np.float64))


def recorded_demo(
    stack: FrameStack,
    *,
    sources: int,
    seed: int,
    frame: int = 0,
    spread_m: float = 10.0,
    middle_m: tuple[float, float] = (0.0, 0.0),
    until_frame: int | None = None,
    flight_s: float = 0.0,
) -> RecordedDemo:
    """Shifted copies of the stack around `middle_m`, lengths scaled so that √C of `frame` is `spread_m`.

    The frame is held for the flight; with `until_frame` the film runs to that one in `flight_s`. Copies have
    their mean at the middle, lie at least 0.8 √C apart within ±1.6 √C of it, and have gains of 0.6 to 1.4; so
    a star {7/3} of 2.6 √C legs around the middle stays inside the images of `spot_bilayer_a`, frames 0 to 4.
    BadInputError: no such frame, or more sources than the box holds.
    """
    if sources < 1:
        raise BadInputError(f"sources {sources}: expected 1 or more")
    fit = stack.fit(frame)
    rng = np.random.default_rng(seed)
    shifts_m = _scattered(sources, rng) * spread_m + np.asarray(middle_m)
    gains = rng.uniform(*GAINS, sources)
    metre_per_pixel = spread_m / fit.spread_px
    field = FrameField(
        stack,
        tuple(Copy(float(e), float(n), float(g)) for (e, n), g in zip(shifts_m, gains, strict=True)),
        metre_per_pixel,
        FilmClock(frame, frame if until_frame is None else until_frame, flight_s),
    )
    return RecordedDemo(
        field,
        source_position_m=shifts_m,
        amplitude=gains * fit.peak * np.pi * spread_m**2,
        spread_m=spread_m,
        ambient=float(gains.sum()) * fit.ambient,
        recorded_m_per_m=stack.pixel_m / metre_per_pixel,
    )


def _scattered(count: int, rng: np.random.Generator) -> Array:
    """(K, 2) places around their middle, in spreads: inside the box, none nearer to another than allowed."""
    for _ in range(_TRIES):
        places = rng.uniform(-BOX_SPREADS, BOX_SPREADS, (count, 2))
        places -= places.mean(axis=0)
        apart = np.linalg.norm(places[:, None] - places, axis=2) + np.diag(np.full(count, np.inf))
        if apart.min() >= APART_SPREADS and np.abs(places).max() <= BOX_SPREADS:
            return places
    raise BadInputError(f"sources {count}: expected fewer, so many copies do not fit side by side")
