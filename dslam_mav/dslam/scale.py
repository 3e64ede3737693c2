"""How wide, roughly, the sources have spread: where the search for an unknown C begins.

Along a line one source leaves f = A e^{−(s−Y)²/C}, for which ∫f² / ∫f′² = C. Several sources beside each other, or a
flank alone, make the ratio smaller than C, by up to a factor ten, seldom larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.compress import MARGIN_SPREADS, Samples, basis_of, curves

Array = NDArray[np.float64]

WIDEST = 1.5  # √C of the first basis tried, in legs; each next has half its C
NARROWEST_SPACINGS = 3.0  # √C of the last, in readings' spacings
MOST_SPREADS = 30.0  # √C in the longest leg: beyond that no mission sees enough
MOST_STEPS = 16
NODE_STEP_SPREADS = 0.4
MIN_FREEDOM = 0.1  # share of the readings a noise estimate must rest on
FITS = 1.3  # a basis fits whose left-over is within this of the best, beyond its own scatter
RIDGE = 1e-4
SAME = 1e-6

Group = tuple[Samples, Array]  # a leg, and the readings (N, M) of all M legs read like it


@dataclass(frozen=True, slots=True)
class Scale:
    """`squared_spread`: ∫f²/∫f′² over all legs; `sigma`: the readings' noise, None where too few are left over."""

    squared_spread: float
    sigma: float | None


def spread_scale(legs: Sequence[Samples], ambient_unknown: bool) -> Scale:
    """Fit every leg by the widest curves that still fit it, and measure how fast the fit changes."""
    longest = max(leg.length for leg in legs)
    spacing = float(np.median(np.concatenate([np.diff(np.sort(leg.distance)) for leg in legs])))
    narrowest = max(NARROWEST_SPACINGS * spacing, longest / MOST_SPREADS)
    steps = [(WIDEST * longest) ** 2 / 2.0**i for i in range(MOST_STEPS)]
    steps = [c for c in steps if c >= narrowest**2] or steps[:1]
    groups = _grouped(legs)
    left = [_left_over(groups, c, ambient_unknown) for c in steps]
    count = sum(leg.reading.size for leg in legs)
    usable = [i for i, (_, freedom) in enumerate(left) if freedom >= max(20.0, MIN_FREEDOM * count)]
    if not usable:
        return Scale(_ratio(groups, steps[-1]), None)
    variance = {i: left[i][0] / left[i][1] for i in usable}
    lowest = min(variance.values())
    fitting = [i for i in usable if variance[i] <= lowest * (FITS + 3.0 * np.sqrt(2.0 / left[i][1]))]
    sigma = float(np.sqrt(left[usable[-1]][0] / left[usable[-1]][1]))
    return Scale(_ratio(groups, steps[fitting[0]]), sigma)


def _nodes(leg: Samples, c: float) -> Array:
    margin = MARGIN_SPREADS * float(np.sqrt(c))
    return np.arange(-margin, leg.length + margin, NODE_STEP_SPREADS * float(np.sqrt(c)))


def _at(leg: Samples, c: float) -> Samples:
    return Samples(leg.length, leg.distance, leg.reading, np.full(leg.reading.size, c))


def _left_over(groups: Sequence[Group], c: float, ambient_unknown: bool) -> tuple[float, int]:
    """Energy and freedom beyond the span of curves of this C."""
    energy, freedom = 0.0, 0
    for leg, readings in groups:
        basis = basis_of(curves(_at(leg, c), _nodes(leg, c), c, ambient_unknown)[0])
        seen = readings - readings.mean(axis=0) if ambient_unknown else readings
        left = seen - basis @ (basis.T @ seen)
        energy += float((left**2).sum())
        freedom += max(len(readings) - basis.shape[1] - int(ambient_unknown), 0) * readings.shape[1]
    return energy, freedom


def _ratio(groups: Sequence[Group], c: float) -> float:
    """∫f²/∫f′² of the fit by curves of this C, what is constant over a leg taken out."""
    square = slope = 0.0
    for leg, readings in groups:
        value, by_centre = curves(_at(leg, c), _nodes(leg, c), c, True)
        gram = value.T @ value
        gram[np.diag_indices_from(gram)] += RIDGE * np.trace(gram) / len(gram)
        weights = np.linalg.lstsq(gram, value.T @ (readings - readings.mean(axis=0)), rcond=None)[0]
        square += float(((value @ weights) ** 2).sum())
        slope += float(((by_centre @ weights) ** 2).sum())
    return square / slope if slope > 0.0 else c


def _grouped(legs: Sequence[Samples]) -> list[Group]:
    """Legs read at the same distances, to one part in a million, together: what they span is worked out once."""
    groups: list[tuple[Samples, list[Array]]] = []
    for leg in legs:
        for other, readings in groups:
            alike = other.distance.size == leg.distance.size and abs(other.length - leg.length) < SAME * leg.length
            if alike and np.abs(other.distance - leg.distance).max() < SAME * leg.length:
                readings.append(leg.reading)
                break
        else:
            groups.append((leg, [leg.reading]))
    return [(leg, np.stack(readings, axis=1)) for leg, readings in groups]
