"""What legs to come would leave of the alternatives: the error to expect from taking one answer for another."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.expected import Sensing
from dslam_mav.dslam.kernels.confusion import separations
from dslam_mav.dslam.layouts import Layouts, joined

Array = NDArray[np.float64]

APART_SPREADS = 0.15  # RMS over the sources: nearer ones are one answer, which the bound is for
LIKELIHOOD = 8.0  # over the noise, e^(−χ²/8) is what a wrong answer's weight comes to, by Bhattacharyya's bound


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """M answers, of which the first `true` may be true and any may be taken for true: where each believes the vehicle
    to be, its heading, its sources; `off2` (M, M) the mean squared error of taking j for i.
    """

    ends: Array
    heading: Array
    layouts: Layouts
    off2: Array
    true: int

    @classmethod
    def of(cls, vertices_m: Array, layouts: Layouts) -> Answers:
        """By paths (M, L+1, 2) and their sources."""
        last = vertices_m[:, -1] - vertices_m[:, -2]
        heading = np.arctan2(last[:, 1], last[:, 0])
        return cls(vertices_m[:, -1].copy(), heading, layouts, _off2(layouts.places), len(layouts))

    def beside(self, rivals: Answers) -> Answers:
        """With others that may be taken for true."""
        layouts = joined([self.layouts, rivals.layouts])
        ends, heading = np.concatenate([self.ends, rivals.ends]), np.concatenate([self.heading, rivals.heading])
        return Answers(ends, heading, layouts, _off2(layouts.places), self.true)

    def confusion_m2(self, turn_rad: Array, length_m: Array, sensing: Sensing) -> Array:
        """(true,) squared error to expect, were it true, from answers that fit as well after these legs."""
        lay = self.layouts
        other = self.off2 > (APART_SPREADS * lay.spread_m[:, None]) ** 2
        other[self.true :] = False
        chi2 = separations(
            self.ends, self.heading, lay.places, lay.peak, lay.spread_m**2, turn_rad, length_m,
            sensing.readings_per_m / sensing.noise_sd**2, other.astype(np.float64),
        )[: self.true]  # fmt: skip
        other, off2 = other[: self.true], self.off2[: self.true]
        weight = np.where(other, np.exp(-chi2 / LIKELIHOOD), 0.0)
        own = (~other).sum(axis=1)
        return np.asarray((weight * off2).sum(axis=1) / (own + weight.sum(axis=1)))


def _off2(places: Array) -> Array:
    """(M, M) mean squared distance of the sources of j from those of i, each beside the one it stands for."""
    k = places.shape[1]
    squares = ((places[:, None, :, None] - places[None, :, None, :]) ** 2).sum(axis=4)
    each = [squares[:, :, np.arange(k), list(order)].mean(axis=2) for order in permutations(range(k))]
    return np.asarray(np.min(each, axis=0))
