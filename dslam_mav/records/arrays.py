"""Arrays as records hold them: private, read-only, checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def read_only(value: ArrayLike, argument: str, shape: tuple[int | None, ...] | None = None) -> Array:
    """A private read-only float64 copy of `value`; a wrong shape (None: any length) is a ValueError."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{argument}: expected numbers") from None
    if shape is not None and (
        array.ndim != len(shape) or any(w is not None and w != h for w, h in zip(shape, array.shape, strict=True))
    ):
        wanted = ", ".join("any" if w is None else str(w) for w in shape)
        raise ValueError(f"{argument}: expected shape ({wanted}), got {array.shape}")
    array.setflags(write=False)
    return array


def finite(array: Array, argument: str) -> None:
    """ValueError where not every number is finite."""
    if not np.isfinite(array).all():
        bad = int(np.flatnonzero(~np.isfinite(array.ravel()))[0])
        raise ValueError(f"{argument}[{bad}]: expected a finite number, got {array.ravel()[bad]}")
