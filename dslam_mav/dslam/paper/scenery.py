"""A flight without its units: lengths in spreads √C, readings in the largest one, so that no threshold has a unit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.field import field
from dslam_mav.dslam.paper.frozen import growth_m2, known_spread2_m2
from dslam_mav.dslam.paper.layout import Layout, vertices
from dslam_mav.records import Flight, Medium

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Scenery:
    """Legs' distances and readings (above ambient) without units; `unit_m`, `unit_reading` bring them back.

    `c_first`: C at the flight's first reading, None where it is to be found. `growth` (N,) a leg: what C has grown
    since at every reading, zero in a static field. `offset`: size of the ambient level that was taken off.
    """

    s: tuple[Array, ...]
    reading: tuple[Array, ...]
    growth: tuple[Array, ...]
    length: Array
    c_first: float | None
    unit_m: float
    unit_reading: float
    dimensions: int
    offset: float

    @property
    def still(self) -> bool:
        """Whether one C is known for all readings."""
        return self.c_first is not None and not any(g.any() for g in self.growth)

    @property
    def growth_mid(self) -> Array:
        """(L,) the growth at each leg's middle sample (IV-A)."""
        return np.array([g[len(g) // 2] for g in self.growth])

    @property
    def n_readings(self) -> int:
        """Readings of the whole flight."""
        return sum(y.size for y in self.reading)


def scenery(flight: Flight, medium: Medium) -> Scenery:
    """The flight without units; spreads may be unknown, and are then in units of the mean leg."""
    c_m2 = known_spread2_m2(float(flight.legs[0].time_s[0]), medium)
    unit_m = float(np.sqrt(c_m2)) if c_m2 is not None else float(flight.lengths_m.mean())
    readings = [leg.reading - (medium.ambient or 0.0) for leg in flight.legs]
    largest = max(float(np.abs(y).max()) for y in readings)
    unit_reading = largest if largest > 0.0 else 1.0
    return Scenery(
        s=tuple(leg.distance_m / unit_m for leg in flight.legs),
        reading=tuple(y / unit_reading for y in readings),
        growth=tuple(g / unit_m**2 for g in growth_m2(flight, medium)),
        length=flight.lengths_m / unit_m,
        c_first=None if c_m2 is None else 1.0,
        unit_m=unit_m,
        unit_reading=unit_reading,
        dimensions=medium.dimensions,
        offset=abs(medium.ambient or 0.0) / unit_reading,
    )


def residual(scene: Scenery, layout: Layout, c_first: Array) -> Array:
    """(N,) measured − model over all readings in leg order: the field at its own time, not the leg's middle."""
    b = vertices(layout.direction, scene.length)
    off = []
    for j, (s, y, growth) in enumerate(zip(scene.s, scene.reading, scene.growth, strict=True)):
        points = b[j] + s[:, None] * layout.direction[j]
        with np.errstate(over="ignore", invalid="ignore"):  # a wrong pairing may ask for any amplitude
            amplitude = np.exp(layout.ln_amplitude)
            off.append(y - field(points, c_first + growth[:, None], layout.source, amplitude))
    return np.concatenate(off)
