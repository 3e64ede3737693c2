"""The recorded flights of real firmware, blind: `python -m tests.bench.flights`. Lengths are in √C.

`--again` flies them over other fields: other noise, other sources, fewer readings, fewer legs.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from flown_again import held_again, variants
from random_scenes import INSIDE_95
from real_flights import FLIGHTS, Held, held_against_truth

from dslam_mav.dslam.warm import warm_up


def main() -> None:
    """Every source's error and normalised squared error."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--again", action="store_true", help="over other fields")
    options = parser.parse_args()
    warm_up()
    print("flight                                      verdict     error, √C            NEES                s")
    if options.again:
        _table((f"{again.flight:24s} {what:19s}", lambda again=again: held_again(again)) for what, again in variants())
    else:
        _table((f"{flight[0]:44s}", lambda flight=flight: held_against_truth(*flight)) for flight in FLIGHTS)


def _table(flights: Iterable[tuple[str, Callable[[], Held]]]) -> None:
    errors, inside = [], []
    for name, fly in flights:
        begun = time.perf_counter()
        held = fly()
        seconds = time.perf_counter() - begun
        error, nees = (" ".join(f"{x:.{n}f}" for x in values) for values, n in ((held.error, 3), (held.nees, 1)))
        print(f"{name} {held.result.verdict.name:11s} {error:20s} {nees:19s} {seconds:.1f}", flush=True)
        errors += list(held.error)
        inside += list(held.nees < INSIDE_95)
    share = np.percentile(errors, 90)
    print(
        f"median {np.median(errors):.3f}, 90 % {share:.3f}, largest {max(errors):.3f}; "
        f"within 95 %: {sum(inside)} of {len(inside)}"
    )


if __name__ == "__main__":
    main()
