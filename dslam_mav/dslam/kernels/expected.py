"""Fisher information of many layouts of sources at once, and how it moves with the path's vertices: compiled.

Along leg j, at the share u of its length, x = (1 − u) B_j + u B_{j+1}. One reading's derivatives by the unknowns are
all linear in the vertices B but for the field at x (theory, section 9): legs 2 … L turned about where they begin, legs
longer than said, S_k, ln a_k, ln C, ambient. A leg's points stand for `density` readings a metre.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.tables import OPTIONS, Array, Indices


class Unknown(NamedTuple):
    """What is unknown besides headings, places and amplitudes."""

    lengths: bool
    spread: bool
    ambient: bool


class Scene(NamedTuple):
    """M layouts: places (M, K, d), peak readings at first (M, K), C (M,) and its rate (M,) = 4μ; seconds a metre."""

    places: Array
    peak: Array
    spread2: Array
    rate: Array
    pace: float


@njit(**OPTIONS)
def size_of(n_legs: int, k_sources: int, d: int, unknown: Unknown) -> int:
    """P, how many unknowns there are: headings, lengths, places, ln amplitudes, ln C, ambient."""
    lengths = n_legs if unknown.lengths else 0
    return n_legs - 1 + lengths + k_sources * (d + 1) + int(unknown.spread) + int(unknown.ambient)


@njit(**OPTIONS)
def levers(b: Array, j: int, u: float, unknown: Unknown, out: Array) -> None:
    """What the path's unknowns do to the place at the share u of leg j: `out` (path unknowns, d)."""
    n_legs, d = b.shape[0] - 1, b.shape[1]
    out[:] = 0.0
    for w in range(1, j + 1):
        share = u if w == j else 1.0
        out[w - 1, 0] = -share * (b[w + 1, 1] - b[w, 1])
        out[w - 1, 1] = share * (b[w + 1, 0] - b[w, 0])
    if unknown.lengths:
        for w in range(j):
            length = 0.0
            for q in range(d):
                length += (b[w + 1, q] - b[w, q]) ** 2
            length = math.sqrt(length)
            for q in range(d):
                out[n_legs - 1 + w, q] = (b[w + 1, q] - b[w, q]) / length


@njit(**OPTIONS)
def informations(
    vertices: Array, scene: Scene, unknown: Unknown, points: Indices, density: float, offset: float
) -> Array:
    """(M, P, P) JᵀJ on the paths `vertices` (M, L+1, d), read at `points` (M, L) shares of each leg."""
    n_layouts, n_legs, d = vertices.shape[0], vertices.shape[1] - 1, vertices.shape[2]
    k_sources = scene.places.shape[1]
    n_path = n_legs - 1 + (n_legs if unknown.lengths else 0)
    size = size_of(n_legs, k_sources, d, unknown)
    half = 0.5 * d
    out = np.zeros((n_layouts, size, size))
    turn, slope = np.zeros((n_path, d)), np.empty(d)
    most = 0
    for m in range(n_layouts):
        most = max(most, points[m].sum())
    columns = np.empty((size, most))  # of J, a reading's weight in them
    for m in range(n_layouts):
        b = vertices[m]
        flown, n = 0.0, 0
        for j in range(n_legs):
            length = 0.0
            for q in range(d):
                length += (b[j + 1, q] - b[j, q]) ** 2
            length = math.sqrt(length)
            weight = math.sqrt(density * length / points[m, j])
            for i in range(points[m, j]):
                u = (i + offset) / points[m, j]
                c = scene.spread2[m] + scene.rate[m] * scene.pace * (flown + u * length)
                growth = scene.spread2[m] / c
                by_spread = 0.0
                slope[:] = 0.0
                for k in range(k_sources):
                    far = 0.0
                    for q in range(d):
                        far += ((1.0 - u) * b[j, q] + u * b[j + 1, q] - scene.places[m, k, q]) ** 2
                    far /= c
                    g = weight * scene.peak[m, k] * growth**half * math.exp(-far)
                    for q in range(d):
                        x = (1.0 - u) * b[j, q] + u * b[j + 1, q] - scene.places[m, k, q]
                        columns[n_path + k * d + q, n] = 2.0 * x * g / c
                        slope[q] -= 2.0 * x * g / c
                    columns[n_path + k_sources * d + k, n] = g
                    by_spread += growth * (far - half) * g
                levers(b, j, u, unknown, turn)
                for p in range(n_path):
                    total = 0.0
                    for q in range(d):
                        total += turn[p, q] * slope[q]
                    columns[p, n] = total
                at = n_path + k_sources * (d + 1)
                if unknown.spread:
                    columns[at, n] = by_spread
                    at += 1
                if unknown.ambient:
                    columns[at, n] = weight
                n += 1
            flown += length
        for p in range(size):
            for r in range(p + 1):
                total = 0.0
                for i in range(n):
                    total += columns[p, i] * columns[r, i]
                out[m, p, r] = total
                out[m, r, p] = total
    return out


@njit(**OPTIONS)
def pulled(
    vertices: Array, scene: Scene, unknown: Unknown, points: Indices, density: float, offset: float, pull: Array
) -> Array:
    """(M, L+1, d) derivatives of tr(A JᵀJ) by the vertices, A = `pull` (M, P, P) symmetric; times of readings held."""
    n_layouts, n_legs, d = vertices.shape[0], vertices.shape[1] - 1, vertices.shape[2]
    k_sources = scene.places.shape[1]
    n_path = n_legs - 1 + (n_legs if unknown.lengths else 0)
    size = size_of(n_legs, k_sources, d, unknown)
    half = 0.5 * d
    out = np.zeros(vertices.shape)
    turn = np.zeros((n_path, d))
    row, own, slope, way, by_x = np.empty(size), np.empty(size), np.empty(d), np.empty(d), np.empty(d)
    off = np.empty((k_sources, d))
    fall, height = np.empty(k_sources), np.empty(k_sources)
    for m in range(n_layouts):
        b, a, back = vertices[m], pull[m], out[m]
        flown = 0.0
        for j in range(n_legs):
            length = 0.0
            for q in range(d):
                length += (b[j + 1, q] - b[j, q]) ** 2
            length = math.sqrt(length)
            weight, leg_sum = density * length / points[m, j], 0.0
            for i in range(points[m, j]):
                u = (i + offset) / points[m, j]
                c = scene.spread2[m] + scene.rate[m] * scene.pace * (flown + u * length)
                growth = scene.spread2[m] / c
                at = n_path + k_sources * (d + 1)
                slope[:] = 0.0
                by_spread = 0.0
                for k in range(k_sources):
                    far = 0.0
                    for q in range(d):
                        off[k, q] = (1.0 - u) * b[j, q] + u * b[j + 1, q] - scene.places[m, k, q]
                        far += off[k, q] ** 2 / c
                    g = scene.peak[m, k] * growth**half * math.exp(-far)
                    fall[k], height[k] = far, g
                    for q in range(d):
                        row[n_path + k * d + q] = 2.0 * off[k, q] * g / c
                        slope[q] -= 2.0 * off[k, q] * g / c
                    row[n_path + k_sources * d + k] = g
                    by_spread += growth * (far - half) * g
                levers(b, j, u, unknown, turn)
                for p in range(n_path):
                    total = 0.0
                    for q in range(d):
                        total += turn[p, q] * slope[q]
                    row[p] = total
                if unknown.spread:
                    row[at] = by_spread
                if unknown.ambient:
                    row[at + int(unknown.spread)] = 1.0
                for p in range(size):
                    total = 0.0
                    for r in range(size):
                        total += a[p, r] * row[r]
                    own[p] = total
                    leg_sum += total * row[p]
                # V = Σ own·lever: what the path's unknowns pull the place by; the row is V·∇f + …
                way[:] = 0.0
                for p in range(n_path):
                    for q in range(d):
                        way[q] += own[p] * turn[p, q]
                by_x[:] = 0.0
                for k in range(k_sources):
                    g, along = height[k], 0.0
                    for q in range(d):
                        along += off[k, q] * (way[q] - own[n_path + k * d + q])
                    own_spread = own[at] if unknown.spread else 0.0
                    for q in range(d):
                        v = way[q] - own[n_path + k * d + q]
                        h = -2.0 * off[k, q] * g / c
                        by_x[q] += g * (4.0 * off[k, q] * along / (c * c) - 2.0 * v / c)
                        by_x[q] += own[n_path + k_sources * d + k] * h
                        by_x[q] += own_spread * growth * (2.0 * off[k, q] * g / c + (fall[k] - half) * h)
                for q in range(d):
                    back[j, q] += 2.0 * weight * (1.0 - u) * by_x[q]
                    back[j + 1, q] += 2.0 * weight * u * by_x[q]
                for w in range(1, j + 1):
                    share = 2.0 * weight * own[w - 1] * (u if w == j else 1.0)
                    back[w + 1, 0] += share * slope[1]
                    back[w, 0] -= share * slope[1]
                    back[w + 1, 1] -= share * slope[0]
                    back[w, 1] += share * slope[0]
                if unknown.lengths:
                    for w in range(j):
                        p, along, long2 = n_legs - 1 + w, 0.0, 0.0
                        for q in range(d):
                            along += turn[p, q] * slope[q]
                            long2 += (b[w + 1, q] - b[w, q]) ** 2
                        share = 2.0 * weight * own[p] / math.sqrt(long2)
                        for q in range(d):
                            across = share * (slope[q] - along * turn[p, q])
                            back[w + 1, q] += across
                            back[w, q] -= across
            for q in range(d):  # a longer leg has more readings
                more = density / points[m, j] * leg_sum * (b[j + 1, q] - b[j, q]) / length
                back[j + 1, q] += more
                back[j, q] -= more
            flown += length
    return out
