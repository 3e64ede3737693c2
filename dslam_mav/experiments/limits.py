"""The Cramér–Rao bound in the paper's errors: what an efficient estimator's would be on average."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipe

from dslam_mav.dslam import predict
from dslam_mav.dslam.bound import information
from dslam_mav.dslam.joint import evaluate
from dslam_mav.dslam.paper.gaussians import Gaussians, assess
from dslam_mav.dslam.path import path_columns
from dslam_mav.dslam.predict import Bound, bound
from dslam_mav.dslam.state import layout
from dslam_mav.experiments.world import World
from dslam_mav.records import Medium, Sources

Array = NDArray[np.float64]

STEPS = 32  # along a leg


def flight_bound(world: World, *, unknown: bool = False) -> Bound:
    """The bound of a flight over `world`, activation times known, or (`unknown`) one unknown each."""
    medium, sources, readings = _asked(world, unknown)
    return bound(
        world.truth.vertices_m,
        sources,
        medium,
        readings_per_leg=readings,
        speed_m_s=world.speed_m_s,
        noise_sd=world.noise_sd,
    )


def expected_errors(world: World, *, unknown: bool = False) -> dict[str, float]:
    """E_sources and E_lines of errors that are Gaussian with the bound's covariance (plane only)."""
    truth, b = world.truth, world.truth.vertices_m
    mean = _mean_norm(flight_bound(world, unknown=unknown).position_covariance_m2)
    covariance = _path_covariance(world, unknown)
    lines = []
    for j in range(len(b) - 1):
        for s in (np.arange(STEPS) + 0.5) / STEPS:
            here = covariance[j : j + 2, :, j : j + 2, :]
            weight = np.array([1.0 - s, s])
            at = np.einsum("a,aibj,b->ij", weight, here, weight)
            lines.append(_mean_norm(at[None])[0] / np.linalg.norm(b[j] + s * (b[j + 1] - b[j])))
    return {
        "E_sources": float((mean / np.linalg.norm(truth.source_position_m, axis=1)).mean()),
        "E_lines": float(np.mean(lines)),
    }


def _mean_norm(covariance: Array) -> Array:
    """(M,) E|x| of Gaussian x with covariances (M, 2, 2)."""
    least, most = np.linalg.eigvalsh(covariance).clip(min=0.0).T
    share = np.divide(least, most, out=np.ones_like(most), where=most > 0.0)
    return np.asarray(np.sqrt(2.0 * most / np.pi) * ellipe(1.0 - share))


def _path_covariance(world: World, unknown: bool) -> Array:
    """(L+1, 2, L+1, 2) of the vertices together, in the first leg's gauge; `bound` tells them one by one only."""
    truth, (medium, sources, readings) = world.truth, _asked(world, unknown)
    prob = predict._unread(np.diff(truth.vertices_m, axis=0), medium, readings, world.speed_m_s)
    state = predict._truth(prob, truth.vertices_m, sources, medium)
    at = layout(prob, len(sources))
    covariance = information(evaluate(prob, state, at)[1], world.noise_sd**2).covariance
    columns = path_columns(prob, state, at)
    return np.asarray(np.einsum("aip,pq,bjq->aibj", columns, covariance, columns))


def _asked(world: World, unknown: bool) -> tuple[Medium, Sources, int]:
    """What the bound is asked: medium, sources in flight time, readings a leg."""
    sources = replace(world.sources, activation_s=world.sources.activation_s - world.start_s)
    times = None if unknown else tuple(sources.activation_s.tolist())
    lengths = np.linalg.norm(np.diff(world.truth.vertices_m, axis=0), axis=1)
    return replace(world.medium, activation_s=times), sources, round(float(lengths.mean()) / world.spacing_m)


def first_leg(world: World) -> tuple[Array, Array]:
    """(Y_k1 (K,), d²_k1 (K,)) of the true sources on the first leg (4)."""
    b = world.truth.vertices_m
    c = (b[1] - b[0]) / np.linalg.norm(b[1] - b[0])
    off = world.truth.source_position_m - b[0]
    y = off @ c
    return np.asarray(y), np.asarray((off**2).sum(axis=1) - y**2)


def line_bound(world: World) -> float:
    """RMS over the sources of the bound on Y_k1 from the first leg's readings alone, its spread known (static)."""
    y, d2 = first_leg(world)
    c = world.sources.squared_spread_m2
    height = world.sources.peak_reading * np.exp(-d2 / c)
    b = world.truth.vertices_m
    count = round(float(np.linalg.norm(b[1] - b[0])) / world.spacing_m)
    s = world.spacing_m * np.arange(count, dtype=np.float64)
    fit = assess(s, np.zeros_like(s), Gaussians(y, height, c))
    return float(world.noise_sd * np.sqrt(np.diag(fit.covariance)[: len(y)].mean()))


def flight_line_bound(world: World, *, relative: bool = False) -> float:
    """The same from all legs' readings together; or (`relative`) each source's over its Y_k1."""
    b = world.truth.vertices_m
    c = (b[1] - b[0]) / np.linalg.norm(b[1] - b[0])
    along = np.einsum("i,kij,j->k", c, flight_bound(world).position_covariance_m2, c)
    size = first_leg(world)[0] if relative else 1.0
    return float(np.sqrt((along / size**2).mean()))
