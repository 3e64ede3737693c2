"""A path by its start, first heading, turns and each leg's share of the length: what a search for the best moves.

Derivatives by the vertices become derivatives by these; the total length stays what it is.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from missions.fence import Fence

Array = NDArray[np.float64]

CHECKS_A_LEG = 24
INSIDE = 0.01  # spreads: aimed at inside the fence, so that what a penalty leaves over is inside as well


def beyond(
    x: Array, n_legs: int, length_m: float, fence: Fence, margin_m: float, spread_m: float
) -> tuple[float, Array]:
    """How far the path lies beyond the fence, squared and summed along it, and its derivatives."""
    start, theta0, turn, share = parts(x, n_legs)
    lengths = length_m * share
    theta = theta0 + np.concatenate([[0.0], np.cumsum(turn)])
    along = np.column_stack([np.cos(theta), np.sin(theta)])
    path = start + np.vstack([np.zeros(2), np.cumsum(lengths[:, None] * along, axis=0)])
    step = np.diff(path, axis=0)
    u = np.broadcast_to(np.linspace(0.0, 1.0, CHECKS_A_LEG), (n_legs, CHECKS_A_LEG))
    # and where a leg comes nearest to a corner of the fence, which may reach in between
    nearest = [_shares_beside(polygon, path, step) for polygon in fence.polygons]
    u = np.concatenate([u, *nearest], axis=1)
    worth = np.where(np.arange(u.shape[1]) < CHECKS_A_LEG, 1.0 / CHECKS_A_LEG, 1.0)
    points = path[:-1, None] + u[:, :, None] * step[:, None]
    clear, way = fence.clearance(points.reshape(-1, 2))
    short = (np.minimum(clear - margin_m - INSIDE * spread_m, 0.0) / spread_m).reshape(u.shape)
    by_point = 2.0 * (worth * short)[:, :, None] * way.reshape(*u.shape, 2) / spread_m
    moves = np.zeros_like(path)
    moves[:-1] += ((1.0 - u)[:, :, None] * by_point).sum(axis=1)
    moves[1:] += (u[:, :, None] * by_point).sum(axis=1)
    return float((worth * short**2).sum()), chained(moves[None], along[None], lengths, share)


def _shares_beside(polygon: Array, path: Array, step: Array) -> Array:
    """(L, V) at which share of each leg it comes nearest to each corner of a polygon."""
    off = polygon[None] - path[:-1, None]
    return np.asarray(np.clip((off * step[:, None]).sum(axis=2) / (step**2).sum(axis=1)[:, None], 0.0, 1.0))


def parts(x: Array, n_legs: int) -> tuple[Array, float, Array, Array]:
    """Start (2,), first heading, turns (L−1,), and each leg's share (L,) of the total: softmax of the rest."""
    weight = np.exp(x[n_legs + 2 :] - x[n_legs + 2 :].max())
    return x[:2], float(x[2]), x[3 : n_legs + 2], weight / weight.sum()


def path_of(x: Array, n_legs: int, length_m: float) -> Array:
    """(L+1, 2) vertices."""
    start, theta0, turn, share = parts(x, n_legs)
    theta = theta0 + np.concatenate([[0.0], np.cumsum(turn)])
    steps = (length_m * share)[:, None] * np.column_stack([np.cos(theta), np.sin(theta)])
    return np.asarray(start + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)]))


def coordinates(path: Array) -> Array:
    """What `path_of` makes the path of."""
    step = np.diff(path, axis=0)
    theta = np.arctan2(step[:, 1], step[:, 0])
    turn = (np.diff(theta) + math.pi) % (2.0 * math.pi) - math.pi
    return np.concatenate([path[0], theta[:1], turn, np.log(np.linalg.norm(step, axis=1))])


def chained(moves: Array, along: Array, lengths: Array, share: Array) -> Array:
    """From derivatives by the vertices (M, L+1, 2) to those by `path_of`'s coordinates, summed over M."""
    by_step = np.flip(np.cumsum(np.flip(moves, axis=1), axis=1), axis=1)[:, 1:]
    sideways = along[..., 0] * by_step[..., 1] - along[..., 1] * by_step[..., 0]
    by_theta = lengths * sideways
    by_turn = np.flip(np.cumsum(np.flip(by_theta, axis=1), axis=1), axis=1)
    by_length = (along * by_step).sum(axis=(0, 2)) * lengths.sum()
    by_log = share * (by_length - share @ by_length)
    return np.concatenate([moves.sum(axis=(0, 1)), by_turn.sum(axis=0), by_log])


def length_of(path: Array) -> float:
    """In all."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
