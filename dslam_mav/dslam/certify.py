"""What an estimate is worth: noise level, whiteness of the residuals, verdict in words (theory, sections 9 and 10)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from dslam_mav.dslam.bound import Information
from dslam_mav.records import Estimate, Flight, Verdict
from dslam_mav.records.words import agree, count

Array = NDArray[np.float64]

MIN_READINGS_PER_LEG = 4
MIN_REACH = 1e-3  # of a leg's length
MISFIT_P_VALUE = 1e-3
MISFIT_WIDENING = 8.0  # theory, section 10: 4 to 16, by recording
MISFIT_BESIDE = 2.0  # the same, of what is no matter of the sources' shape (shape.py)
MISFIT_LIKELY = 0.03  # p from which errors are widened, before the misfit is said to be one
MISFIT_MATTERS = 0.06  # systematic residual, as a share of the readings' range, from which the model is called wrong
# A smaller share is too much where it stands far out of the noise: widened errors hold while both are small. The share
# times noise levels above the noise is at most 0.013 on recordings answered rightly, whose misfit is mild; 0.024 or
# more with a cold source among two or three; 0.035 where a field that stands still is said to evolve.
MISFIT_CLEAR = 0.018
MISFIT_SURE_SPREADS = 0.5  # a source less sure than that by readings that do not fit is no answer
MISFIT_CAP = 3.0  # noise levels counted: a nearly noiseless sensor shows up any model, …
MISFIT_MILD = 0.014  # … and what a copter's drift along its legs alone leaves, 0.012 of the range, stays below this
UNIDENTIFIED_SD_SPREADS = 2.0  # a position less sure than this is no position
SAME_PLACE_SPREADS = 0.02
WINDOW = 9.0  # alternatives: 2·Δ log-likelihood below this


_OF_ONE = (  # name of a parameter, what it is of, in words, and again of the same
    (r"heading of leg (\d+)", "leg", "the direction of {}", "its direction"),
    (r"climb of leg (\d+)", "leg", "the climb of {}", "its climb"),
    (r"length of leg (\d+)", "leg", "the length of {}", "its length"),
    (r"corner (\d+) \w", "leg", "where {} begins", "where it begins"),
    (r"source (\d+) \w", "source", "where {} lies", "where it lies"),
    (r"ln amplitude (\d+)", "source", "the strength of {}", "its strength"),
    (r"ln C (\d+)", "source", "the spread of {}", "its spread"),
    (r"coefficient (\d+) \w", "coefficient", "{} of the path", "the same"),
)
_OF_ALL = {
    "ln C": "the spread of the sources",
    "ln diffusivity": "the diffusivity",
    "extent": "the size of the sources when they were released",
    "ambient": "the ambient level",
    "ambient drift": "the drift of the ambient level",
    "ln lag": "the lag of the sensor",
    "turn": "the direction of the whole path",
    **{f"shift {axis}": "where the whole path lies" for axis in "xyz"},
}


@dataclass(frozen=True, slots=True)
class Noise:
    """The residuals' level: `variance` to weigh answers with, and whether the model's misfit stands out from noise.

    `inside` and `outside` are mean squares per degree of freedom inside the span of what sources can do to a leg, and
    outside of it; white residuals have them equal. `measured`: noise measured elsewhere counts to the latter. Errors
    are those of noise of `scatter`, and of shapes that leave `excess` energy, what is inside beyond the noise.
    """

    variance: float
    scatter: float
    excess: float
    inside: float
    outside: float
    p_value: float
    systematic_share: float
    measured: bool = False

    @property
    def misfit(self) -> bool:
        """Whether the residuals are not white."""
        return self.p_value < MISFIT_P_VALUE

    @property
    def matters(self) -> bool:
        """Whether the misfit is too large for widened uncertainties to cover it."""
        above = float(np.sqrt(self.inside / max(self.outside, 1e-300))) - 1.0
        share = self.systematic_share
        clear = share > MISFIT_MILD and share * min(above, MISFIT_CAP) > MISFIT_CLEAR
        return self.misfit and (clear or share > MISFIT_MATTERS)

    @property
    def sd(self) -> float:
        """Standard deviation of a reading about the model."""
        return float(np.sqrt(self.outside if self.misfit else self.variance))


def too_few(flight: Flight, n_parameters: int, k_sources: int) -> str | None:
    """Why these data cannot carry an estimate, or None."""
    need = 3 if k_sources > 1 else 2
    if flight.parametric is None and len(flight.legs) < need:
        return (
            f"{count(len(flight.legs), 'leg')} can be used; "
            f"{count(k_sources, 'source')} {agree(k_sources, 'needs', 'need')} at least {need}."
        )
    for j, leg in enumerate(flight.legs, start=1):
        if leg.reading.size < MIN_READINGS_PER_LEG:
            return f"Leg {j} has {count(leg.reading.size, 'reading')}; at least {MIN_READINGS_PER_LEG} are needed."
        if float(np.ptp(leg.distance_m)) < MIN_REACH * leg.length_m:
            return f"All readings of leg {j} were taken at one place: nothing was seen along it."
    if flight.n_readings <= n_parameters:
        return (
            f"{count(flight.n_readings, 'reading')} cannot carry {count(n_parameters, 'unknown')} "
            f"({count(k_sources, 'source')})."
        )
    return None


def noise(
    cost: float,
    n: int,
    n_parameters: int,
    outside: tuple[float, int],
    span: float,
    elsewhere: tuple[float, float] = (0.0, 0.0),
) -> Noise:
    """Test the residuals for whiteness; `outside` is (energy, freedom) beyond the legs' bases, `span` max − min.

    `elsewhere` is (energy, freedom) of the same noise where no source changes it; it is left out where the readings
    outside the bases say that it is not the same.
    """
    energy_out, dof_out = outside
    dof = max(n - n_parameters, 1)
    dof_in = dof - dof_out
    measured = elsewhere[1] > 0.0 and (dof_out < 5 or _alike(outside, elsewhere))
    more_energy, more_dof = elsewhere if measured else (0.0, 0.0)
    pooled = max((cost + more_energy) / (dof + more_dof), 1e-300)
    dof_known = dof_out + more_dof
    if dof_known < 5 or dof_in < 5:
        return Noise(pooled, pooled, 0.0, pooled, pooled, 1.0, 0.0, measured)
    s_out = max((energy_out + more_energy) / dof_known, 1e-300)
    s_in = max((cost - energy_out) / dof_in, 0.0)
    p_value = float(
        fdtrc(dof_in, dof_known, s_in / s_out)
    )  # survival of the F distribution; scipy.stats loads for a second
    share = float(np.sqrt(max(s_in - s_out, 0.0) * dof_in / n)) / max(span, 1e-300)
    if p_value >= MISFIT_LIKELY:
        return Noise(pooled, pooled, 0.0, s_in, s_out, p_value, share, measured)
    more = s_in - s_out
    weighed = s_out + MISFIT_WIDENING * more if p_value < MISFIT_P_VALUE else pooled
    return Noise(weighed, s_out + MISFIT_BESIDE * more, dof_in * more, s_in, s_out, p_value, share, measured)


def _alike(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether two (energy, freedom) may be of one noise, by an F-test to both sides."""
    a, b = (max(energy / freedom, 1e-300) for energy, freedom in (one, other))
    above, below = fdtrc(one[1], other[1], a / b), fdtrc(other[1], one[1], b / a)
    return bool(min(above, below) >= 0.5 * MISFIT_P_VALUE)


def unseen(flight: Flight, ambient: float | None, best: Estimate) -> str | None:
    """Why the answer is no more than noise would give, the level alone doing as well by BIC; None where sources show.

    Residuals that are not white are no noise: something shows that the answer does not explain.
    """
    if best.diagnostics["whiteness_p"] < MISFIT_P_VALUE:
        return None
    readings = np.concatenate([p.reading for p in flight.legs or (flight.parametric,) if p is not None])
    level = float(readings.mean()) if ambient is None else ambient
    flat = float((((readings - level) / float(np.ptp(readings))) ** 2).sum())
    extra = len(best.parameter_names) - int(ambient is None)
    gain = readings.size * np.log(max(flat, 1e-300) / max(best.diagnostics["cost"], 1e-300))
    if gain > extra * np.log(readings.size):
        return None
    return f"No source is seen: a constant level of {level:.3g} explains the readings as well."


def verdict(level: Noise, blocks: Array, spread: float, n_alternatives: int, converged: bool) -> tuple[Verdict, str]:
    """The first that applies of NOT_CONVERGED, NOT_IDENTIFIABLE, MODEL_MISFIT, AMBIGUOUS, IDENTIFIED, and why."""
    if not converged:
        return Verdict.NOT_CONVERGED, "The fit did not settle on an answer."
    axis = np.sqrt(np.linalg.eigvalsh(blocks).max(axis=1))
    worst = int(np.argmax(axis))
    if not axis[worst] < UNIDENTIFIED_SD_SPREADS * spread:
        twice = f"{UNIDENTIFIED_SD_SPREADS:g} times the spread of {spread:.3g} m"
        far = (
            f"The readings do not tell where source {worst + 1} lies"
            if not axis[worst] <= 1e3 * spread
            else f"Source {worst + 1} is known to ± {axis[worst]:.3g} m only, more than {twice}"
        )
        return Verdict.NOT_IDENTIFIABLE, f"{far}: another leg that passes it in a new direction would help."
    if level.matters or (level.misfit and not axis[worst] < MISFIT_SURE_SPREADS * spread):
        return (
            Verdict.MODEL_MISFIT,
            f"Residuals are not noise: {100.0 * level.systematic_share:.2g} % of the readings' range is left "
            f"unexplained, {np.sqrt(level.inside / level.outside):.2g} times the noise; uncertainties are widened.",
        )
    widened = " Residuals are not white, so uncertainties are widened." if level.misfit else ""
    if n_alternatives:
        others = "one other solution" if n_alternatives == 1 else f"{n_alternatives} other solutions"
        return Verdict.AMBIGUOUS, f"By the readings, {others} cannot be ruled out.{widened}"
    return Verdict.IDENTIFIED, f"No other solution fits the readings as well.{widened}"


def unseen_in_words(info: Information, names: tuple[str, ...]) -> tuple[str, ...]:
    """Each direction the readings say nothing of, by the parameters that make it up."""
    sentences = []
    for column in info.unseen.T:
        order = np.argsort(-np.abs(column))
        sentences.append(in_plain_words([names[i] for i in order[:4] if abs(column[i]) > 0.2]))
    return tuple(sentences)


def in_plain_words(names: Sequence[str]) -> str:
    """Parameters as a pilot speaks of them: "the direction of leg 8, and where it begins"."""
    parts: dict[str, str] = {}
    before = ""
    for name in names:
        of, alone, again = _plain(name)
        if alone not in parts:
            parts[alone] = again if of and of == before else alone
            before = of
    *most, last = parts.values() or ("",)
    return f"{', '.join(most)}, and {last}" if most else last


def _plain(name: str) -> tuple[str, str, str]:
    """The leg or source that a parameter is of, and the words for it, on its own and where the same was spoken of."""
    for pattern, of, alone, again in _OF_ONE:
        if found := re.fullmatch(pattern, name):
            which = f"{of} {found[1]}"
            return which, alone.format(which), again
    words = _OF_ALL.get(name, name)
    return "", words, words
