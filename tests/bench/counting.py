"""Is the number of sources found? `python -m tests.bench.counting [--scenes N]`: closed flights, K unknown."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from random_scenes import random_case

from dslam_mav import estimate
from dslam_mav.dslam.warm import warm_up

from .rows import FIRST_SEED, KNOWN, STAR

ASKED = [(1, 20.0), (2, 20.0), (3, 20.0), (4, 30.0)]


def main() -> None:
    """How often each number of sources is named, for each true one."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenes", type=int, default=100)
    options = parser.parse_args()
    warm_up()
    print(f"{options.scenes} random scenes a row on star {{7/3}}, closed, √C known; sources named: how often")
    print("K  dB  right  s median  named")
    for k_sources, snr_db in ASKED:
        named: Counter[int] = Counter()
        seconds = []
        for i in range(options.scenes):
            case = random_case((FIRST_SEED + i, k_sources, int(snr_db)), k_sources, snr_db, vertices=STAR)
            begun = time.perf_counter()
            result = estimate(replace(case.flight, closed=True), KNOWN)
            seconds.append(time.perf_counter() - begun)
            named[len(result.sources)] += 1
        told = " ".join(f"{k}: {named[k]}" for k in sorted(named))
        right = named[k_sources] / options.scenes
        print(f"{k_sources}  {snr_db:.0f}  {right:.3f}  {np.median(seconds):.2f}      {told}", flush=True)


if __name__ == "__main__":
    main()
