"""What sources that are no Gaussians do to an answer (theory, section 10).

Residuals that are not white are the model's misfit, and the part of it that the fit could take up is gone from them: it
moved the answer. How far depends on the direction, and not as with noise: F⁻¹ times a number is too wide where noise
tells little and too narrow elsewhere. So the misfit is laid to the sources: each is a Gaussian and, with random
weights, the Hermite functions of orders 1 to 4 about its place, those of order m weighing DECAY^m. With G (n, S) these
functions along the path, and M what no change of the unknowns explains, M G says how large weights have to be to leave
the energy found, and J⁺ G how far they move the answer: its covariance is J⁺ G Gᵀ J⁺ᵀ times the weights' variance.
"""

from __future__ import annotations

from itertools import product
from math import factorial

import numpy as np
from numpy.polynomial.hermite_e import hermeval
from numpy.typing import NDArray

from dslam_mav.dslam.joint import mixed
from dslam_mav.dslam.kernels.model import lagged
from dslam_mav.dslam.path import places
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import State

Array = NDArray[np.float64]

ORDERS = 4
DECAY = 0.6
# Real misfits are smoother than random weights: more of them is seen. With this share of the variance 87 to 100 % of
# the recorded spots' sources lie in the ellipses of the answer nearest to them, whose half-axes are 1.7 to 3.1 times
# the RMS error.
SHARE = 0.15


def misshapen(prob: Problem, state: State) -> Array:
    """(n, K·M) what Hermite functions about each source, in shares of its height, would add to the readings."""
    x = places(prob, state)
    d = x.shape[1]
    terms = [m for m in product(range(ORDERS + 1), repeat=d) if 1 <= sum(m) <= ORDERS]
    spread2 = np.exp(state.log_spread2)[None, :] + np.exp(state.log_rate) * prob.t[:, None]
    height = np.exp(state.log_amplitude - 0.5 * d * np.log(np.pi * spread2))
    z = (x[:, None, :] - state.s[None]) * np.sqrt(2.0 / spread2)[:, :, None]
    bump = height * np.exp(-0.5 * (z**2).sum(axis=2))
    hermite = hermeval(z, np.eye(ORDERS + 1)) / np.sqrt([factorial(i) for i in range(ORDERS + 1)])[:, None, None, None]
    columns = [
        DECAY ** sum(m) * bump * np.prod([hermite[order, :, :, axis] for axis, order in enumerate(m)], axis=0)
        for m in terms
    ]
    out = np.concatenate(columns, axis=1)
    if (lag := float(np.exp(state.log_lag))) > 0.0:
        lagged(out, prob.t, lag)
    return mixed(prob, out)


def moved_by_shape(jacobian: Array, inverse: Array, shapes: Array, energy: float) -> Array:
    """(P, P) covariance of the unknowns by sources' shapes (n, S) that leave `energy` in the residuals.

    `jacobian` (n + rows, P), its first n rows those of the readings; `inverse` (P, P) is (JᵀJ)⁻¹.
    """
    moves = inverse @ (jacobian[: len(shapes)].T @ shapes)
    left = float((shapes**2).sum()) - float((shapes * (jacobian[: len(shapes)] @ moves)).sum())
    if not left > 0.0:
        return np.zeros_like(inverse)
    return np.asarray(SHARE * energy / left * (moves @ moves.T))
