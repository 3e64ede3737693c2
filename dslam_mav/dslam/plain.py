"""The plain case, for which the joint model is compiled: straight legs in the plane, and of priors those on sources."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.kernels.plain_model import Flown, residual_of
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import State, medium_map

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Compiled:
    """A plain problem as the compiled model knows it: what was flown, the medium at a state (K + 1,), and that state as
    a vector `start` (P,) of what `Layout` lists.
    """

    flown: Flown
    base: Array
    start: Array

    def evaluate(self, x: Array) -> tuple[Array, Array]:
        """Residual (n + 2K,) and Jacobian (n + 2K, P) at a vector (P,); as `joint.evaluate`."""
        k_sources = self.base.size - 1
        residual = np.empty(self.flown.s.size + 2 * k_sources)
        jacobian = np.empty((residual.size, x.size))
        residual_of(self.flown, self.base, x, k_sources, residual, jacobian)
        return residual, jacobian


def plain(prob: Problem) -> bool:
    """Whether the compiled model knows every unknown and every row of the problem."""
    known = prob.known
    others = (known.ambient, known.heading, known.closed_sd, known.points, known.length_sd, known.corner_sd)
    legs_in_plane = prob.basis is None and prob.dimensions == 2 and prob.mix is None
    medium_simple = prob.lag == 0.0 and prob.extent is not None and prob.drift is not None
    return legs_in_plane and medium_simple and all(prior is None for prior in others)


def compiled(prob: Problem, state: State) -> Compiled:
    """A plain problem at a state."""
    peak, peak_sd = prob.known.peak or (1.0, np.inf)
    oldest, age_sd = prob.known.age or (1.0, np.inf)
    flown = Flown(
        prob.s, prob.t, prob.y, prob.leg, prob.length, np.ascontiguousarray(medium_map(prob, len(state.s))),
        prob.ambient or 0.0, prob.ambient is None, state.extent, prob.outside, prob.n_readings,
        (float(np.log(peak)), 1.0 / peak_sd), (float(np.log(oldest)), 1.0 / age_sd),
    )  # fmt: skip
    level = np.array([state.ambient] if flown.ambient_free else [])
    still = np.zeros(flown.medium.shape[1])
    start = np.concatenate([state.theta[1:], state.s.ravel(), state.log_amplitude, still, level])
    return Compiled(flown, np.append(state.log_spread2, state.log_rate), start)
