"""Which candidates differ (theory, section 8, step 5)."""

from __future__ import annotations

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.tables import OPTIONS, Array, Indices


@njit(**OPTIONS)
def distinct(marks: Array, keep: int, tolerance: float) -> Indices:
    """Indices of the first `keep` rows of `marks` (B, M), given best first, that differ by more than `tolerance`."""
    batch, size = marks.shape
    chosen = np.empty(min(keep, batch), dtype=np.int64)
    count = 0
    for b in range(batch):
        same = False
        for i in range(count):
            same = True
            for m in range(size):
                if abs(marks[b, m] - marks[chosen[i], m]) >= tolerance:
                    same = False
                    break
            if same:
                break
        if not same:
            chosen[count] = b
            count += 1
            if count == keep:
                break
    return chosen[:count]
