"""What the sensor read while the vehicle stood before its first leg, as the estimate takes it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from dslam_mav.assumptions import Assumptions
from dslam_mav.legs import Standing
from dslam_mav.records import Estimate

CONTRADICTED_SD = 4.0
"""Standard deviations between the level of the stand and that of every answer, from which on the former is left out."""


@dataclass(frozen=True, slots=True)
class Calibrated:
    """Ambient level and its standard deviation; a reading's noise and its degrees of freedom."""

    ambient: tuple[float, float] | None = None
    noise: tuple[float, float] | None = None


def calibrated_answer(
    assumptions: Assumptions, standing: Standing | None, answer: Callable[[Calibrated], Estimate]
) -> Estimate:
    """The answer with what the stand tells, as far as it is asked for and the legs do not contradict it; its reason
    says what was left out.
    """
    level_wanted, noise_wanted = assumptions.ambient == "hover", assumptions.noise == "hover"
    if not (level_wanted or noise_wanted):
        return answer(Calibrated())
    if standing is None:
        return _with(answer(Calibrated()), "The vehicle was not read standing before its first leg.")
    noise = standing.noise() if noise_wanted else None
    result, said = answer(Calibrated(noise=noise)), []
    if level_wanted:
        level = standing.level()
        if (against := _against(level, result)) is None:
            result = answer(Calibrated(level, noise))
        else:
            said.append(against)
    if noise is not None and not result.diagnostics.get("noise_measured", True):
        said.append(f"The noise of {noise[0]:.3g} read standing is not that of the legs, and is left out.")
    return _with(result, *said)


def _against(level: tuple[float, float], free: Estimate) -> str | None:
    """Where no answer without it has the level of the stand, in words."""
    off = [_apart(level, each) for each in (free, *free.alternatives)]
    known = [each for each in off if each is not None]
    if not known or min(known) <= CONTRADICTED_SD:
        return None
    told = free.medium.ambient
    return (
        f"The level of {level[0]:.4g} ± {level[1]:.2g} read standing is not the ambient level of the legs, {told:.4g}: "
        "it is left out. The vehicle stood in the field, or higher or lower than it flew."
    )


def _apart(level: tuple[float, float], free: Estimate) -> float | None:
    """Standard deviations between the two; None where the answer tells no level."""
    if "ambient" not in free.parameter_names or free.medium.ambient is None:
        return None
    i = free.parameter_names.index("ambient")
    sd = math.sqrt(max(float(free.parameter_covariance[i, i]), 0.0))
    return abs(level[0] - free.medium.ambient) / math.hypot(level[1], sd)


def _with(result: Estimate, *said: str) -> Estimate:
    return replace(result, reason=" ".join([*filter(None, [result.reason]), *said])) if said else result
