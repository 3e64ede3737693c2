"""Inner products of Gaussians on a leg from one-dimensional tables (theory, section 8, step 1).

With one C on a leg, e^{−(s−Y)²/C} e^{−(s−Y')²/C} = e^{−(Y−Y')²/2C} e^{−2(s−m)²/C}, m = (Y+Y')/2: the inner product
of any two sources' curves is e^{−(Y−Y')²/2C} E(m) with E(m) = Σ_s e^{−2(s−m)²/C}, and that of a curve with the readings
is Z(Y) = Σ_s y e^{−(s−Y)²/C}. Least squares needs nothing else: a leg costs the same however many readings it has.
Where the ambient level is unknown every curve loses its mean: M(Y) M(Y') is taken off, M(Y) = Σ_s e^{−(s−Y)²/C}/√N.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.lanes import (
    LANES,
    Lanes,
    exponential,
    gather,
    load,
    splat,
    store,
    where_less,
    whole,
)
from dslam_mav.dslam.kernels.tables import OPTIONS, Array

ORDERS = 5  # Taylor coefficients at each node: value … fourth derivative
INLINE: dict[str, Any] = {**OPTIONS, "forceinline": True}


class Products(NamedTuple):
    """Taylor coefficients about nodes Y = y0 + g·h, all (L, G, 5), in units of one spread and of a reading's noise.

    `own` Z, `pair` E, `mean` M (zeros where not `centred`); `energy` (L,) |z|²; `c`, `length` (L,) as in `LegTables`.
    """

    own: Array
    pair: Array
    mean: Array
    centred: bool
    energy: Array
    y0: float
    h: float
    c: Array
    length: Array


@njit(**OPTIONS)
def tabulate(distance: Array, reading: Array, c: float, nodes: Array) -> tuple[Array, Array, Array]:
    """Taylor coefficients (G, 5) of Z, E and √N·M at the nodes (G a multiple of 8); the outermost nodes get zeros.

    d^i/dY^i e^{−u²} = c^{−i/2} H_i(u) e^{−u²} with u = (s − Y)/√c and Hermite's polynomials H_i.
    """
    n_nodes = nodes.size
    own, pair, mean = np.zeros((n_nodes, ORDERS)), np.zeros((n_nodes, ORDERS)), np.zeros((n_nodes, ORDERS))
    sums = np.empty((3 * ORDERS, LANES))
    at = np.empty((1, LANES))
    root = 1.0 / math.sqrt(c)
    for block in range(n_nodes // LANES):
        sums[:, :] = 0.0
        for w in range(LANES):
            at[0, w] = nodes[LANES * block + w]
        y = load(at, 0)
        for n in range(distance.size):
            u = (distance[n] - y) * root
            curve = exponential(-1.0 * u * u)
            _add_orders(sums, 0, curve * reading[n], u)
            _add_orders(sums, ORDERS, curve * curve, u * math.sqrt(2.0))
            _add_orders(sums, 2 * ORDERS, curve, u)
        for w in range(LANES):
            g = LANES * block + w
            if 0 < g < n_nodes - 1:
                factor, factor_pair = 1.0, 1.0
                for i in range(ORDERS):
                    own[g, i] = factor * sums[i, w]
                    pair[g, i] = factor_pair * sums[ORDERS + i, w]
                    mean[g, i] = factor * sums[2 * ORDERS + i, w]
                    factor *= root / (i + 1.0)
                    factor_pair *= math.sqrt(2.0) * root / (i + 1.0)
    return own, pair, mean


@njit(**INLINE)
def _add_orders(sums: Array, row: int, curve: Lanes, u: Lanes) -> None:
    u2 = u * u
    store(sums, row, load(sums, row) + curve)
    store(sums, row + 1, load(sums, row + 1) + curve * u * 2.0)
    store(sums, row + 2, load(sums, row + 2) + curve * (4.0 * u2 - 2.0))
    store(sums, row + 3, load(sums, row + 3) + curve * u * (8.0 * u2 - 12.0))
    store(sums, row + 4, load(sums, row + 4) + curve * ((16.0 * u2 - 48.0) * u2 + 12.0))


@njit(**INLINE)
def node(prods: Products, y: Lanes) -> tuple[Lanes, Lanes]:
    """The nearest node and what is left, for lanes of places; those beyond the table get a node of zeros."""
    last = prods.own.shape[1] - 1.0
    u = (y - prods.y0) * (1.0 / prods.h)
    g = whole(u + 0.5)
    g = where_less(g, splat(last), g, splat(last))  # also where g is not a number
    g = where_less(splat(0.0), g, g, splat(0.0))
    t = (u - g) * prods.h
    return g * (1.0 * ORDERS), t


@njit(**INLINE)
def value(table: Array, j: int, at: Lanes, t: Lanes) -> Lanes:
    """A table's value on leg j, good to 1e-5 of its largest."""
    start = j * table.shape[1] * ORDERS
    return gather(table, start, at) + t * (gather(table, start + 1, at) + t * gather(table, start + 2, at))


@njit(**INLINE)
def value_slope(table: Array, j: int, at: Lanes, t: Lanes) -> tuple[Lanes, Lanes]:
    """A table's value and slope on leg j."""
    start = j * table.shape[1] * ORDERS
    f1, f2 = gather(table, start + 1, at), gather(table, start + 2, at)
    f3, f4 = gather(table, start + 3, at), gather(table, start + 4, at)
    f = gather(table, start, at) + t * (f1 + t * (f2 + t * (f3 + t * f4)))
    return f, f1 + t * (2.0 * f2 + t * (3.0 * f3 + t * 4.0 * f4))


@njit(**INLINE)
def value_slope_bend(table: Array, j: int, at: Lanes, t: Lanes) -> tuple[Lanes, Lanes, Lanes]:
    """A table's value, slope and second derivative on leg j."""
    start = j * table.shape[1] * ORDERS
    f1, f2 = gather(table, start + 1, at), gather(table, start + 2, at)
    f3, f4 = gather(table, start + 3, at), gather(table, start + 4, at)
    f = gather(table, start, at) + t * (f1 + t * (f2 + t * (f3 + t * f4)))
    return f, f1 + t * (2.0 * f2 + t * (3.0 * f3 + t * 4.0 * f4)), 2.0 * f2 + t * (6.0 * f3 + t * 12.0 * f4)


@njit(**INLINE)
def pair_products(prods: Products, j: int, y: Lanes, other: Lanes) -> tuple[Lanes, Lanes, Lanes, Lanes]:
    """κ(Y, Y') of two curves on leg j, its slopes by Y and by Y', and its mixed derivative."""
    gap = y - other
    at, t = node(prods, 0.5 * (y + other))
    f, f1, f2 = value_slope_bend(prods.pair, j, at, t)
    inv_c = 1.0 / prods.c[j]
    near = exponential(-0.5 * inv_c * gap * gap)
    lean = gap * inv_c * f
    return (
        near * f,
        near * (0.5 * f1 - lean),
        near * (0.5 * f1 + lean),
        near * (f * inv_c - lean * gap * inv_c + 0.25 * f2),
    )


@njit(**INLINE)
def put_source(prods: Products, j: int, leg: Array, k: int, y: Lanes, size: Lanes, lean: Lanes) -> None:
    """Source k's seven rows of `leg`: Y, A, `lean`, −z·g, −z·a, and √N times the means of g and a.

    g = A φ(Y) and a = A φ'(Y); `lean` is ∂ ln A/∂ of what changes the source's distance.
    """
    at, t = node(prods, y)
    z, z1 = value_slope(prods.own, j, at, t)
    store(leg, 7 * k, y)
    store(leg, 7 * k + 1, size)
    store(leg, 7 * k + 2, lean)
    store(leg, 7 * k + 3, 0.0 - size * z)
    store(leg, 7 * k + 4, 0.0 - size * z1)
    if prods.centred:
        mean, mean1 = value_slope(prods.mean, j, at, t)
        store(leg, 7 * k + 5, size * mean)
        store(leg, 7 * k + 6, size * mean1)


@njit(**INLINE)
def products_of(prods: Products, j: int, leg: Array, k: int, o: int) -> tuple[Lanes, Lanes, Lanes, Lanes]:
    """Products on leg j of sources k and o: g·g, g·a, a·g, a·a with g = A φ, a = A φ'; from rows of `leg`."""
    both = load(leg, 7 * k + 1) * load(leg, 7 * o + 1)
    gg, ag, ga, aa = pair_products(prods, j, load(leg, 7 * k), load(leg, 7 * o))
    gg, ag, ga, aa = both * gg, both * ag, both * ga, both * aa
    if prods.centred:
        mk, mk1 = load(leg, 7 * k + 5), load(leg, 7 * k + 6)
        mo, mo1 = load(leg, 7 * o + 5), load(leg, 7 * o + 6)
        gg, ga, ag, aa = gg - mk * mo, ga - mk * mo1, ag - mk1 * mo, aa - mk1 * mo1
    return gg, ga, ag, aa
