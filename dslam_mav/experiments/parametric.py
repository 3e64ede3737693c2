"""Fig. 7: an unknown trajectory r(t) = Σ c_i φ_i(t) along known φ_i (IV-C)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.experiments.experiment import Experiment, Shown, Worlds
from dslam_mav.experiments.measures import FINISHED, field_of, localise
from dslam_mav.experiments.pictures.layouts import scene_picture
from dslam_mav.experiments.trials import Row
from dslam_mav.experiments.world import World
from dslam_mav.records import Flight, Medium, ParametricPath, Sources, Truth

Array = NDArray[np.float64]

COEFFICIENTS_M = np.array([[2.4, 0.3], [0.1, 0.75], [0.35, -0.2]])
"""(P, 2) c_i of φ = t, sin 2πt, cos 2πt."""
READINGS = 400


def basis(t: Array) -> Array:
    """(N, P) φ_i at the share `t` (N,) of the flight."""
    turn = 2.0 * np.pi * t
    return np.column_stack((t, np.sin(turn), np.cos(turn)))


@dataclass(frozen=True, eq=False)
class AlongCurve:
    """A static world flown along the curve instead of its own path; one reading every Ts/v."""

    base: World

    @property
    def truth(self) -> Truth:
        """Sources, and the places of all readings."""
        own = self.base.truth
        return Truth(own.source_position_m, own.amplitude, self._basis @ COEFFICIENTS_M)

    @property
    def sources(self) -> Sources:
        """The base's."""
        return self.base.sources

    @property
    def medium(self) -> Medium:
        """The base's."""
        return self.base.medium

    @property
    def spacing_m(self) -> float:
        """Of the base; along a curve it only sets the clock."""
        return self.base.spacing_m

    @property
    def speed_m_s(self) -> float:
        """The base's."""
        return self.base.speed_m_s

    @property
    def start_s(self) -> float:
        """The base's."""
        return self.base.start_s

    @property
    def noise_sd(self) -> float:
        """None."""
        return 0.0

    def flight(self, rng: np.random.Generator) -> Flight:  # noqa: ARG002 - no noise
        """The readings along the curve."""
        time_s = self.start_s + self.spacing_m / self.speed_m_s * np.arange(READINGS, dtype=np.float64)
        reading = field_of(self.truth.vertices_m, self.sources.squared_spread_m2, self)
        return Flight(parametric=ParametricPath(self._basis, time_s, reading))

    def at(self, **changed: object) -> AlongCurve:
        """Nothing of it changes."""
        raise ValueError(f"{next(iter(changed))}: not along a curve")

    def placed(self, rng: np.random.Generator) -> AlongCurve:  # noqa: ARG002 - one path
        """Itself."""
        return self

    @property
    def image(self) -> None:
        """None: computed, not recorded."""

    @property
    def _basis(self) -> Array:
        return basis(np.arange(READINGS) / READINGS)


def _fig7(worlds: Worlds) -> list[Row]:
    return [Row(("2", str(len(COEFFICIENTS_M))), AlongCurve(worlds["fig7"]), _measure, once=True)]


def _measure(world: World, rng: np.random.Generator) -> dict[str, float]:
    return localise(world, rng, options=FINISHED)


FIG7 = Experiment(
    name="fig7",
    title="Fig. 7: a parametric trajectory, two sources, activation times known, no noise",
    worlds=("fig7",),
    columns=("K", "P"),
    shown=(Shown("E_sources"), Shown("E_lines"), Shown("E_amp")),
    rows=_fig7,
    picture=scene_picture,
    notes=(
        "The paper prints no number. P: basis functions, here φ = t, sin 2πt, cos 2πt with c = "
        + ", ".join(f"({x:g}, {y:g})" for x, y in COEFFICIENTS_M.tolist())
        + " m. Errors after the orthogonal transformation that brings the paths together.",
    ),
)
