"""Flights over known scenes for the tests of the paper's steps; lengths in √C unless a spread is given."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from dslam_mav import Flight, Leg
from dslam_mav.dslam.paper.layout import Projections
from missions.patterns import from_turns


def fly(path, position, amplitude, c=1.0, n=64, noise=0.0, rng=None, speed=1.0, closed=False):
    """A flight along `path` (L+1, d); `c`: C (K,) or a function of time that gives it."""
    path, position = np.asarray(path, float), np.asarray(position, float)
    d, begun, legs, clean = path.shape[1], 0.0, [], []
    for a, b in pairwise(path):
        length = float(np.linalg.norm(b - a))
        s = length * np.arange(n) / n
        t = begun + s / speed
        begun += length / speed
        spread2 = np.array([np.broadcast_to(c(x) if callable(c) else c, len(position)) for x in t])
        away2 = (((a + s[:, None] * (b - a) / length)[:, None] - position) ** 2).sum(axis=2)
        clean.append((np.asarray(amplitude) * (np.pi * spread2) ** (-d / 2) * np.exp(-away2 / spread2)).sum(axis=1))
        legs.append((length, s, t))
    sd = noise * np.abs(np.concatenate(clean)).max()
    flown = [
        Leg(length, s, t, y + (sd * rng.standard_normal(n) if noise else 0.0))
        for (length, s, t), y in zip(legs, clean, strict=True)
    ]
    return Flight(tuple(flown), closed=closed)


def projections(path, position, amplitude, c=1.0):
    """Exact Y, A of a scene, straight from their definitions (4), (3)."""
    path, position = np.asarray(path, float), np.asarray(position, float)
    step = np.diff(path, axis=0)
    length = np.linalg.norm(step, axis=1)
    direction = step / length[:, None]
    to_source = position[:, None] - path[:-1][None]
    y = np.einsum("kjd,jd->kj", to_source, direction)
    d, full = path.shape[1], np.full(y.shape, c)
    a = np.asarray(amplitude)[:, None] * (np.pi * c) ** (-d / 2) * np.exp(-((to_source**2).sum(axis=2) - y**2) / c)
    tiny = np.full(y.shape, 1e-30)
    return Projections(y, a, full, tiny, tiny, np.full(len(y), c), length, d)


def pairwise_distances(*points):
    """All distances between points: what no gauge changes."""
    x = np.vstack(points)
    return np.linalg.norm(x[:, None] - x[None], axis=2)


def seen_error(estimate, path, position, amplitude):
    """How far distances between vertices and sources, and amplitudes (relative), are off, whatever the gauge."""
    order = np.argsort(-np.asarray(amplitude))
    position, amplitude = np.asarray(position, float)[order], np.asarray(amplitude)[order]
    off = pairwise_distances(estimate.path.vertices_m, estimate.sources.position_m) - pairwise_distances(path, position)
    return max(np.abs(off).max(), np.abs(estimate.sources.amplitude / amplitude - 1.0).max())


def best_error(estimate, path, position, amplitude):
    """The same over an estimate and its alternatives."""
    return min(seen_error(e, path, position, amplitude) for e in (estimate, *estimate.alternatives))


def clear_scene(rng, k, legs, leg, box, apart=1.0, faintest=1e-4):
    """A mission with centres ≥ `apart` on every leg and inside it, a_k within a factor 10, none fainter than that."""
    while True:
        path = from_turns(np.full(legs, leg), np.deg2rad(rng.uniform(100.0, 155.0, legs - 1)))
        for _ in range(300):
            position = path[:-1].mean(axis=0) + rng.uniform(-box, box, (k, 2))
            amplitude = 20.0 * 10.0 ** rng.random(k)
            p = projections(path, position, amplitude)
            gaps = np.diff(np.sort(p.y, axis=0), axis=0)
            inside = (p.y >= 0.0).all() and (p.y <= p.length).all()
            if gaps.min() >= apart and inside and (p.a.min(axis=0) >= faintest * p.a.max(axis=0)).all():
                return path, position, amplitude
