"""The recorded flights of real firmware, flown again over other fields: the same way, other readings.

Where the vehicle truly was its simulator told; what a sensor would have read there follows for any sources, noise and
rate. Dead reckoning, overshoot, corners and clock stay those of the firmware.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import count

import numpy as np
from numpy.typing import NDArray
from real_flights import DATA, FLIGHTS, Held, held

from dslam_mav import Medium, estimate
from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.field import field
from dslam_mav.legs import FlownLeg, LegCollector, flight_of
from dslam_mav.mav.decode import decode
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT
from dslam_mav.mav.tlog import read_tlog
from dslam_mav.mission import Home
from dslam_mav.observations import Observation, Progress, Reading
from sim_bridge.whereabouts import Whereabouts

Array = NDArray[np.float64]

SYSTEM = 1
AMBIENT, NOISE_SD, DIFFUSIVITY_M2_S = 20.0, 0.05, 0.5
BOX, APART = 1.25, 1.1  # √C: where sources of other layouts lie, about the middle of the plan
PEAKS = (4.0, 9.0)


@dataclass(frozen=True, eq=False)
class Recorded:
    """What was heard, in order; the true way, `time_ms` (N,) rising and `place_m` (N, 2) east, north; √C at the start,
    and the recording's own sources (K, 2) with their amplitudes (K,); `middle_m` (2,) of its plan.
    """

    heard: tuple[Observation, ...]
    time_ms: Array
    place_m: Array
    spread_m: float
    sources_m: Array
    amplitude: Array
    middle_m: Array

    def at(self, time_ms: Array) -> Array:
        """(M, 2) where the vehicle truly was."""
        return np.stack([np.interp(time_ms, self.time_ms, axis) for axis in self.place_m.T], axis=1)


@dataclass(frozen=True, slots=True)
class Again:
    """One flight over another field. `layout`: seed of other sources (None: the recording's own); `every`: one of so
    many readings is taken; `left_out`: so many of the last legs are not flown; `late`: leg 1 was not heard.
    """

    flight: str
    k_sources: int
    medium: Medium
    seed: int = 0
    noise_sd: float = NOISE_SD
    layout: int | None = None
    every: int = 1
    left_out: int = 0
    late: bool = False


def variants() -> Iterator[tuple[str, Again]]:
    """A dozen of each recording, with what is other about them."""
    for name, k_sources, medium in FLIGHTS:
        own, seed = Again(name, k_sources, medium), count(1)
        yield "noise drawn anew", replace(own, seed=next(seed))
        yield "noise drawn anew", replace(own, seed=next(seed))
        yield "half the noise", replace(own, seed=next(seed), noise_sd=0.5 * NOISE_SD)
        yield "twice the noise", replace(own, seed=next(seed), noise_sd=2.0 * NOISE_SD)
        yield "10 Hz", replace(own, seed=next(seed), every=2)
        yield "last leg not flown", replace(own, seed=next(seed), left_out=1)
        for layout in range(4):
            yield "other sources", replace(own, seed=next(seed), layout=layout)
        for layout in (31, 32):
            yield "another K", replace(own, seed=next(seed), layout=layout, k_sources=5 - k_sources)


@cache
def recorded(flight: str) -> Recorded:
    """A recording of `../shared/data/flights`."""
    path = DATA / "flights" / f"{flight}.tlog"
    told = json.loads(path.with_suffix(".truth.json").read_text())
    where, heard, places = Whereabouts("sim", Home(*told["home"])), [], []
    for frame in read_tlog(path):
        if (observation := decode(frame, SYSTEM)) is not None:
            heard.append(observation)
        if (frame.message.get_srcSystem(), frame.message.get_srcComponent()) != (SYSTEM, COMPONENT_AUTOPILOT):
            continue
        placed = where.hear(frame.message, settled=False)
        if placed is not None and (not places or placed[0] > places[-1][0]):
            places.append((placed[0], *placed[1][:2]))
    time_ms, east_m, north_m = np.array(places, dtype=np.float64).T
    return Recorded(
        tuple(heard), time_ms, np.stack([east_m, north_m], axis=1), told["spread_sqrtC_m_at_start"],
        np.array([source["position_ned_m"][::-1] for source in told["sources"]]),
        np.array([source["amplitude"] for source in told["sources"]]),
        np.array(told["planned_vertices_ned_m"])[:-1, ::-1].mean(axis=0),
    )  # fmt: skip


def sources_of(again: Again) -> tuple[Array, Array]:
    """Places (K, 2), east and north, and amplitudes (K,)."""
    flight = recorded(again.flight)
    if again.layout is None:
        return flight.sources_m, flight.amplitude
    rng = np.random.default_rng((again.layout, again.k_sources))
    while True:
        places = rng.uniform(-BOX, BOX, (again.k_sources, 2))
        apart = np.linalg.norm(places[:, None] - places[None], axis=2) + 10.0 * np.eye(again.k_sources)
        if apart.min() > APART:
            break
    peaks = rng.uniform(*PEAKS, again.k_sources)
    return flight.middle_m + flight.spread_m * places, peaks * math.pi * flight.spread_m**2


def legs_of(again: Again) -> tuple[FlownLeg, ...]:
    """The legs of this flight."""
    flight = recorded(again.flight)
    reached = [i for i, o in enumerate(flight.heard) if isinstance(o, Progress) and o.reached and o.seq > 1]
    begin = reached[0] + 1 if again.late else 0
    end = reached[-1 - again.left_out] + 100 if again.left_out else None
    collector = LegCollector()
    collector.add_all(_read_again(again, flight)[begin:end])
    return collector.legs(final=True)


def _read_again(again: Again, flight: Recorded) -> list[Observation]:
    """What was heard, every reading another one, or none."""
    time_ms = np.array([o.time_boot_ms for o in flight.heard if isinstance(o, Reading)], dtype=np.float64)
    flown_s = 0.0 if again.medium.static else (time_ms - time_ms[0]) / 1000.0
    spread2 = np.broadcast_to(flight.spread_m**2 + 4.0 * DIFFUSIVITY_M2_S * flown_s, time_ms.shape)
    places_m, amplitude = sources_of(again)
    value = AMBIENT + field(flight.at(time_ms), spread2[:, None], places_m, amplitude)
    value = value + again.noise_sd * np.random.default_rng((again.seed, 11)).standard_normal(value.size)
    number, heard = count(), []
    for observation in flight.heard:
        if not isinstance(observation, Reading):
            heard.append(observation)
        elif (n := next(number)) % again.every == 0:
            heard.append(replace(observation, value=float(value[n])))
    return heard


def held_again(again: Again) -> Held:
    """This flight estimated, its sources assigned to the truth's."""
    legs, flight = legs_of(again), recorded(again.flight)
    result = estimate(flight_of(legs), again.medium, again.k_sources)
    ends_ms = np.array([*(leg.start_ms for leg in legs), legs[-1].end_ms], dtype=np.float64)
    return held(result, to_canonical(flight.at(ends_ms)).apply(sources_of(again)[0]), flight.spread_m)
