"""Starts along a parametric path r = Σ_i c_i φ_i (IV-C, Table I rows 4, 5): algebra in many variants, and drawn.

Where source k alone is read, with C known at every reading,

    −C ln(f C^{d/2}) = Σ_ij φ_i φ_j c_iᵀc_j − 2 Σ_i φ_i c_iᵀS_k + |S_k|² − C α_k

is linear in inner products of the unknowns; the Gram matrix c_iᵀc_j, of rank d, gives the c_i up to a turn. Which
readings are one source's is not known: the flight falls into stretches between the minima of its readings, each given
to one source or to none at random. Every start, and some paths drawn outright, race in the fit on all readings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.kernels.curve import Curve, fit_on_curve
from dslam_mav.dslam.rounds import Candidates, best, joined, searched

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MOST_READINGS = 512  # the race is run on; neighbours are averaged
DRAWN = 400
SOLVED = 60
MAX_ROUNDS = 12
PATH_SPREADS = 1.5
OFFSET_SPREADS = 0.6
HEATS = ((8, 150), (15, 50), (40, 24))  # iterations, and how many go on
SPAN = 1e-9  # share of the largest singular value below which functions are dependent
SMOOTH = 0.01  # of the flight: stretches begin where readings so smoothed are least
FAINT = 0.03  # of the largest reading: stretches below it are no source's
MUCH = 1e6
NOISE = 1.35  # χ² per reading that noise, itself only estimated, may explain


def independent(basis: Array) -> tuple[Array, Array]:
    """Functions (N, r) that are independent and zero at first where a shift is open, and how the known ones make them:
    (P, r). Their mean square is 1.
    """
    ones = np.ones(len(basis))
    constant = np.linalg.lstsq(basis, ones, rcond=SPAN)[0]
    moved = basis - basis[0] if np.abs(basis @ constant - ones).max() < 1e-9 else basis
    left, values, right = np.linalg.svd(moved, full_matrices=False)
    rank = int((values > SPAN * max(float(values[0]), 1e-300)).sum())
    size = np.sqrt(len(basis))
    return left[:, :rank] * size, right[:rank].T / values[:rank] * size


def search_on_curve(curve: Curve, k_sources: int, d: int, rng: np.random.Generator, most: int) -> Candidates:
    """Distinct minima, best first; coefficients (M, r, d) over the functions of `curve`."""
    return searched(lambda _: _round(curve, k_sources, d, rng), _marks, most, NOISE * curve.y.size)


def _round(curve: Curve, k_sources: int, d: int, rng: np.random.Generator) -> Candidates:
    """The best distinct minima of one race, from starts drawn and solved."""
    pool = joined(_drawn(curve, k_sources, d, rng), _solved(curve, k_sources, d, rng))
    for iterations, keep in HEATS:
        c, s, alpha, level = pool.path.copy(), pool.s.copy(), pool.alpha[:, :, None].copy(), pool.level.copy()
        cost = fit_on_curve(curve, c, s, alpha, level, iterations)
        pool = best(Candidates(c, s, alpha[:, :, 0], level, cost), _marks, keep)
    return pool


def _marks(pool: Candidates) -> Array:
    """What no turn and no mirror image changes."""
    rank = np.argsort(-pool.alpha, axis=1)
    points = np.concatenate([pool.path, np.take_along_axis(pool.s, rank[:, :, None], axis=1)], axis=1)
    return np.asarray(np.einsum("map,mbp->mab", points, points))


def _drawn(curve: Curve, k_sources: int, d: int, rng: np.random.Generator) -> Candidates:
    """Paths drawn outright, with sources where the signal is."""
    terms, n = curve.phi.shape
    spread = float(np.sqrt(curve.spread2.mean()))
    c = PATH_SPREADS * spread * rng.standard_normal((DRAWN, terms, d)) / np.sqrt(terms)
    level = np.full(DRAWN, float(np.quantile(curve.y, 0.02)) if curve.ambient else 0.0)
    signal = np.maximum(curve.y - level[0], 0.0)
    seen = rng.choice(n, size=(DRAWN, k_sources), p=(signal**2 + 1e-12) / (signal**2 + 1e-12).sum())
    offset = OFFSET_SPREADS * spread * rng.standard_normal((DRAWN, k_sources, d))
    s = np.einsum("mpd,pmk->mkd", c, curve.phi[:, seen]) + offset
    alpha = np.log(np.maximum(signal[seen], 1e-3)) + (offset**2).sum(axis=2) / spread**2 + d * np.log(spread)
    return Candidates(c, s, alpha, level, np.zeros(DRAWN))


def _stretches(signal: Array) -> list[Indices]:
    """Readings between one minimum and the next, the strongest first."""
    width = max(int(SMOOTH * signal.size), 1)
    kernel = np.ones(2 * width + 1) / (2 * width + 1)
    smooth = np.convolve(np.pad(signal, width, mode="edge"), kernel, mode="valid")
    inner = np.flatnonzero((smooth[1:-1] <= smooth[:-2]) & (smooth[1:-1] < smooth[2:])) + 1
    parts = np.split(np.arange(signal.size), inner)
    parts = [part for part in parts if signal[part].max() > FAINT * signal.max()]
    return sorted(parts, key=lambda part: -float(signal[part].max()))


def _solved(curve: Curve, k_sources: int, d: int, rng: np.random.Generator) -> Candidates:
    """The algebra's answers, every stretch of readings given to one source or to none."""
    level = float(np.quantile(curve.y, 0.02)) if curve.ambient else 0.0
    signal = np.maximum(curve.y - level, 1e-300)
    parts = _stretches(signal)
    terms = curve.phi.shape[0]
    shape = (SOLVED, terms, d)
    c, s, alpha = np.zeros(shape), np.zeros((SOLVED, k_sources, d)), np.zeros((SOLVED, k_sources))
    good = np.zeros(SOLVED, dtype=bool)
    for m in range(SOLVED):
        owner = rng.integers(-1, k_sources, len(parts))
        if len(parts) >= k_sources:
            owner[rng.permutation(min(len(parts), k_sources + 1))[:k_sources]] = rng.permutation(k_sources)
        share = rng.uniform(0.15, 0.7)
        loud = [part[signal[part] > share * signal[part].max()] for part in parts]
        given = [[part for part, o in zip(loud, owner, strict=True) if o == k] for k in range(k_sources)]
        if not all(given):
            continue
        own = [np.concatenate(mine) for mine in given]
        good[m] = _regressed(curve, signal, own, c[m], s[m], alpha[m])
    found = Candidates(c, s, alpha, np.full(SOLVED, level), np.zeros(SOLVED))
    return found.take(np.flatnonzero(good))


def _regressed(curve: Curve, signal: Array, own: list[Indices], c: Array, s: Array, alpha: Array) -> bool:
    """Coefficients c (r, d), S (K, d) and α (K,) from the readings `own` of each source alone."""
    (terms, d), k_sources = c.shape, len(own)
    i, j = np.triu_indices(terms)
    n_gram = i.size
    seen = np.concatenate(own)
    phi, spread2 = curve.phi[:, seen].T, curve.spread2[seen]
    matrix = np.zeros((seen.size, n_gram + k_sources * (terms + 2)))
    matrix[:, :n_gram] = phi[:, i] * phi[:, j] * np.where(i == j, 1.0, 2.0)
    begin = 0
    for k, part in enumerate(own):
        rows, at = slice(begin, begin + part.size), n_gram + k * (terms + 1)
        matrix[rows, at : at + terms] = -2.0 * phi[rows]
        matrix[rows, at + terms] = 1.0
        begin += part.size
    matrix = matrix[:, : n_gram + k_sources * (terms + 1)]
    weight = signal[seen] / spread2
    right = -spread2 * np.log(signal[seen] * spread2 ** (0.5 * d))
    size = np.linalg.norm(matrix * weight[:, None], axis=0)
    x = np.linalg.lstsq(matrix * weight[:, None] / size, right * weight, rcond=1e-7)[0] / size
    gram = np.zeros((terms, terms))
    gram[i, j] = gram[j, i] = x[:n_gram]
    values, axes = np.linalg.eigh(gram)
    c[:, : min(d, terms)] = (axes[:, -d:] * np.sqrt(np.maximum(values[-d:], 1e-6)))[:, ::-1]
    by_source = x[n_gram:].reshape(k_sources, terms + 1)
    s[:] = np.linalg.lstsq(c, by_source[:, :terms].T, rcond=1e-6)[0].T
    alpha[:] = ((s**2).sum(axis=1) - by_source[:, terms]) / float(spread2.mean())
    return bool(np.isfinite(c).all() and np.isfinite(s).all() and np.abs(s).max() < MUCH and np.abs(alpha).max() < MUCH)
