"""A vehicle that sends stored frames."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from aboard import Vehicle


@pytest.fixture
def vehicle() -> Iterator[Vehicle]:
    v = Vehicle()
    yield v
    v.close()
