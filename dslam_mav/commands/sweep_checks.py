"""Checks that the tables of a sweep's file share: ValueError "key: expected …, got …"."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

T = TypeVar("T")
SEED = "a whole number from 0 to 2^63 - 1"


def listed(value: T | list[T] | None) -> list[T]:
    """One value or several, or none."""
    if value is None:
        return []
    return value if isinstance(value, list) else [value]


def not_negative(value: float) -> bool:
    """Whether it is a number, 0 or more."""
    return 0.0 <= value < math.inf


def is_seed(value: int) -> bool:
    """Whether it fits a column of the table."""
    return 0 <= value < 2**63


def positive(name: str, value: float | None) -> None:
    """None is no value."""
    if value is not None and not 0.0 < value < math.inf:
        raise ValueError(f"{name}: expected a positive number, got {value:g}")


def finite(name: str, value: float) -> None:
    """Neither infinite nor NaN."""
    if not math.isfinite(value):
        raise ValueError(f"{name}: expected a finite number, got {value}")


def each(name: str, values: Sequence[T], fits: Callable[[T], bool], wanted: str) -> None:
    """At least one value, all of them fit, and none is there twice: a point is told by its coordinates."""
    if not values:
        raise ValueError(f"{name}: expected {wanted}, got []")
    for i, value in enumerate(values):
        at = f"{name}[{i}]" if len(values) > 1 else name
        if not fits(value):
            raise ValueError(f"{at}: expected {wanted}, got {value!r}")
        if value in values[:i]:
            raise ValueError(f"{at}: expected each but once, got {value!r} again")
