"""The global search: rounds until the answers are found again and again (theory, section 8, step 7).

χ² alone certifies an answer only at high signal-to-noise; reproduction does the work. The lowest minimum is often not
the truth, so that every mode nearly as good is kept.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dslam_mav.dslam.beam import corners_by_energy, search_round
from dslam_mav.dslam.compress import Compressed
from dslam_mav.dslam.modes import Modes, merge, misfit, no_modes

MAX_ROUNDS = 24
QUIET_ROUNDS = 3
MODE_WINDOW = 25.0  # keep modes whose χ² is within this of the best
NEW_MODE_WINDOW = 12.0  # a new mode within this of the best is news
REPRODUCED = 3  # rounds in a row that do not improve on the best answer
CROWD = 40  # so many answers nearly as good are a continuum: more rounds would only go on finding more


def search(comp: Compressed, k_sources: int, rng: np.random.Generator) -> Modes:
    """All modes: rounds until `QUIET_ROUNDS` in a row bring neither a better answer nor a new one nearly as good."""
    corners = corners_by_energy(comp)
    modes = no_modes(comp.legs.length.size, k_sources)
    quiet = rounds = reproduced = 0
    while rounds < MAX_ROUNDS and quiet < QUIET_ROUNDS:
        more = search_round(comp, k_sources, int(corners[rounds % corners.size]), rng)
        rounds += 1
        if not len(more):
            quiet += 1
            continue
        before = modes
        unit = misfit(merge(before, more, np.inf), comp, k_sources)
        modes = merge(before, more, MODE_WINDOW * unit)
        quiet = quiet + 1 if len(before) and not _news(before, modes, unit) else 0
        reproduced = reproduced + 1 if len(before) and not _improved(before, modes) else 0
        if _near(modes, unit) >= CROWD and reproduced >= REPRODUCED:
            break
    return replace(modes, rounds=rounds)


def _improved(before: Modes, after: Modes) -> bool:
    """Whether a round brought a better answer."""
    lowest = float(before.cost.min())
    return float(after.cost.min()) < lowest - 1e-3 * (1.0 + 1e-3 * lowest)


def _news(before: Modes, after: Modes, unit: float) -> bool:
    """Whether a round brought a better answer, or one more that is nearly as good."""
    return _improved(before, after) or _near(after, unit) > _near(before, unit)


def _near(modes: Modes, unit: float) -> int:
    return int((modes.cost < modes.cost.min() + NEW_MODE_WINDOW * unit).sum())
