"""Scene files: sources, path, sampling and noise of a synthetic flight (JSON, no unknown keys).

Places are metres [east, north(, up)] from home. Each leg is read at s = 0, Ts, … < l_j (or every `interval_s`
of the flight); time runs on over the flight at `speed_m_s`. All times in a scene are scene time, in which the
first leg begins at `sampling.start_s` (0). An estimate counts from the start of the first leg: a scene's
`activation_s` is `activation_s − start_s` there. SNR = 10·log10(mean squared noiseless reading without ambient /
noise variance), over all readings of the flight. `static` holds the field as it is at the flight's first reading.
"""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from dslam_mav import records
from dslam_mav.dslam.field import field, peak_reading, squared_spread_m2
from dslam_mav.errors import BadInputError, unreadable
from sim_bridge.fields.complaint import complaint
from sim_bridge.fields.field import Array
from sim_bridge.fields.scene_parts import Medium, Noise, PathOfScene, Sampling, Source

__all__ = [
    "Medium",
    "Noise",
    "PathOfScene",
    "Sampling",
    "Scene",
    "SceneField",
    "Source",
    "encode_scene",
    "parse_scene",
    "read_scene",
    "simulate",
    "truth",
]


class Scene(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One synthetic experiment. Impossible values are a ValueError that names the field and the value."""

    medium: Medium
    sources: tuple[Source, ...]
    sampling: Sampling
    path: PathOfScene | None = None
    noise: Noise = Noise()
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.sources:
            raise ValueError("sources: expected at least 1 source, got []")
        if self.seed < 0:
            raise ValueError(f"seed: expected 0 or more, got {self.seed}")
        self._check_dimensions()
        start_s = self.sampling.start_s
        late = [k for k, source in enumerate(self.sources) if source.activation_s >= start_s]
        # an evolving field may gain sources in flight; one held still, or one without any, never shows them
        if late and (self.medium.static or len(late) == len(self.sources)):
            raise ValueError(
                f"sources[{late[0]}].activation_s: expected before the flight's start at {start_s:g} s, "
                f"got {self.sources[late[0]].activation_s:g}"
            )

    def _check_dimensions(self) -> None:
        d = self.medium.dimensions
        places = [(f"sources[{k}].position_m", s.position_m) for k, s in enumerate(self.sources)]
        if self.path is not None:
            places += [(f"path.vertices_m[{i}]", v) for i, v in enumerate(self.path.vertices_m)]
        for name, place in places:
            if len(place) != d:
                raise ValueError(f"{name}: expected {d} numbers (medium.dimensions is {d}), got {list(place)}")

    @property
    def source_position_m(self) -> Array:
        """(K, d) places of the sources."""
        return np.array([s.position_m for s in self.sources], dtype=np.float64)

    @property
    def amplitude(self) -> Array:
        """(K,) amplitudes in reading·m^d."""
        return np.array([s.amplitude for s in self.sources], dtype=np.float64)

    @property
    def activation_s(self) -> Array:
        """(K,) activation times in scene time."""
        return np.array([s.activation_s for s in self.sources], dtype=np.float64)

    def vertices(self) -> Array | None:
        """(L+1, d) vertices of the scene's own path, None without one."""
        return None if self.path is None else np.array(self.path.vertices_m, dtype=np.float64)

    def noise_sd(self, vertices_m: ArrayLike) -> float:
        """Standard deviation of the noise on a flight along `vertices_m` (L+1, d)."""
        if self.noise.snr_db is None:
            return self.noise.sd or 0.0
        return math.sqrt(self.mean_square(vertices_m) / 10.0 ** (self.noise.snr_db / 10.0))

    def mean_square(self, vertices_m: ArrayLike) -> float:
        """Of the readings on a flight along `vertices_m` (L+1, d), without noise and ambient."""
        time_s, place_m = _readings_of(self, _checked_vertices(self, vertices_m))[2:]
        signal = SceneField(self).read(time_s - self.sampling.start_s, place_m) - self.medium.ambient
        return float(np.mean(signal**2))

    def usual_peak(self) -> float | None:
        """The sources' peak readings above ambient as the flight begins, geometric mean; None before any is on."""
        active = self.sampling.start_s > self.activation_s
        if not active.any():
            return None
        age_s = self.sampling.start_s - self.activation_s[active]
        spread2 = 4.0 * self.medium.diffusivity_m2_s * age_s
        return float(np.exp(np.log(peak_reading(self.amplitude[active], spread2, self.medium.dimensions)).mean()))

    def estimator_medium(self) -> records.Medium:
        """The scene's `medium` as an estimator may be told it: activation times are not part of it."""
        m = self.medium
        return records.Medium(m.diffusivity_m2_s, ambient=m.ambient, static=m.static, dimensions=m.dimensions)


class SceneField:
    """The field of a scene, ambient included; time zero is the first leg's start, scene time `start_s`."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._sources = scene.source_position_m, scene.amplitude

    def read(self, time_s: Array, place_m: Array) -> Array:
        """Readings (M,) at flight time (M,) and places (M, 2 or 3); a 2-D field ignores the height."""
        medium, d = self._scene.medium, self._scene.medium.dimensions
        elapsed_s = np.zeros(len(place_m)) if medium.static else np.asarray(time_s, dtype=np.float64)
        scene_time_s = self._scene.sampling.start_s + elapsed_s
        c = squared_spread_m2(scene_time_s[:, None], medium.diffusivity_m2_s, self._scene.activation_s)
        return np.asarray(medium.ambient + field(place_m[:, :d], c, *self._sources))


def simulate(scene: Scene, vertices_m: ArrayLike, rng: np.random.Generator) -> records.Flight:
    """A flight along `vertices_m` (L+1, d) as its sensor reads it: no sockets, nothing rounded to float32.

    Noise is drawn in the order of the readings. A leg shorter than the spacing still has its reading at
    s = 0. ValueError names an argument that cannot be used.
    """
    vertices = _checked_vertices(scene, vertices_m)
    lengths, counts, time_s, place_m = _readings_of(scene, vertices)
    reading = SceneField(scene).read(time_s - scene.sampling.start_s, place_m)
    reading = reading + scene.noise_sd(vertices) * rng.standard_normal(reading.size)
    legs, first = [], 0
    for j, (length, count) in enumerate(zip(lengths, counts, strict=True)):
        part = slice(first, first + count)
        distance_m = np.linalg.norm(place_m[part] - vertices[j], axis=1)
        legs.append(records.Leg(float(length), distance_m, time_s[part], reading[part]))
        first += count
    return records.Flight(tuple(legs))


def truth(scene: Scene, vertices_m: ArrayLike) -> records.Truth:
    """What a flight along `vertices_m` over this scene is judged against."""
    return records.Truth(scene.source_position_m, scene.amplitude, _checked_vertices(scene, vertices_m))


def _checked_vertices(scene: Scene, vertices_m: ArrayLike) -> Array:
    vertices = records.read_only(vertices_m, "vertices_m", (None, scene.medium.dimensions))
    if len(vertices) < 2 or not (np.linalg.norm(np.diff(vertices, axis=0), axis=1) > 0.0).all():
        raise ValueError("vertices_m: expected at least 2 finite vertices, neighbours at different places")
    return vertices


def _readings_of(scene: Scene, vertices: Array) -> tuple[Array, list[int], Array, Array]:
    """(leg lengths (L,), readings per leg, scene times (N,), places (N, d)) of a flight."""
    sampling = scene.sampling
    legs = np.diff(vertices, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    counts, times, places = [], [], []
    for j, length in enumerate(lengths):
        if sampling.spacing_m is not None:
            # s < l_j; 1e-9 of a spacing: rounding alone must not put a reading on the corner
            count = max(1, math.ceil(length / sampling.spacing_m - 1e-9))
            s = sampling.spacing_m * np.arange(count)
        else:
            step = sampling.speed_m_s * (sampling.interval_s or 0.0)
            n = np.arange(math.ceil(starts[j] / step - 1e-9), math.ceil(starts[j + 1] / step - 1e-9))
            s = np.maximum(n * step - starts[j], 0.0)
        counts.append(len(s))
        times.append(sampling.start_s + (starts[j] + s) / sampling.speed_m_s)
        places.append(vertices[j] + s[:, None] * (legs[j] / length))
    return lengths, counts, np.concatenate(times), np.concatenate(places)


def read_scene(path: Path) -> Scene:
    """The scene in a JSON file; BadInputError names the file, the field's path and the value."""
    try:
        text = path.read_bytes()
    except OSError as error:
        raise unreadable(path, error) from None
    return parse_scene(text, str(path))


def parse_scene(text: bytes, name: str) -> Scene:
    """The scene in JSON `text`; `name` stands for the file in errors."""
    try:
        document = msgspec.json.decode(text)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadInputError(f"{name}: expected JSON, got something else: {error}") from None
    try:
        return msgspec.convert(document, Scene)
    except msgspec.ValidationError as error:
        raise BadInputError(f"{name}: {complaint(str(error), document, _KEYS)}") from None


def encode_scene(scene: Scene) -> bytes:
    """The scene as indented JSON."""
    return msgspec.json.format(msgspec.json.encode(scene), indent=2) + b"\n"


_KEYS = {
    "": Scene.__struct_fields__,
    "medium": Medium.__struct_fields__,
    "sources": Source.__struct_fields__,
    "path": PathOfScene.__struct_fields__,
    "sampling": Sampling.__struct_fields__,
    "noise": Noise.__struct_fields__,
}
