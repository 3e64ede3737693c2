"""The recorded flights of real firmware, blind: `python -m tests.bench.flights`. Lengths are in √C."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from random_scenes import INSIDE_95
from real_flights import FLIGHTS, held_against_truth

from dslam_mav.dslam.warm import warm_up


def main() -> None:
    """Every source's error and normalised squared error."""
    warm_up()
    print("flight                   verdict     error, √C            NEES                s")
    errors, inside = [], []
    for name, k_sources, medium in FLIGHTS:
        begun = time.perf_counter()
        held = held_against_truth(name, k_sources, medium)
        seconds = time.perf_counter() - begun
        error, nees = (" ".join(f"{x:.{n}f}" for x in values) for values, n in ((held.error, 3), (held.nees, 1)))
        print(f"{name:24s} {held.result.verdict.name:11s} {error:20s} {nees:19s} {seconds:.1f}", flush=True)
        errors += list(held.error)
        inside += list(held.nees < INSIDE_95)
    print(f"median {np.median(errors):.3f}, largest {max(errors):.3f}; within 95 %: {sum(inside)} of {len(inside)}")


if __name__ == "__main__":
    main()
