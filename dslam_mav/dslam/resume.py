"""From an earlier estimate of the same flight to starts for its longer one: legs flown since are scanned and added."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.fit import fit
from dslam_mav.dslam.kernels.model import add_field
from dslam_mav.dslam.path import vertices
from dslam_mav.dslam.problem import Known, Problem
from dslam_mav.dslam.state import State
from dslam_mav.dslam.units import Units
from dslam_mav.records import Estimate

Array = NDArray[np.float64]

HEADINGS = 72
BEAM = 12
ITERATIONS = 8
OLD = 10.0  # flights: the age assumed where the earlier estimate could not tell it


def resumed(prob: Problem, start: Estimate, unit: Units) -> list[State]:
    """States on all legs from the earlier answer and its alternatives, best first; none where it had no positions.

    Both the problem and the answers are brought to the canonical gauge; only straight legs in the plane are added to.
    """
    flown = start.path.heading_rad.size
    begun = _first_legs(prob, flown)
    states = [_state(begun, e, unit) for e in (start, *start.alternatives) if np.isfinite(e.sources.position_m).all()]
    return _grown(prob, states, flown)


def regrown(prob: Problem, states: Sequence[State], kept: int) -> list[State]:
    """The states with all headings but those of the first legs found anew, leg by leg: minima that differ there."""
    still, gap = np.zeros(kept), np.zeros((kept, prob.dimensions))
    first = [replace(s, theta=s.theta[:kept], climb=still, longer=still, gap=gap) for s in states]
    return _grown(prob, first, kept)


def turned_round(prob: Problem) -> Problem:
    """The same legs flown backwards from the last to the first, every reading at its time; of unreduced readings."""
    order = np.argsort(-prob.leg, kind="stable")
    leg = prob.leg[order]
    return replace(
        prob,
        s=prob.length[leg] - prob.s[order],
        t=prob.t[order],
        leg=prob.n_legs - 1 - leg,
        y=prob.y[order],
        length=prob.length[::-1].copy(),
        known=Known(),
    )


def backwards(prob: Problem, state: State) -> State:
    """The state of `prob`, in which legs are straight on end, for the problem turned round."""
    angle = state.theta[-1] + np.pi
    to = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    end = vertices(state.theta, prob.length)[-1]
    theta = state.theta[::-1] - state.theta[-1]
    return replace(state, theta=theta, s=(state.s - end) @ to.T)


def _grown(prob: Problem, states: list[State], flown: int) -> list[State]:
    for leg in range(flown, prob.n_legs):
        seen = _first_legs(prob, leg + 1)
        grown = [other for state in states for other in _with_leg(prob, state, leg)]
        fits = sorted((fit(seen, state, iterations=ITERATIONS) for state in grown), key=lambda f: f.cost)
        states = [f.state for f in fits if np.isfinite(f.cost)][:BEAM]
    return states


def fits_the_flight(prob: Problem, start: Estimate, k_sources: int) -> bool:
    """Whether the earlier estimate is of so many sources on no more legs, straight and in the plane."""
    return (
        prob.basis is None
        and prob.dimensions == 2
        and len(start.sources) == k_sources
        and start.path.coefficients_m is None
        and start.path.vertices_m.shape[1] == 2
        and 1 <= start.path.heading_rad.size <= prob.n_legs
    )


def _state(prob: Problem, earlier: Estimate, unit: Units) -> State:
    alignment = to_canonical(earlier.path.vertices_m)
    step = np.diff(alignment.apply(earlier.path.vertices_m), axis=0)
    theta = np.arctan2(step[:, 1], step[:, 0])
    sources = earlier.sources
    spread2 = sources.amplitude / (np.pi * sources.peak_reading * unit.length**2)
    log_amplitude = np.log(sources.amplitude / unit.reading / unit.length**2)
    state = State.flat(prob, theta, alignment.apply(sources.position_m) / unit.length, log_amplitude, np.log(spread2))
    if prob.spread2 is not None and prob.spread2.size == 1:
        state = replace(state, log_spread2=np.full(len(sources), float(np.log(prob.spread2[0]))))
    if prob.rate is None:
        mu = earlier.medium.diffusivity_m2_s
        rate = 4.0 * mu * unit.time / unit.length**2 if mu else spread2.mean() / (OLD * float(prob.t[-1]))
        state = replace(state, log_rate=float(np.log(rate)))
    if prob.ambient is None:
        state = replace(state, ambient=(earlier.medium.ambient or 0.0) / unit.reading)
    return state


def _first_legs(prob: Problem, count: int) -> Problem:
    """The problem of the first legs alone, nothing known beside the readings."""
    if prob.mix is not None:
        ends = np.cumsum([len(mix) for mix in prob.mix])
        mix: tuple[Array, ...] | None = prob.mix[:count]
        nodes = values = int(ends[count - 1])
    else:
        mix, nodes = None, int((prob.leg < count).sum())
        values = nodes
    return replace(
        prob,
        s=prob.s[:nodes],
        t=prob.t[:nodes],
        leg=prob.leg[:nodes],
        y=prob.y[:values],
        mix=mix,
        length=prob.length[:count],
        known=Known(),
    )


def _with_leg(prob: Problem, state: State, leg: int) -> Sequence[State]:
    """The state with the leg's heading at the two best minima of a scan."""
    scan = 2.0 * np.pi * np.arange(HEADINGS) / HEADINGS
    corner = vertices(state.theta, prob.length[:leg])[-1]
    own = prob.leg == leg
    s, t = prob.s[own], prob.t[own]
    along = np.stack([np.cos(scan), np.sin(scan)], axis=1)
    places = (corner + s[None, :, None] * along[:, None, :]).reshape(-1, 2)
    model = np.full(len(places), state.ambient)
    spread2, rate = np.exp(state.log_spread2), float(np.exp(state.log_rate))
    add_field(places, np.tile(t, HEADINGS), state.s, state.log_amplitude, spread2, rate, state.extent, model)
    seen = model.reshape(HEADINGS, -1)
    if prob.mix is not None:
        seen = seen @ prob.mix[leg].T
        begin = sum(len(mix) for mix in prob.mix[:leg])
        measured = prob.y[begin : begin + len(prob.mix[leg])]
    else:
        measured = prob.y[own]
    cost = ((seen - measured) ** 2).sum(axis=1)
    minima = np.flatnonzero((cost <= np.roll(cost, 1)) & (cost < np.roll(cost, -1)))
    best = minima[np.argsort(cost[minima])][:2]
    still = np.zeros(leg + 1)
    gap = np.zeros((leg + 1, state.s.shape[1]))
    return [replace(state, theta=np.append(state.theta, scan[i]), climb=still, longer=still, gap=gap) for i in best]
