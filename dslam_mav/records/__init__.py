"""What flows: flights in, estimates out. Frozen, checked on creation, arrays read-only float64, SI units.

The meaning of every field is public (docs/python.md); shapes: K sources, L legs, N readings on a leg, d dimensions.
"""

from dslam_mav.records.arrays import read_only
from dslam_mav.records.estimate import Estimate, Gauge, Path, Sources, Truth, Verdict
from dslam_mav.records.flight import Flight, Leg, ParametricPath
from dslam_mav.records.medium import Medium
from dslam_mav.records.prediction import Prediction

__all__ = [
    "Estimate", "Flight", "Gauge", "Leg", "Medium", "ParametricPath", "Path", "Prediction", "Sources",
    "Truth", "Verdict", "read_only",
]  # fmt: skip
