"""What the paper leaves open, as options of its method."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

Samples = Literal["exact", "robust", "auto"]
Solver = Literal["annihilating", "tls", "pencil"]
RefinePoints = Literal["projections", "readings"]


@dataclass(frozen=True, slots=True)
class PaperOptions:
    """The paper's free choices; lengths in spreads √C, so that they mean the same on any scale.

    `samples`: generalised samples (Appendix A): "exact" is Prony on y·e^{s²/C}, "robust" reproduces exponentials (17),
    "auto" takes exact where a leg is free of noise and evenly sampled, robust otherwise. "exact" and "auto" end with a
    fit to the leg's own readings, "robust" does not. `omega_0`: largest frequency of (17), rad per √C; None: from the
    leg's noise. `fit_margin`: how far beyond either end of a leg centres may lie. `denoise`: Cadzow iterations on the
    robust samples. `solver`: the annihilating filter (20), its total-least-squares form, or the matrix pencil (IV-D).
    `refine`, `refine_points`: IV-D under noise, and its points (footnote 3): the projections P_kj, or all readings.
    `polish`: where readings are free of noise, centres and the answer are fitted to them down to rounding.
    `separation_epsilon`: IV-B's ε as a share of a leg's largest reading; None: the one that finds the sources.
    """

    samples: Samples = "auto"
    omega_0: float | None = None
    fit_margin: float = 1.0
    denoise: int = 10
    solver: Solver = "tls"
    refine: bool = True
    refine_points: RefinePoints = "projections"
    separation_epsilon: float | None = None
    polish: bool = True

    def __post_init__(self) -> None:
        for name, kind in (("samples", Samples), ("solver", Solver), ("refine_points", RefinePoints)):
            if getattr(self, name) not in get_args(kind):
                raise ValueError(f"{name}: expected one of {', '.join(get_args(kind))}, got {getattr(self, name)!r}")
        if self.omega_0 is not None and not 0.0 < self.omega_0 < 20.0:
            raise ValueError(f"omega_0: expected a frequency between 0 and 20 rad per √C, or None, got {self.omega_0}")
        if not 0.0 <= self.fit_margin <= 10.0:
            raise ValueError(f"fit_margin: expected 0 to 10 spreads, got {self.fit_margin}")
        if not (isinstance(self.denoise, int) and self.denoise >= 0):
            raise ValueError(f"denoise: expected a number of iterations, 0 or more, got {self.denoise}")
        if self.separation_epsilon is not None and not 0.0 < self.separation_epsilon < 1.0:
            raise ValueError(f"separation_epsilon: expected a share between 0 and 1, got {self.separation_epsilon}")
