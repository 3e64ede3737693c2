"""What a person assumes of a flight before it is flown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from dslam_mav.records import Medium


@dataclass(frozen=True, slots=True)
class Assumptions:
    """What the person assumes of a flight: recorded with every estimate so that replay repeats it.

    None means: find it out. `ambient` "hover" is the level read where the vehicle stood before its first leg, `noise`
    "hover" the noise there, beside that of the legs. `heading_sd_rad` is how far a heading from compass or plan is
    trusted.
    """

    n_sources: int | None = None
    diffusivity_m2_s: float | None = None
    activation_s: float | None = None
    spread_m: float | None = None
    ambient: float | Literal["hover"] | None = None
    noise: Literal["legs", "hover"] = "legs"
    ambient_drift_per_s: float | None = 0.0
    sensor_lag_s: float | None = 0.0
    static: bool = True
    closed: bool = False
    heading: Literal["none", "vehicle", "plan"] = "none"
    heading_sd_rad: float = 0.0873
    distance: Literal["odometry", "speed", "plan"] | None = None
    method: Literal["joint", "paper"] = "joint"
    seed: int = 0

    def medium(self) -> Medium:
        """The medium these assumptions describe."""
        return Medium(
            diffusivity_m2_s=self.diffusivity_m2_s,
            activation_s="shared" if self.activation_s is None else self.activation_s,
            spread_m=self.spread_m,
            ambient=None if isinstance(self.ambient, str) else self.ambient,
            static=self.static,
            sensor_lag_s=self.sensor_lag_s,
            ambient_drift_per_s=self.ambient_drift_per_s,
        )
