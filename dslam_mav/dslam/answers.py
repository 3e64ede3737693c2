"""The distinct fits of a problem, and what they leave of the readings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dslam_mav.dslam.certify import Noise
from dslam_mav.dslam.fit import Fit
from dslam_mav.dslam.priors import Priors
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.starts import Starts
from dslam_mav.dslam.state import layout
from dslam_mav.dslam.units import Units


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """The distinct fits of a problem, best first, and what is needed to tell what they are worth.

    The problem is in units of its own; `freedom_inside` are the numbers the legs can carry at most; `loose`: how legs
    may begin beside the corners (`task.Task`).
    """

    problem: Problem
    fits: tuple[Fit, ...]
    level: Noise
    freedom_inside: int
    unit: Units
    priors: Priors
    loose: float
    begun: Starts | None = None

    @property
    def diagnostics(self) -> dict[str, Any]:
        """What the best fit leaves of the readings, as its estimate will say."""
        return self.told(self.fits[0])

    def told(self, f: Fit) -> dict[str, Any]:
        """What a fit leaves of the readings, in reading units but for costs."""
        level, prob, k_sources = self.level, self.problem, len(f.state.s)
        at = layout(prob, k_sources)
        readings = float(f.residual @ f.residual)
        return {
            "cost": readings + prob.outside,
            "priors_cost": f.cost - readings,
            "n_sources": k_sources,
            "free_unknowns": at.size - (at.gap.stop - at.gap.start),  # where legs begin is known but for a little
            "n_readings": prob.n_readings,
            "freedom_inside": self.freedom_inside,
            "residual_inside_sd": float(np.sqrt(level.inside)) * self.unit.reading,
            "residual_outside_sd": float(np.sqrt(level.outside)) * self.unit.reading,
            "whiteness_p": level.p_value,
            "systematic_share": level.systematic_share,
            "priors_noise_sd": prob.known.noise_sd * self.unit.reading,
            "extent": f.state.extent,
            "noise_measured": level.measured,
            "corners_loose": self.loose,
        }
