"""For a given number of sources: search → joint fit with all that is known → distinct answers and the noise left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.begin import begin, dithered
from dslam_mav.dslam.certify import SAME_PLACE_SPREADS, WINDOW, Noise, noise
from dslam_mav.dslam.fit import Fit, fit
from dslam_mav.dslam.pool import apart
from dslam_mav.dslam.priors import USUAL_LAG, bounded, constrained, eased
from dslam_mav.dslam.problem import Known, Problem, alike
from dslam_mav.dslam.race import raced
from dslam_mav.dslam.reduce import binned, reduced
from dslam_mav.dslam.resume import backwards, fits_the_flight, regrown, resumed, turned_round
from dslam_mav.dslam.sides import both_sides, lone_starts
from dslam_mav.dslam.solution import Solution, better, likelier, likeliest
from dslam_mav.dslam.starts import Starts, warm_starts
from dslam_mav.dslam.state import State, layout
from dslam_mav.dslam.task import Patience, Task

Array = NDArray[np.float64]

REGROWN, FEWEST_KEPT = 3, 1  # answers whose legs are looked for again, and legs that are not
NARROWER = 0.7  # than the narrowest start: the least √C that a fit is to be exact for
PLAINLY = 6.0  # −2 ln evidence by which readings must speak for corners that are not exact
DITHERS = (0.02, 0.01)  # of the readings' range: noise to search with where the model does not fit (theory, section 10)
FEW = 2  # sources whose answer one such search finds
SLACK = 1.5  # of the readings' range, for legs that begin a leg's length beside the corner
AGES_SLACK = 0.02  # likewise, for sources of different ages taken for equally old
EASES = (100.0, 10.0)  # answers of the readings alone are led to what else is known by so much slack at first
SAME_ANSWER_SPREADS = 0.2
SAME_LOOSE_SPREADS = 0.1
LITTLE = 0.3  # of the usual: how far off legs begin among answers that need little of it, …
OTHERWISE = (1.0 / 0.3, 1.0 / 3.0)  # … and then in the one that needed least, times that


def solve(task: Task, rng: np.random.Generator) -> Solution | None:
    """Every answer within the window; None where the search finds no start."""
    task = replace(task, problem=replace(task.problem, slack=_slack(task)))
    coarse = binned(alike(task.problem), by_time=task.problem.lag != 0.0)
    if task.start is not None and fits_the_flight(task.problem, task.start, task.k_sources):
        seen = coarse
        if task.problem.drift is None:
            drift = (task.start.medium.ambient_drift_per_s or 0.0) * task.unit.time / task.unit.reading
            seen = replace(coarse, y=coarse.y - drift * coarse.t)
        known = resumed(seen, task.start, task.unit)
        if known:
            warm = _solved(task, warm_starts(seen, task.k_sources, known, rng), coarse, rng)
            settled = warm is not None and warm.fits[0].converged and not warm.level.misfit
            if warm is not None and settled and _led_on(seen, known, warm.fits[0].state):
                return warm
    first = begun = task.begun or begin(task.problem, coarse, task.k_sources, rng)
    solved = _solved(task, begun, coarse, rng)
    if solved is not None and task.problem.drift is None:
        coarse = replace(coarse, y=coarse.y - solved.fits[0].state.drift * coarse.t)
        begun = begin(task.problem, coarse, task.k_sources, rng)
        solved = _solved(task, replace(begun, states=begun.states + solved.ends), coarse, rng)
    flat = task.problem.basis is None and task.problem.dimensions == 2
    if solved is not None and flat and task.problem.spreads == "each" and task.k_sources > 1:
        solved = _with_ages(task, begun, solved, coarse, rng)
    states = begun.states
    for dither in DITHERS[: 1 if task.k_sources <= FEW else None]:
        if solved is None or not (solved.level.misfit and task.patience is Patience.ALL and flat):
            break
        doubted = replace(dithered(coarse, dither, rng), extent=None if task.extent_free else coarse.extent)
        more = begin(task.problem, doubted, task.k_sources, rng)
        states += tuple(replace(state, extent=begun.states[0].extent) for state in more.states)
        again = _solved(task, replace(begun, states=states), coarse, rng)
        solved = again if again is not None and again.fits[0].converged >= solved.fits[0].converged else solved
    return None if solved is None else replace(solved, begun=first)


def _slack(task: Task) -> float:
    """How much of the readings' range the search must leave unexplained: it knows exact corners only, and one C."""
    own_ages = AGES_SLACK if task.problem.spreads == "each" and task.k_sources > 1 else 0.0
    if task.priors.corner_sd_m is None:
        return own_ages
    return float(np.hypot(own_ages, SLACK * task.priors.corner_sd_m.mean() / task.unit.length))


def _led_on(prob: Problem, known: Sequence[State], best: State) -> bool:
    """Whether the best answer is where one of those known leads: one that a single round found has better ones beside
    it.
    """
    return any(apart(prob, fit(prob, state).state, best) < SAME_ANSWER_SPREADS * best.spread for state in known)


def _with_ages(task: Task, begun: Starts, solved: Solution, coarse: Problem, rng: np.random.Generator) -> Solution:
    """The search took all sources for equally old, and may have thrown away what ages of their own put first: the best
    answers' later legs are looked for again with those.
    """
    seen = replace(coarse, spreads="each", spread2=None, extent=task.problem.extent)
    ends, found = solved.ends[:REGROWN], list(solved.ends)
    home = turned_round(seen)
    turned = [backwards(seen, state) for state in ends]
    for kept in range(FEWEST_KEPT, seen.n_legs):
        found += regrown(seen, ends, kept)
        found += [backwards(home, state) for state in regrown(home, turned, kept)]
    again = _solved(task, replace(begun, states=tuple(found)), coarse, rng)
    return solved if again is None else again


def _solved(task: Task, begun: Starts, coarse: Problem, rng: np.random.Generator) -> Solution | None:
    """The joint fits from the starts, on all readings or what carries them, and what they are worth."""
    if begun.states and coarse.n_readings < task.problem.n_readings:
        narrowest = NARROWER * min(state.spread for state in begun.states)
        task = replace(task, problem=reduced(task.problem, narrowest))
        begun = _on_all_readings(begun, task.problem, task.problem.n_readings / coarse.n_readings)
    found = _found(task, begun, rng)
    if found is None or task.patience is Patience.NONE:
        return found
    best = _loosened(task, found, begun, rng)
    if task.extent_free and best.level.misfit:
        before = begun.states if task.patience is Patience.ALL else ()
        begun = replace(begun, states=(*before, *found.ends))
        shaped = better(found, _found(replace(task, problem=replace(task.problem, extent=None)), begun, rng))
        best = shaped if best is found or likelier(shaped, best) else best
    return best


def _loosened(task: Task, found: Solution, begun: Starts, rng: np.random.Generator) -> Solution:
    """The solution, or one whose legs begin beside the corners, where readings speak for that: on the side they speak
    for unless it is known, as far off as is usual or less.
    """

    def freer(loose: float, ends: tuple[State, ...]) -> Solution | None:
        return _found(replace(task, loose=loose), replace(begun, states=ends), rng)

    if task.priors.corner_sd_m is None:
        return found
    sides = (1.0,) if task.priors.beside_m is None or task.priors.overshot else (1.0, -1.0)
    little = likeliest([freer(LITTLE * side, found.ends) for side in sides])
    if little is None:
        return found
    others = [freer(share * little.loose, little.ends) for share in OTHERWISE]
    best = likeliest([little, *others]) or found
    return best if likelier(best, found, by=PLAINLY) else found


def _found(task: Task, begun: Starts, rng: np.random.Generator) -> Solution | None:
    prob, fits = _fits(task, begun, rng)
    if not fits:
        return None
    level = _level(prob, begun, fits[0], task)
    ends = tuple(f.state for f in fits)
    return Solution(prob, tuple(_distinct(prob, fits, level)), level, begun.freedom_inside, ends, task.loose)


def _on_all_readings(begun: Starts, prob: Problem, each: float) -> Starts:
    """What a search on means of so many readings each tells of the noise of one."""
    if prob.mix is None:
        outside = (begun.outside[0] * each, begun.outside[1])
    else:
        outside = (prob.outside, prob.n_readings - prob.y.size)
    return replace(begun, sigma=begun.sigma * float(np.sqrt(each)), outside=outside)


def _as_asked(prob: Problem, found: Sequence[State]) -> list[State]:
    """The states with every unknown of the problem; each source's own C where all are known."""
    asked = list(found)
    if prob.extent is not None:
        asked = [replace(state, extent=prob.extent) for state in asked]
    if prob.ambient is not None:
        asked = [replace(state, ambient=prob.ambient) for state in asked]
    if prob.lag is None:
        usual = float(np.log(USUAL_LAG * prob.t[-1]))
        asked = [state if np.isfinite(state.log_lag) else replace(state, log_lag=usual) for state in asked]
    own = prob.spread2 if prob.spread2 is not None else prob.age
    if own is not None and own.size > 1:
        asked = [_with_own_spreads(prob, state, np.log(own)) for state in asked]
    return asked


def _with_own_spreads(prob: Problem, state: State, log_known: Array) -> State:
    """Known spreads (or ages) given to the sources in the order that free ones come out in."""
    free = replace(prob, spreads="each", spread2=None, age=None, rate=prob.rate or 0.0, known=Known())
    loose = fit(free, state, iterations=12).state.log_spread2
    level = state.log_spread2.mean() - log_known.mean() if prob.spread2 is None else 0.0
    own = np.empty(log_known.size)
    own[np.argsort(loose, kind="stable")] = np.sort(log_known) + level
    return replace(state, log_spread2=own)


def _fits(task: Task, begun: Starts, rng: np.random.Generator) -> tuple[Problem, list[Fit]]:
    """The problem with all that is known, and its fits from every start, best first."""
    prob, priors, unit = task.problem, task.priors, task.unit
    loose = bounded(prob, begun.sigma, priors, unit, loose=task.loose)
    fits = raced(loose, _as_asked(prob, begun.states))
    if not fits or not priors.any:
        return loose, fits
    k_sources = len(fits[0].state.s)
    sigma = float(np.sqrt(_level(loose, begun, fits[0], task).variance))
    tight = constrained(prob, sigma, priors, unit, loose=task.loose)
    # what corners may do is the same with and without headings, also where misfit widens what these weigh
    tight = replace(tight, known=replace(tight.known, corner_sd=loose.known.corner_sd))
    again = [f.state for f in fits]
    if k_sources == 1 and prob.n_legs and prob.dimensions == 2:
        again += lone_starts(prob, priors, fits[0].state, rng)
    return tight, raced(tight, both_sides(tight, again), [eased(tight, factor) for factor in EASES])


def _level(prob: Problem, begun: Starts, best: Fit, task: Task) -> Noise:
    cost = float(best.residual @ best.residual) + prob.outside
    n_parameters = layout(prob, len(best.state.s)).size
    sd, freedom = task.priors.noise or (0.0, 0.0)
    elsewhere = (freedom * (sd / task.unit.reading) ** 2, freedom)
    return noise(cost, prob.n_readings, n_parameters, begun.outside, 1.0, elsewhere)


def _distinct(prob: Problem, fits: list[Fit], level: Noise) -> list[Fit]:
    """The best fit and every different one within the window, likeliest first; corners that are loose wander without
    another answer.
    """
    same = SAME_PLACE_SPREADS if prob.known.corner_sd is None else SAME_LOOSE_SPREADS
    kept: list[Fit] = []
    for f in fits:
        near = (f.cost - fits[0].cost) / level.variance < WINDOW
        if near and all(apart(prob, f.state, other.state) > same * f.state.spread for other in kept):
            kept.append(f)
    return kept[:1] + sorted(kept[1:], key=lambda f: f.cost)
