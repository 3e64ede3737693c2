"""Starts where no map in the plane exists: legs in space, and parametric paths.

As in starts.py the search runs at one C(t) for all sources. Where that is unknown, one round is made at each of a few,
the joint fit with C free is made from the best, and the search goes on at the C it found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam import curve, space
from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.fit import Fit, fit
from dslam_mav.dslam.joint import model_of
from dslam_mav.dslam.kernels.curve import Curve
from dslam_mav.dslam.path import climb_of_rise
from dslam_mav.dslam.problem import Problem, alike
from dslam_mav.dslam.rows import spans_constant
from dslam_mav.dslam.scale import Scale, spread_scale
from dslam_mav.dslam.space_corner import Legs
from dslam_mav.dslam.starts import GROWTHS, Starts, compressed, medium_grid, samples
from dslam_mav.dslam.state import State, climbs_unknown

Array = NDArray[np.float64]
Medium = tuple[float, float]  # (ln C, ln 4μ) at the first reading

REFINED = 3  # answers of each round fitted with C free
REFINING_ITERATIONS = 12
RIVALS = 3  # media tried again
SAME_LOG_SPREAD2 = 0.1
MOST_STARTS = 24
DIFFERENCES = 3  # of the readings, whose size is the noise's where readings are dense
NORMAL_MEDIAN = 0.4549  # of a squared standard normal number


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Answers at one C(t), best first, and what Starts tells of the residuals."""

    states: list[State]
    outside: tuple[float, int]
    freedom_inside: int


Search = Callable[[Medium, int], _Found]  # at a medium, so many rounds at most


def scatter(prob: Problem, k_sources: int, rng: np.random.Generator) -> Starts:
    """All that the search finds, best first, at the C that fits best."""
    bare = alike(prob)
    if bare.basis is not None:
        grid, most = _media_on_curve(bare), curve.MAX_ROUNDS
        found = _searched(bare, grid, lambda at, rounds: _on_curve(bare, k_sources, at, rounds, rng), most)
    else:
        scale = Scale(1.0, None)
        if bare.spread2 is None:
            scale = spread_scale(samples(bare, np.ones(bare.y.size)), bare.ambient is None)
        grid, most = medium_grid(bare, scale.squared_spread), space.MAX_ROUNDS
        found = _searched(
            bare, grid, lambda at, rounds: _in_space(bare, k_sources, (at, scale.sigma), rounds, rng), most
        )
    left = [float(((bare.y - model_of(bare, state)) ** 2).sum()) for state in found.states]
    level = min([x for x in left if np.isfinite(x)] or [float(bare.y @ bare.y)]) + bare.outside
    sigma = float(np.sqrt(level / max(bare.n_readings, 1)))
    return Starts(tuple(found.states), sigma, found.outside, found.freedom_inside, most)


def _searched(prob: Problem, grid: list[Medium], search: Search, most: int) -> _Found:
    if len(grid) == 1:
        found = search(grid[0], most)
        return replace(found, states=found.states[:MOST_STARTS])
    pool: list[Fit] = []
    media = grid
    for _ in range(2):
        for at in media:
            pool += _refined(prob, search(at, 1).states[:REFINED])
        pool.sort(key=lambda f: f.cost)
        media = _different(pool)[:RIVALS]
    found = search(media[0] if media else grid[len(grid) // 2], most)
    pool = sorted(_refined(prob, found.states[:MOST_STARTS]) + pool[:REFINED], key=lambda f: f.cost)
    return replace(found, states=[f.state for f in pool[:MOST_STARTS]])


def _refined(prob: Problem, states: list[State]) -> list[Fit]:
    fits = [fit(prob, state, iterations=REFINING_ITERATIONS) for state in states]
    return [f for f in fits if np.isfinite(f.cost)]


def _different(fits: list[Fit]) -> list[Medium]:
    """The media the answers ended with, best first, those alike told once."""
    media: list[Medium] = []
    for f in fits:
        at = float(f.state.log_spread2.mean()), f.state.log_rate
        if all(abs(at[0] - other[0]) > SAME_LOG_SPREAD2 for other in media):
            media.append(at)
    return media


def _in_space(
    prob: Problem, k_sources: int, medium: tuple[Medium, float | None], most: int, rng: np.random.Generator
) -> _Found:
    """Straight legs, climbs known or not."""
    at, sigma = medium
    comp = compressed(prob, at, sigma)
    known = None if climbs_unknown(prob) else np.sin(climb_of_rise(prob))
    maps = space.search_in_space(Legs(comp, known), k_sources, rng, most)
    to_amplitude = np.log(comp.sigma) + 1.5 * np.log(np.pi * comp.scale**2)
    states = []
    for c, s, alpha in zip(maps.path, maps.s * comp.scale, maps.alpha + to_amplitude, strict=True):
        turn = _canonical_turn(prob, c)
        along = c @ turn.T
        climb = climb_of_rise(prob) if known is not None else np.arcsin(np.clip(along[:, 2], -1.0, 1.0))
        climb[:2] *= known is not None  # the first two legs lie in the plane z = 0
        state = State.flat(prob, np.arctan2(along[:, 1], along[:, 0]), s @ turn.T, alpha, at[0])
        states.append(_levelled(prob, replace(state, climb=climb, log_rate=at[1])))
    return _Found(states, (comp.energy_out, comp.dof_out), int(comp.rank.sum()))


def _canonical_turn(prob: Problem, c: Array) -> Array:
    """The rotation (3, 3) of directions c (L, 3) into the fit's frame: the first leg's heading 0, upright where climbs
    are known, otherwise the canonical gauge.
    """
    if climbs_unknown(prob):
        return to_canonical(np.vstack([np.zeros(3), np.cumsum(prob.length[:, None] * c, axis=0)])).rotation
    heading = np.arctan2(c[0, 1], c[0, 0])
    cos, sin = np.cos(heading), np.sin(heading)
    return np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


def _levelled(prob: Problem, state: State) -> State:
    """With the ambient level that suits it, where that is unknown."""
    if prob.ambient is not None:
        return state
    return replace(state, ambient=float((prob.y - model_of(prob, state)).mean()))


def _media_on_curve(prob: Problem) -> list[Medium]:
    """As starts.medium_grid; nothing but C has a length here, so that only the field's growth matters."""
    fixed = -np.inf if prob.rate is None or prob.rate == 0.0 else float(np.log(prob.rate))
    if prob.spread2 is not None:
        return [(float(np.log(prob.spread2).mean()), fixed)]
    if prob.rate == 0.0:
        return [(0.0, fixed)]
    if prob.age is not None:
        log_age = float(np.log(prob.age).mean())
        return [(0.0, -log_age)] if prob.rate is None else [(fixed + log_age, fixed)]
    growths = np.log(np.array(GROWTHS) / max(float(prob.t[-1]), 1e-9))
    return [(0.0, float(g)) if prob.rate is None else (fixed - float(g), fixed) for g in growths]


def _on_curve(prob: Problem, k_sources: int, at: Medium, most: int, rng: np.random.Generator) -> _Found:
    """A parametric path, of which the functions are known."""
    assert prob.basis is not None
    d, spread2 = prob.dimensions, np.exp(at[0]) + np.exp(at[1]) * prob.t
    unit = float(np.sqrt(spread2.mean()))
    phi, made_of = curve.independent(prob.basis)
    y = prob.y - (prob.ambient or 0.0)
    step = np.diff(y, DIFFERENCES) ** 2 / 20.0  # the binomial coefficients' squares add up to 20
    sigma = max(float(np.sqrt(np.median(step) / NORMAL_MEDIAN)), 1e-6 * float(np.abs(y).max()))
    block = -(-y.size // curve.MOST_READINGS)
    parts = np.arange(0, y.size, block)
    count = np.diff(np.append(parts, y.size))
    mean = [np.add.reduceat(values, parts, axis=0).T / count for values in (phi, y[:, None], spread2[:, None])]
    sigma /= np.sqrt(block)
    peak = float(np.log(max(np.ptp(mean[1]), 1e-300) / sigma))
    reduced = Curve(mean[0].copy(), mean[1][0] / sigma, mean[2][0] / unit**2, prob.ambient is None, peak)
    found = curve.search_on_curve(reduced, k_sources, d, rng, most)
    states = []
    for c, s, alpha, level in zip(found.path, found.s, found.alpha, found.level, strict=True):
        terms, places = _in_gauge(prob.basis, unit * made_of @ c, unit * s)
        log_a = alpha + np.log(sigma) + 0.5 * d * np.log(np.pi * unit**2)
        state = State.flat(prob, np.zeros(0), places, log_a, at[0])
        ambient = float(level) * sigma if prob.ambient is None else prob.ambient
        states.append(replace(state, coefficients=terms, log_rate=at[1], ambient=ambient))
    return _Found(states, (0.0, 0), prob.n_readings)


def _in_gauge(basis: Array, terms: Array, s: Array) -> tuple[Array, Array]:
    """Coefficients (P, d) and sources (K, d) turned so that the first chord lies along +x, in space with the bend to
    mid-way in the plane z = 0; where a constant is spanned, the path begins at the origin.
    """
    if spans_constant(basis):
        weights = np.linalg.lstsq(basis, np.ones(len(basis)), rcond=None)[0]
        terms = terms - np.outer(weights, basis[0] @ terms)
    ways = np.array([basis[1] - basis[0], basis[len(basis) // 2] - basis[0]]) @ terms
    axes, upper = np.linalg.qr(ways.T, mode="complete")
    signs = np.ones(terms.shape[1])
    signs[: min(upper.shape)] = np.where(np.diag(upper) < 0.0, -1.0, 1.0)
    turn = axes * signs
    return terms @ turn, s @ turn
