"""The parts of a scene file, each checked by itself: ValueError "field: expected …, got …"."""

from __future__ import annotations

import math

import msgspec


class Medium(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The medium: all of a scene that an estimator may be told."""

    diffusivity_m2_s: float
    dimensions: int = 2
    ambient: float = 0.0
    static: bool = False

    def __post_init__(self) -> None:
        _positive("diffusivity_m2_s", self.diffusivity_m2_s)
        if self.dimensions not in (2, 3):
            raise ValueError(f"dimensions: expected 2 or 3, got {self.dimensions}")
        _finite("ambient", self.ambient)


class Source(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An instantaneous point release of `amplitude` (reading·m^d) at `activation_s` of scene time."""

    position_m: tuple[float, ...]
    amplitude: float
    activation_s: float

    def __post_init__(self) -> None:
        _places("position_m", self.position_m)
        _positive("amplitude", self.amplitude)
        _finite("activation_s", self.activation_s)


class PathOfScene(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The polyline flown, (L+1, d)."""

    vertices_m: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        if len(self.vertices_m) < 2:
            raise ValueError(f"vertices_m: expected at least 2 vertices, got {len(self.vertices_m)}")
        for i, vertex in enumerate(self.vertices_m):
            _places(f"vertices_m[{i}]", vertex)
            if i and vertex == self.vertices_m[i - 1]:
                raise ValueError(f"vertices_m[{i}]: expected another place than vertex {i - 1}, got {list(vertex)}")


class Sampling(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How a leg is read: every `spacing_m` from its start, or every `interval_s` of the flight.

    `start_s` is the scene time at which the first leg begins.
    """

    speed_m_s: float
    spacing_m: float | None = None
    interval_s: float | None = None
    start_s: float = 0.0

    def __post_init__(self) -> None:
        _positive("speed_m_s", self.speed_m_s)
        if (self.spacing_m is None) == (self.interval_s is None):
            given = "none" if self.spacing_m is None else "both"
            raise ValueError(f"spacing_m: expected exactly one of spacing_m and interval_s, got {given}")
        if self.spacing_m is not None:
            _positive("spacing_m", self.spacing_m)
        if self.interval_s is not None:
            _positive("interval_s", self.interval_s)
        _finite("start_s", self.start_s)


class Noise(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """White Gaussian noise by signal-to-noise ratio or by standard deviation; neither: none."""

    snr_db: float | None = None
    sd: float | None = None

    def __post_init__(self) -> None:
        if self.snr_db is not None and self.sd is not None:
            raise ValueError(f"sd: expected exactly one of snr_db and sd, got {self.snr_db} and {self.sd}")
        if self.snr_db is not None:
            _finite("snr_db", self.snr_db)
        if self.sd is not None and not (math.isfinite(self.sd) and self.sd >= 0.0):
            raise ValueError(f"sd: expected 0 or more, got {self.sd}")


def _finite(name: str, value: float) -> None:
    if not math.isfinite(value):
        raise ValueError(f"{name}: expected a finite number, got {value}")


def _positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name}: expected a positive number, got {value:g}")


def _places(name: str, place: tuple[float, ...]) -> None:
    if len(place) not in (2, 3) or not all(math.isfinite(x) for x in place):
        raise ValueError(f"{name}: expected 2 or 3 finite numbers (metres), got {list(place)}")
