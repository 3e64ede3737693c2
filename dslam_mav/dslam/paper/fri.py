"""III-A: one leg's readings -> centres Y_kj and heights A_kj (Appendices A and B), and how many (Remark 4).

With π and C kept: f_j(s) = Σ_k A_kj exp(−(s − Y_kj)²/C)   (3). Centres may lie beyond either end of the leg.
"""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.paper import prony, samples
from dslam_mav.dslam.paper.gaussians import Gaussians, LegFit, assess, heights, polish
from dslam_mav.dslam.paper.logarithms import ROUNDING, fit_leg, logarithms
from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.records.words import count

Array = NDArray[np.float64]

FREE_OF_NOISE = 1e-7  # share of the leg's largest reading
FAINT = 1e-13  # floor of the noise, as a share of the largest reading: rounding
HIGHEST_OMEGA, LOWEST_OMEGA = 5.0, 2.5  # rad per √C
LEAST_SHARE_SEEN = 0.05  # of the largest sample, that the highest frequency must still show above the noise
OTHER_OMEGAS = (1.0, 0.75, 1.3)  # shares of ω_0 that "auto" tries too
# Noise "auto" also reckons with, as a share of the largest reading: a field that is not quite this sum (IV-A).
DOUBTS = (1e-3, 1e-2)
RANK_SDS = 2.0


class LegView(NamedTuple):
    """One leg as the step sees it: distances s (N,), readings (N,), C, noise sd, largest reading, centres in reach.

    `offset`: the ambient level that was taken off, whose rounding the readings carry.
    """

    s: Array
    reading: Array
    c: float
    noise: float
    largest: float
    reach: samples.Span
    offset: float

    @property
    def noise_share(self) -> float:
        """Noise sd over the largest reading, never below rounding."""
        share = self.noise / self.largest if self.largest > 0.0 else 1.0
        return max(share, FAINT) if np.isfinite(share) else 1e-3


class LegCentres(NamedTuple):
    """One leg's answer, how it was found in a word, and the noise variance its covariance is scaled with."""

    fit: LegFit
    how: str
    variance: float


def view(s: Array, reading: Array, length: float, c: float, options: PaperOptions, offset: float = 0.0) -> LegView:
    """A leg with its noise, measured outside what sums of Gaussians can carry."""
    reach = samples.span(s, c, samples.interval(s, length, c, options.fit_margin))
    noise = samples.noise_outside(reading, reach)
    return LegView(s, reading, c, noise, float(np.abs(reading).max()), reach, offset)


def centres(leg: LegView, k: int, options: PaperOptions) -> LegCentres | str:
    """K centres and heights of a leg; a sentence where it has none.

    Exact samples need even spacing: other legs take robust ones, whose weights are made for the actual distances.
    """
    if leg.s.size < 2 * k:
        return f"{count(leg.s.size, 'reading')} for {count(k, 'centre')}: Prony needs {2 * k}."
    if not leg.largest > 0.0:
        return "no reading differs from the ambient level."
    even = samples.spacing(leg.s) is not None
    quiet = leg.noise_share < FREE_OF_NOISE
    if quiet and options.polish and options.samples != "robust":
        rounded = to_rounding(leg, k, _first(leg, k, options) if even else [])
        if rounded is not None:
            return rounded
    found: list[LegCentres] = []
    if even and (options.samples == "exact" or (options.samples == "auto" and quiet)):
        found.append(_finished(leg, "exact", exact_centres(leg, k, options), options))
        if options.samples == "exact" or _to_the_noise(leg, found[0]):
            return found[0] if _stands(found[0]) else f"no {k} centres with positive heights fit it."
    for doubt in (0.0, *DOUBTS) if options.samples == "auto" else (0.0,):
        doubted = leg._replace(noise=max(leg.noise, doubt * leg.largest))
        for share in OTHER_OMEGAS if options.samples == "auto" else (1.0,):
            y = robust_centres(doubted, k, share * _omega_0(doubted, options), options)
            found.append(_finished(leg, "robust", y, options))
        if any(_to_the_noise(leg, f) for f in found):
            break
    standing = [f for f in found if _stands(f)]
    return min(standing, key=lambda f: f.fit.cost) if standing else f"no {k} centres with positive heights fit it."


def _first(leg: LegView, k: int, options: PaperOptions) -> list[Array]:
    """Centres by the filter, and the same fitted to the readings as they are."""
    y = exact_centres(leg, k, options)
    return [y, _finished(leg, "exact", y, options).fit.gaussians.y]


def to_rounding(leg: LegView, k: int, first: list[Array]) -> LegCentres | None:
    """K centres and heights that leave nothing of a leg but rounding, if there are such. `first`: tried first."""
    ln = logarithms(leg.s, leg.reading, leg.offset)
    fit = fit_leg(ln, k, leg.c, leg.reach.ends, [np.clip(y, *leg.reach.ends) for y in first])
    if fit is None:
        return None
    return _ordered(fit, "logarithms", max(fit.cost / max(ln.s.size - 2 * k, 1), ROUNDING**2))


def _stands(found: LegCentres) -> bool:
    return bool(np.isfinite(found.fit.cost) and (found.fit.gaussians.a > 0.0).all())


def _to_the_noise(leg: LegView, found: LegCentres) -> bool:
    """Whether the fit leaves no more than the leg's noise."""
    return _stands(found) and found.fit.cost <= leg.s.size * (4.0 * leg.noise_share * leg.largest) ** 2


def exact_centres(leg: LegView, k: int, options: PaperOptions) -> Array:
    """(K,) centres by Prony on y e^{s²/C}: every `stride`-th sample, so that its nodes are far apart."""
    weighted, origin = samples.exact(leg.s, leg.reading, leg.c)
    step = (leg.s[-1] - leg.s[0]) / (leg.s.size - 1)
    stride = max(1, leg.s.size // (2 * k + 1))
    u = prony.nodes(prony.strided_matrix(weighted.astype(np.complex128), k + 1, stride), k, options.solver)
    return np.asarray(origin + leg.c * np.log(np.maximum(np.abs(u), 1e-300)) / (2.0 * stride * step))


def robust_centres(leg: LegView, k: int, omega_0: float, options: PaperOptions) -> Array:
    """(K,) centres by Prony on the robust samples, denoised."""
    s_m = _robust(leg, k, omega_0)
    clean = prony.cadzow(s_m.samples, k, options.denoise)
    width = len(clean) // 2 + 1 if options.solver == "pencil" else k + 1
    u = prony.nodes(prony.toeplitz_matrix(clean, width), k, options.solver)
    step = s_m.omega[1] - s_m.omega[0]  # u_k = e^{j step (Y_k − origin)}
    return np.asarray(np.clip(s_m.origin + np.angle(u) / step, *leg.reach.ends))


def _robust(leg: LegView, k: int, omega_0: float) -> samples.Robust:
    count = samples.moments_for(k, omega_0, leg.reach.ends)
    omega = omega_0 * (1.0 - 2.0 * np.arange(count) / (count - 1))  # below (17), with M − 1 for 2K − 1
    return samples.robust(leg.s, leg.reading, leg.reach, omega, leg.noise_share)


def _omega_0(leg: LegView, options: PaperOptions) -> float:
    """rad/m: the frequency at which the Gaussian's own transform e^{−ω²C/4} has sunk to the noise."""
    if options.omega_0 is not None:
        return float(options.omega_0 / np.sqrt(leg.c))
    seen = max(LEAST_SHARE_SEEN / leg.noise_share, 1.0 + 1e-9)
    return float(np.clip(2.0 * np.sqrt(np.log(seen)), LOWEST_OMEGA, HIGHEST_OMEGA) / np.sqrt(leg.c))


def _finished(leg: LegView, how: str, y: Array, options: PaperOptions) -> LegCentres:
    c = np.full(len(y), leg.c)
    y = np.clip(y, *leg.reach.ends)
    start = Gaussians(y, heights(leg.s, leg.reading, y, c), c)
    fit = assess(leg.s, leg.reading, start) if options.samples == "robust" else polish(leg.s, leg.reading, start)
    return _ordered(fit, how, max(fit.cost / max(leg.s.size - 2 * len(y), 1), (FAINT * leg.largest) ** 2))


def _ordered(fit: LegFit, how: str, variance: float) -> LegCentres:
    order = np.argsort(fit.gaussians.y, kind="stable")
    g = Gaussians(*(part[order] for part in fit.gaussians))
    both = np.concatenate((order, order + len(order)))
    return LegCentres(fit._replace(gaussians=g, covariance=fit.covariance[np.ix_(both, both)]), how, variance)


def count_on(leg: LegView, most: int, options: PaperOptions) -> int:
    """Remark 4: the rank of the Toeplitz matrix of a leg's samples, at most `most`.

    PAPER DEVIATION: the paper scans exact samples for a matrix of 2K + 1 of them with rank K; with a spacing far below
    √C all such matrices have rank 1 to rounding. One wide matrix of robust samples tells the same rank, and its
    singular values are told from those of the noise by the noise's own size.
    """
    if not leg.largest > 0.0:
        return 0
    s_m = _robust(leg, most, _omega_0(leg, options))
    matrix = prony.toeplitz_matrix(s_m.samples, len(s_m.samples) // 2 + 1)
    values = np.linalg.svd(matrix, compute_uv=False)
    rows, columns = matrix.shape
    doubt = np.sqrt((leg.noise_share * leg.largest * s_m.sd) ** 2 + (s_m.miss * leg.largest) ** 2)
    # Norm of a matrix of independent numbers of this size: (√rows + √columns) × their sd.
    floor = RANK_SDS * float(np.sqrt(np.mean(doubt**2))) * (np.sqrt(rows) + np.sqrt(columns))
    return int(min((values > floor).sum(), most))


def counts(legs: list[LegView], most: int, options: PaperOptions) -> list[int]:
    """Numbers of sources to try, in order.

    First, of legs without noise, every number that leaves nothing but rounding of one of them, the smallest first: a
    leg can miss sources. Last what most legs vote for by rank; of equal votes the larger, for the same reason.
    """
    exact: set[int] = set()
    if options.polish and options.samples != "robust":
        quiet = [leg for leg in legs if leg.noise_share < FREE_OF_NOISE and leg.largest > 0.0]
        exact = {k for leg in quiet if (k := _fewest(leg, most)) is not None}
    votes = Counter(count_on(leg, most, options) for leg in legs)
    voted = max(votes, key=lambda k: (votes[k], k)) if votes else 0
    return [*sorted(exact), *([] if voted in exact else [voted])]


def _fewest(leg: LegView, most: int) -> int | None:
    """The smallest number of centres that leaves nothing of a leg but rounding."""
    return next((k for k in range(1, most + 1) if to_rounding(leg, k, []) is not None), None)
