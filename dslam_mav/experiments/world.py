"""What an experiment flies over. Whoever runs it brings worlds along: scene files, recordings."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dslam_mav.records import Flight, Medium, Sources, Truth

Array = NDArray[np.float64]


class World(Protocol):
    """A scene that can be flown; pickled to worker processes."""

    @property
    def truth(self) -> Truth:
        """Sources and path in the scene's frame."""

    @property
    def sources(self) -> Sources:
        """The same sources with their peak reading at the flight's first reading, and their activation times."""

    @property
    def medium(self) -> Medium:
        """What an estimator may be told: not the activation times."""

    @property
    def spacing_m(self) -> float:
        """Ts."""

    @property
    def speed_m_s(self) -> float:
        """v."""

    @property
    def start_s(self) -> float:
        """When the first reading is taken."""

    @property
    def noise_sd(self) -> float:
        """Of a reading."""

    def flight(self, rng: np.random.Generator) -> Flight:
        """The readings of one flight."""

    def at(
        self,
        *,
        snr_db: float | None = None,
        speed_m_s: float | None = None,
        static: bool | None = None,
        source_position_m: Array | None = None,
    ) -> World:
        """The same world but for what is given; an infinite `snr_db` takes the noise away."""

    def placed(self, rng: np.random.Generator) -> World:
        """The world with a path: its own, or drawn afresh."""

    @property
    def image(self) -> tuple[Array, tuple[float, float, float, float]] | None:
        """The recorded frame behind it and its extent (left, right, bottom, top), if there is one."""
