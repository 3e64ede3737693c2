"""What is known of the medium."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dslam_mav.records.arrays import finite, number, read_only


@dataclass(frozen=True, slots=True, eq=False)
class Medium:
    """What is known of the medium; None means: estimate it.

    `spread_m` is √C of a static field and stands for μ and τ. `static` holds the field still at the flight's first
    reading. `activation_s`: a number for all sources, K numbers in any order (each source is given the one that suits
    it), "shared" for one unknown common to all, or None for one unknown each; in a static field with neither μ nor
    `spread_m` given, None and "shared" both mean one unknown spread. `extent`: the sources' shape κ (theory, section
    10), 0 for point releases; None frees it where the readings do not fit point releases. `ambient` is the level at the
    flight's first reading, which `ambient_drift_per_s` (of a sensor that warms up or cools) changes from there on.
    """

    diffusivity_m2_s: float | None = None
    activation_s: float | Literal["shared"] | tuple[float, ...] | None = None
    spread_m: float | None = None
    ambient: float | None = 0.0
    static: bool = False
    dimensions: int = 2
    sensor_lag_s: float | None = 0.0
    extent: float | None = None
    ambient_drift_per_s: float | None = 0.0

    def __post_init__(self) -> None:
        for name in ("diffusivity_m2_s", "spread_m"):
            value, wanted = getattr(self, name), "a positive number or None"
            if value is not None and number(value, name, wanted) <= 0.0:
                raise ValueError(f"{name}: expected {wanted}, got {value}")
        for name in ("ambient", "extent", "ambient_drift_per_s"):
            value = getattr(self, name)
            if value is not None:
                number(value, name, "a finite number or None")
        lag, wanted = self.sensor_lag_s, "0 or more, or None"
        if lag is not None and number(lag, "sensor_lag_s", wanted) < 0.0:
            raise ValueError(f"sensor_lag_s: expected {wanted}, got {lag}")
        if not isinstance(self.static, (bool, np.bool_)):
            raise ValueError(f"static: expected True or False, got {self.static!r}")
        if not isinstance(self.dimensions, (int, np.integer)) or self.dimensions not in (2, 3):
            raise ValueError(f"dimensions: expected 2 or 3, got {self.dimensions!r}")
        if self.spread_m is not None and not self.static:
            raise ValueError("spread_m: only a static field has one spread; set static=True or give μ and τ")
        object.__setattr__(self, "activation_s", _activation(self.activation_s))


def _activation(tau: object) -> float | Literal["shared"] | tuple[float, ...] | None:
    wanted = 'a finite number, None or "shared"'
    if tau is None:
        return None
    if isinstance(tau, str):
        if tau != "shared":
            raise ValueError(f"activation_s: expected {wanted}, got {tau!r}")
        return "shared"
    if np.ndim(tau) == 0:  # type: ignore[arg-type]
        return number(tau, "activation_s", wanted)
    times = read_only(tau, "activation_s", (None,))  # type: ignore[arg-type]
    finite(times, "activation_s")
    if not times.size:
        raise ValueError("activation_s: expected one time or one a source, got none")
    return tuple(times.tolist())
