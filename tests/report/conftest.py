"""One flight that most tests of the report look at."""

from __future__ import annotations

import pytest
from report_flights import estimate_near, star_flight, star_truth, with_alternative


@pytest.fixture(scope="session")
def case():
    """(truth, flight, estimate) of K = 3, with one alternative."""
    truth = star_truth(3)
    flight, clean = star_flight(truth)
    return truth, flight, with_alternative(estimate_near(truth, flight, clean))
