"""A point's name and randomness, from what it is: not from its number, its worker or the time."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np


def key_of(what: Any) -> str:
    """A name for JSON-able `what`: alike for alike, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(what, sort_keys=True, allow_nan=False).encode()).hexdigest()[:32]


def generator(seed: int, *coordinates: Any) -> np.random.Generator:
    """Randomness of its own for these coordinates (JSON-able)."""
    return np.random.default_rng(np.random.SeedSequence((seed, int(key_of(list(coordinates)), 16))))
