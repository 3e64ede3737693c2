"""A leg's readings -> its generalised samples (III-A; theory, section 8, step 1).

What a source can do to one leg is a curve e^{−(s−Y)²/C}; all such curves span, to 1e-6 of a reading, about 12
dimensions. Each leg's readings are projected once on an orthonormal basis Q of that span: z = Qᵀy. White noise stays
white, what is left over measures it, and everything later costs the same however many readings there were. Where the
ambient level is unknown every curve loses its mean over the leg first, so that a constant drops out (Q ⟂ 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.kernels.lanes import LANES
from dslam_mav.dslam.kernels.products import ORDERS, Products, tabulate
from dslam_mav.dslam.kernels.tables import LegTables

Array = NDArray[np.float64]

MARGIN_SPREADS = 4.0  # a centre may lie this far beyond either end of a leg
BASIS_STEP_SPREADS = 0.4
TABLE_STEP_SPREADS = 0.05  # cubic Hermite between nodes: error below 3e-7
BASIS_TOLERANCE = 1e-6
SAME = 1e-9  # far below what a basis is exact to
RELATIVE_NOISE_FLOOR = 1e-6  # of the readings' rms: below it the tables' own error rules


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """One leg as the search sees it, in metres and reading units.

    `distance` (N,) along the leg, `reading` (N,) less what is known of the ambient level, `spread2` (N,) the squared
    spread C at each reading, `length` the leg's.
    """

    length: float
    distance: Array
    reading: Array
    spread2: Array


@dataclass(frozen=True, slots=True, eq=False)
class Compressed:
    """All legs' generalised samples, in units of `scale` (length) and `sigma` (reading).

    `rank` (L,) dimensions in use; `energy_out`, `dof_out`: what the bases leave over (reading²), and its freedom.
    """

    legs: LegTables
    products: Products
    scale: float
    sigma: float
    rank: NDArray[np.int64]
    energy_out: float
    dof_out: int


def curves(leg: Samples, centres: Array, reference2: float, centred: bool) -> tuple[Array, Array]:
    """e^{−(s−Y)²/C}·(C_ref/C) and its derivative in Y at every centre: two (N, G) arrays."""
    u = leg.distance[:, None] - centres[None, :]
    c = leg.spread2[:, None]
    value = np.exp(-u * u / c) * (reference2 / c)
    slope = value * (2.0 * u / c)
    if centred:
        value -= value.mean(axis=0)
        slope -= slope.mean(axis=0)
    return value, slope


def basis_of(curves: Array) -> Array:
    """Orthonormal basis (N, R) of the span of the columns; by the Gram matrix when readings are many."""
    if curves.shape[0] <= 4 * curves.shape[1]:
        u, sizes, _ = np.linalg.svd(curves, full_matrices=False)
        return np.asarray(u[:, sizes > BASIS_TOLERANCE * sizes[0]])
    values, vectors = np.linalg.eigh(curves.T @ curves)
    kept = values > (BASIS_TOLERANCE**2) * values[-1] + 1e-15 * values[-1]
    q, _ = np.linalg.qr(curves @ vectors[:, kept])
    return np.asarray(q)


def compress(
    legs: Sequence[Samples], reference2: float, *, ambient_unknown: bool, sigma: float | None = None
) -> Compressed:
    """Project every leg on its basis and tabulate φ(Y) = Qᵀ e^{−(s−Y)²/C}.

    `reference2` is the squared spread amplitudes refer to (a_k/(πC_ref) is the log amplitude's unit). `sigma`: the
    readings' noise where it is known better than from these legs' left-overs.
    """
    scale = float(np.sqrt(reference2))
    longest = max(max(leg.length, float(leg.distance.max())) for leg in legs)
    shortest = min(0.0, *(float(leg.distance.min()) for leg in legs))
    margin = MARGIN_SPREADS * scale
    h = TABLE_STEP_SPREADS * scale
    nodes = np.arange(shortest - margin, longest + margin + h, h)
    bases: list[Array] = []
    parts: list[tuple[Array, Array, Array]] = []
    energy_out, dof_out, square = 0.0, 0, 0.0
    coarse = nodes[:: round(BASIS_STEP_SPREADS / TABLE_STEP_SPREADS)]
    for j, leg in enumerate(legs):
        if j == 0 or not _alike(leg, legs[j - 1]):  # legs read alike span the same
            basis = basis_of(curves(leg, coarse, reference2, ambient_unknown)[0])
            value, slope = (basis.T @ part for part in curves(leg, nodes, reference2, ambient_unknown))
        reading = leg.reading - leg.reading.mean() if ambient_unknown else leg.reading
        z = basis.T @ reading
        left = reading - basis @ z
        energy_out += float(left @ left)
        square += float(reading @ reading)
        dof_out += max(reading.size - basis.shape[1] - int(ambient_unknown), 0)
        bases.append(basis)
        parts.append((z, value, slope))
    count = sum(leg.reading.size for leg in legs)
    floor = RELATIVE_NOISE_FLOOR * float(np.sqrt(square / max(count, 1))) + 1e-300
    if sigma is None:
        sigma = float(np.sqrt(energy_out / dof_out)) if dof_out else 0.0
    sigma = max(sigma, floor)
    rank = np.array([basis.shape[1] for basis in bases], dtype=np.int64)
    size = int(rank.max())
    z_all = np.zeros((len(legs), size))
    table = np.zeros((len(legs), nodes.size, 2, size))
    for j, (z, value, slope) in enumerate(parts):
        z_all[j, : rank[j]] = z / sigma
        table[j, :, 0, : rank[j]] = value.T
        table[j, :, 1, : rank[j]] = slope.T * scale
    tables = LegTables(
        z=z_all,
        table=table,
        y0=float(nodes[0]) / scale,
        h=h / scale,
        c=np.array([float(np.mean(leg.spread2)) for leg in legs]) / reference2,
        length=np.array([leg.length for leg in legs]) / scale,
    )
    products = _products(legs, scale, sigma, (z_all**2).sum(axis=1), ambient_unknown)
    return Compressed(tables, products, scale, sigma, rank, energy_out, dof_out)


def _alike(a: Samples, b: Samples) -> bool:
    """Whether two legs are read at the same distances, with the same C."""
    if a.distance.size != b.distance.size:
        return False
    off = np.abs(a.distance - b.distance).max(initial=0.0)
    return bool(off <= SAME * a.length) and np.allclose(a.spread2, b.spread2, rtol=SAME, atol=0.0)


def _products(legs: Sequence[Samples], scale: float, sigma: float, energy: Array, centred: bool) -> Products:
    """The tables of inner products for the search's early stages; each leg has one C, its mean."""
    h = TABLE_STEP_SPREADS
    longest = max(max(leg.length, float(leg.distance.max())) for leg in legs) / scale
    shortest = min(0.0, *(float(leg.distance.min()) for leg in legs)) / scale
    count = int(np.ceil((longest - shortest + 2.0 * MARGIN_SPREADS) / h / LANES)) * LANES + LANES
    y0 = shortest - MARGIN_SPREADS
    nodes = y0 + h * np.arange(count)
    own, pair, mean = (np.empty((len(legs), count, ORDERS)) for _ in range(3))
    c = np.array([float(np.mean(leg.spread2)) for leg in legs]) / scale**2
    for j, leg in enumerate(legs):
        reading = leg.reading / sigma
        if centred:
            reading = reading - reading.mean()
        own[j], pair[j], mean[j] = tabulate(leg.distance / scale, reading, c[j], nodes)
        own[j] /= c[j]
        pair[j] /= c[j] ** 2
        mean[j] /= c[j] * np.sqrt(reading.size)
    return Products(own, pair, mean, centred, energy, y0, h, c, np.array([leg.length for leg in legs]) / scale)
