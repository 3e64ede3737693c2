"""What is known of the medium."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dslam_mav.records.arrays import finite, read_only


@dataclass(frozen=True, slots=True, eq=False)
class Medium:
    """What is known of the medium; None means: estimate it.

    `spread_m` is √C of a static field and stands for μ and τ. `static` holds the field still at the flight's first
    reading. `activation_s`: a number for all sources, K numbers in any order (each source is given the one that suits
    it), "shared" for one unknown common to all, or None for one unknown each; in a static field with neither μ nor
    `spread_m` given, None and "shared" both mean one unknown spread. `extent`: the sources' shape κ (theory, section
    10), 0 for point releases; None frees it where the readings do not fit point releases.
    """

    diffusivity_m2_s: float | None = None
    activation_s: float | Literal["shared"] | tuple[float, ...] | None = None
    spread_m: float | None = None
    ambient: float | None = 0.0
    static: bool = False
    dimensions: int = 2
    sensor_lag_s: float | None = 0.0
    extent: float | None = None

    def __post_init__(self) -> None:
        for name in ("diffusivity_m2_s", "spread_m"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name}: expected a positive number or None, got {value}")
        if self.ambient is not None and not np.isfinite(self.ambient):
            raise ValueError(f"ambient: expected a finite number or None, got {self.ambient}")
        if self.sensor_lag_s is not None and not (np.isfinite(self.sensor_lag_s) and self.sensor_lag_s >= 0.0):
            raise ValueError(f"sensor_lag_s: expected 0 or more, or None, got {self.sensor_lag_s}")
        if self.extent is not None and not np.isfinite(self.extent):
            raise ValueError(f"extent: expected a finite number or None, got {self.extent}")
        if self.dimensions not in (2, 3):
            raise ValueError(f"dimensions: expected 2 or 3, got {self.dimensions}")
        if self.spread_m is not None and not self.static:
            raise ValueError("spread_m: only a static field has one spread; set static=True or give μ and τ")
        if isinstance(self.activation_s, str):
            if self.activation_s != "shared":
                raise ValueError(f'activation_s: expected a number, None or "shared", got {self.activation_s!r}')
        elif isinstance(self.activation_s, (int, float, np.number)):
            if not np.isfinite(self.activation_s):
                raise ValueError(f"activation_s: expected a finite number or None, got {self.activation_s}")
        elif self.activation_s is not None:
            times = read_only(self.activation_s, "activation_s", (None,))
            finite(times, "activation_s")
            object.__setattr__(self, "activation_s", tuple(times.tolist()))
