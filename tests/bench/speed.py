"""Speed beside accuracy's tables: `python -m tests.bench.speed`: readings a leg, one leg more, memory, and
`scipy.optimize.least_squares` from random starts on the same scenes in the same run.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parents[1]))

from random_scenes import Case, random_case, truth_fit

from dslam_mav import Estimate, Flight, estimate
from dslam_mav.dslam.joint import evaluate
from dslam_mav.dslam.problem import Problem, problem
from dslam_mav.dslam.state import State
from dslam_mav.dslam.warm import warm_up

from .rows import KNOWN, STAR

Array = NDArray[np.float64]

SCENES = 12
MANY = 65_536
STARTS = 4000  # at most, of scipy's
BESIDE_SCIPY = 24
FOUND = 1.0 + 1e-4


def main() -> None:
    """Print the four tables."""
    warm_up()
    print("readings a leg: K, seconds at 64, 16,384 and 65,536 (medians); of the last the part in proportion to the")
    print("readings, one pass over them; and how many times the rest is that of 64")
    for k in (2, 3, 4):
        few, some, many = (_median_s(k, readings) for readings in (64, MANY // 4, MANY))
        one_pass = (many - some) * 4.0 / 3.0
        print(f"{k}  {few:.3f}  {some:.3f}  {many:.3f}  {one_pass:.3f}  {(many - one_pass) / few:.1f}", flush=True)
    print(f"memory of the process then: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")
    print("one leg more: K, seconds afresh and warm (medians), share of scenes where warm is as good")
    for k in (2, 3, 4):
        print(k, *_warm(k), flush=True)
    _beside_scipy()


def _cases(k: int, readings: int, count: int) -> Iterator[Case]:
    return (random_case((50_000 + i, k), k, 30.0, vertices=STAR, readings_per_leg=readings) for i in range(count))


def _seconds(run: Callable[[], Estimate]) -> float:
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun


def _median_s(k: int, readings: int) -> float:
    return float(np.median([_seconds(lambda c=c: estimate(c.flight, KNOWN, k)) for c in _cases(k, readings, SCENES)]))


def _warm(k: int) -> tuple[str, str, str]:
    afresh, warm, good = [], [], []
    for case in _cases(k, 64, SCENES):
        before = estimate(Flight(case.flight.legs[:-1]), KNOWN, k)
        begun = time.perf_counter()
        full = estimate(case.flight, KNOWN, k)
        middle = time.perf_counter()
        more = estimate(case.flight, KNOWN, k, start=before)
        afresh.append(middle - begun)
        warm.append(time.perf_counter() - middle)
        good.append(float(more.residual @ more.residual) <= FOUND * float(full.residual @ full.residual))
    return f"{np.median(afresh):.3f}", f"{np.median(warm):.3f}", f"{np.mean(good):.2f}"


def _beside_scipy() -> None:
    """Scipy's starts cannot tell that they have found the answer: every scene is given as many as the hardest needs."""
    print("scipy.optimize.least_squares (trf, analytic Jacobian), starts drawn from the prior until found, K = 3:")
    print("scene  starts  seconds  seconds of estimate()")
    starts, theirs, ours, all_found = [], [], [], True
    for i, case in enumerate(_cases(3, 64, BESIDE_SCIPY)):
        ours.append(_seconds(lambda c=case: estimate(c.flight, KNOWN, 3)))
        count, seconds, found = _by_scipy(case)
        starts.append(count)
        theirs.append(seconds)
        all_found &= found
        print(f"{i}  {count}{'' if found else ' (not found)'}  {seconds:.1f}  {ours[-1]:.3f}", flush=True)
    each = float(np.median(np.array(theirs) / np.array(starts)))
    print(f"a start: {1e3 * each:.1f} ms; starts needed, median / most: {np.median(starts):.0f} / {max(starts)}")
    budget, least = max(starts) * each, "" if all_found else "at least "
    print(
        f"as many starts as find all {len(starts)}: {budget:.1f} s a scene, {least}{budget / np.median(ours):.0f} times"
    )
    print(f"told when to stop: {np.mean(theirs):.1f} s a scene, {np.mean(theirs) / np.median(ours):.0f} times")


def _by_scipy(case: Case) -> tuple[int, float, bool]:
    """How many starts and seconds until scipy finds what the fit started at the truth found."""
    prob, best = problem(case.flight, case.medium), truth_fit(case).cost
    rng = np.random.default_rng(0)
    begun = time.perf_counter()
    with threadpool_limits(1), np.errstate(all="ignore"):
        for i in range(1, STARTS + 1):
            cost = _one_fit(prob, _drawn(prob, rng))
            if cost <= FOUND * best:
                return i, time.perf_counter() - begun, True
    return STARTS, time.perf_counter() - begun, False


def _drawn(prob: Problem, rng: np.random.Generator) -> State:
    """A start from the prior: any headings, sources in ±1.6 √C about the path's middle, amplitudes 50–200."""
    theta = np.concatenate([[0.0], rng.uniform(0.0, 2.0 * np.pi, prob.n_legs - 1)])
    places = np.array([1.6, 0.0]) + rng.uniform(-2.3, 2.3, (3, 2))
    return State.flat(prob, theta, places, np.log(50.0) + np.log(4.0) * rng.random(3), 0.0)


def _one_fit(prob: Problem, start: State) -> float:
    n_headings = prob.n_legs - 1

    def at(x: Array) -> State:
        theta = np.concatenate([[0.0], x[:n_headings]])
        return replace(start, theta=theta, s=x[n_headings:-3].reshape(3, 2), log_amplitude=x[-3:])

    x0 = np.concatenate([start.theta[1:], start.s.ravel(), start.log_amplitude])
    fit = least_squares(
        lambda x: evaluate(prob, at(x))[0], x0, jac=lambda x: evaluate(prob, at(x))[1], method="trf", x_scale="jac",
        max_nfev=100,
    )  # fmt: skip
    return 2.0 * float(fit.cost)


if __name__ == "__main__":
    main()
