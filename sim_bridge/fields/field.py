"""What a sensor reads where and when: the one interface of synthetic and recorded readings."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Field(Protocol):
    """A source of noise-free readings."""

    def read(self, time_s: Array, place_m: Array) -> Array:
        """Readings (M,) at `time_s` (M,) seconds after the first leg's start, at `place_m` (M, 2 or 3).

        Places are scene metres [east, north(, up)]. NaN says that there is nothing to read there or then: no
        reading is sent for it.
        """
        ...
