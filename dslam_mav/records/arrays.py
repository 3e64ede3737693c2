"""Arrays as records hold them: private, read-only, checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def read_only(value: ArrayLike, argument: str, shape: tuple[int | None, ...] | None = None) -> Array:
    """A private read-only float64 copy of `value`; a wrong shape (None: any length) is a ValueError."""
    try:
        if np.ma.is_masked(value) or np.iscomplexobj(value):
            raise TypeError
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{argument}: expected real numbers, none of them masked") from None
    if shape is not None and (
        array.ndim != len(shape) or any(w is not None and w != h for w, h in zip(shape, array.shape, strict=True))
    ):
        wanted = ", ".join("any" if w is None else str(w) for w in shape)
        raise ValueError(f"{argument}: expected shape ({wanted}), got {array.shape}")
    array.setflags(write=False)
    return array


def number(value: object, argument: str, wanted: str) -> float:
    """One finite number as a float; anything else is a ValueError that says what was `wanted`."""
    scalar = value.item() if isinstance(value, (np.ndarray, np.generic)) and np.size(value) == 1 else value
    try:
        fits = isinstance(scalar, (int, float)) and not isinstance(scalar, bool) and np.isfinite(float(scalar))
    except OverflowError:
        fits = False
    if not fits:
        raise ValueError(f"{argument}: expected {wanted}, got {value!r}")
    return float(scalar)  # type: ignore[arg-type]


def finite(array: Array, argument: str) -> None:
    """ValueError where not every number is finite."""
    if not np.isfinite(array).all():
        bad = int(np.flatnonzero(~np.isfinite(array.ravel()))[0])
        raise ValueError(f"{argument}[{bad}]: expected a finite number, got {array.ravel()[bad]}")
