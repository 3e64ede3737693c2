"""The worlds the paper's experiments fly over: scene files, and recorded spots."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from dslam_mav import experiments
from dslam_mav.dslam.field import squared_spread_m2
from dslam_mav.records import Flight, Leg, Medium, Sources, Truth
from dslam_mav.records.arrays import Array
from sim_bridge.fields.frame_stack import FrameStack
from sim_bridge.fields.scene import Medium as SceneMedium
from sim_bridge.fields.scene import Noise, Sampling, Scene, Source, read_scene, simulate, truth

SCENES = Path(experiments.__file__).parent / "scenes"
RECORDINGS = Path(experiments.__file__).parents[3] / "shared" / "data"
FRAMES = {"spot_bilayer_a": 1, "spot_bilayer_b": 0, "spot_laser_heated": 13}
"""The frame of each recording that is flown; the laser is off from frame 12 on."""

TRIANGLE_SPREADS = 3.0  # its sides
READINGS = 180  # a leg, as the paper's
WANDER_SPREADS = 0.3  # how far the triangle's middle may lie from the spot's, either way


def find_world(name: str) -> SceneWorld | RecordedWorld | None:
    """The world of a scene file or recording; None where there is no such recording on this machine."""
    if (SCENES / f"{name}.json").exists():
        return SceneWorld(read_scene(SCENES / f"{name}.json"))
    path = RECORDINGS / f"{name}.npz"
    return RecordedWorld(path, FRAMES[name]) if path.exists() else None


@dataclass(frozen=True, eq=False)
class SceneWorld:
    """A scene file, flown without sockets."""

    scene: Scene

    @property
    def truth(self) -> Truth:
        """Of the scene, in its own frame."""
        return truth(self.scene, self._vertices)

    @property
    def sources(self) -> Sources:
        """With their peaks at the first reading."""
        scene = self.scene
        c = squared_spread_m2(self.start_s, scene.medium.diffusivity_m2_s, scene.activation_s)
        peak = scene.amplitude / (np.pi * c) ** (scene.medium.dimensions / 2.0)
        return Sources(scene.source_position_m, scene.amplitude, peak, scene.activation_s)

    @property
    def medium(self) -> Medium:
        """Without activation times."""
        return self.scene.estimator_medium()

    @property
    def spacing_m(self) -> float:
        """Ts; scenes of experiments are read by distance."""
        assert self.scene.sampling.spacing_m is not None
        return self.scene.sampling.spacing_m

    @property
    def speed_m_s(self) -> float:
        """Of the flight."""
        return self.scene.sampling.speed_m_s

    @property
    def start_s(self) -> float:
        """Scene time of the first reading."""
        return self.scene.sampling.start_s

    @property
    def noise_sd(self) -> float:
        """On this scene's path."""
        return self.scene.noise_sd(self._vertices)

    def flight(self, rng: np.random.Generator) -> Flight:
        """One flight with noise of its own."""
        return simulate(self.scene, self._vertices, rng)

    def at(
        self,
        *,
        snr_db: float | None = None,
        speed_m_s: float | None = None,
        static: bool | None = None,
        source_position_m: Array | None = None,
    ) -> SceneWorld:
        """The same scene but for what is given; an infinite SNR takes the noise away."""
        s = self.scene
        noise = s.noise if snr_db is None else Noise(snr_db=snr_db if np.isfinite(snr_db) else None)
        medium = s.medium
        if static is not None:
            medium = SceneMedium(medium.diffusivity_m2_s, medium.dimensions, medium.ambient, static)
        sampling = s.sampling
        if speed_m_s is not None:
            sampling = Sampling(speed_m_s, sampling.spacing_m, sampling.interval_s, sampling.start_s)
        sources = s.sources
        if source_position_m is not None:
            sources = tuple(
                Source(tuple(map(float, place)), old.amplitude, old.activation_s)
                for place, old in zip(source_position_m, sources, strict=True)
            )
        return SceneWorld(Scene(medium, sources, sampling, s.path, noise, s.seed))

    def placed(self, rng: np.random.Generator) -> SceneWorld:  # noqa: ARG002 - a scene has its own path
        """Itself."""
        return self

    @property
    def image(self) -> None:
        """None: computed, not recorded."""

    @property
    def _vertices(self) -> Array:
        vertices = self.scene.vertices()
        assert vertices is not None, "scenes of experiments have their own path"
        return vertices


@dataclass(frozen=True, eq=False)
class RecordedWorld:
    """A frame of a recorded spot, held still; lengths in its √C. `path_spreads` (4, 2): the closed triangle flown.

    The truth is the centre of a Gaussian fitted to the frame, which is the origin.
    """

    recording: Path
    frame: int
    path_spreads: Array | None = None

    @property
    def truth(self) -> Truth:
        """The spot, and the triangle about it."""
        fit = self._stack.fit(self.frame)
        return Truth(np.zeros((1, 2)), np.array([np.pi * fit.peak]), self._vertices)

    @property
    def sources(self) -> Sources:
        """The spot; when it was released nobody knows."""
        fit = self._stack.fit(self.frame)
        return Sources(np.zeros((1, 2)), np.array([np.pi * fit.peak]), np.array([fit.peak]), np.array([np.nan]))

    @property
    def medium(self) -> Medium:
        """Its spread is the unit of length; the ambient level is the fitted Gaussian's."""
        return Medium(spread_m=1.0, ambient=self._stack.fit(self.frame).ambient, static=True)

    @property
    def spacing_m(self) -> float:
        """Ts in √C."""
        return TRIANGLE_SPREADS / READINGS

    @property
    def speed_m_s(self) -> float:
        """One √C a second; nothing moves meanwhile."""
        return 1.0

    @property
    def start_s(self) -> float:
        """No time passes in a frame."""
        return 0.0

    @property
    def noise_sd(self) -> float:
        """Unknown."""
        return float("nan")

    @property
    def image(self) -> tuple[Array, tuple[float, float, float, float]]:
        """The frame and its extent (left, right, bottom, top) in √C from the spot, rows running down."""
        fit, pixels = self._stack.fit(self.frame), self._stack.frames[self.frame]
        height, width = pixels.shape
        left, top = (-0.5 - fit.column_px) / fit.spread_px, (0.5 + fit.row_px) / fit.spread_px
        return pixels, (left, left + width / fit.spread_px, top - height / fit.spread_px, top)

    def flight(self, rng: np.random.Generator) -> Flight:  # noqa: ARG002 - the noise is the recording's own
        """The frame read along the triangle."""
        b, fit = self._vertices, self._stack.fit(self.frame)
        legs = []
        for j, length in enumerate(np.linalg.norm(np.diff(b, axis=0), axis=1).tolist()):
            s = self.spacing_m * np.arange(READINGS, dtype=np.float64)
            places = b[j] + s[:, None] * (b[j + 1] - b[j]) / length
            columns, rows = fit.column_px + places[:, 0] * fit.spread_px, fit.row_px - places[:, 1] * fit.spread_px
            legs.append(Leg(length, s, j * length + s, self._stack.at(self.frame, columns, rows)))
        return Flight(tuple(legs), closed=True)

    def at(self, **changed: object) -> RecordedWorld:
        """A recording cannot be changed."""
        raise ValueError(f"{next(iter(changed))}: not of a recording")

    def placed(self, rng: np.random.Generator) -> RecordedWorld:
        """A triangle of its own: turned any way, its middle up to `WANDER_SPREADS` from the spot's, either way."""
        corner = rng.uniform(0.0, 2.0 * np.pi) + 2.0 * np.pi / 3.0 * np.arange(4)
        middle = rng.uniform(-WANDER_SPREADS, WANDER_SPREADS, 2)
        vertices = middle + TRIANGLE_SPREADS / np.sqrt(3.0) * np.column_stack((np.cos(corner), np.sin(corner)))
        return RecordedWorld(self.recording, self.frame, vertices)

    @property
    def _vertices(self) -> Array:
        assert self.path_spreads is not None, "placed() flies it"
        return self.path_spreads

    @property
    def _stack(self) -> FrameStack:
        return _read(self.recording)


@cache
def _read(path: Path) -> FrameStack:
    return FrameStack.read(path)
