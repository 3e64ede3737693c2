"""dslam_mav: the sources of a diffusing field, and the drone's own path, from one scalar sensor.

The public names are here; their meaning is in the README ("Python").
"""

from dslam_mav.dslam.estimator import estimate
from dslam_mav.log.reader import read_log
from dslam_mav.records import Estimate, Flight, Leg, Medium, Path, Sources, Truth, Verdict
from dslam_mav.replay import read_flight

__version__ = "0.1.0"

__all__ = [
    "Estimate",
    "Flight",
    "Leg",
    "Medium",
    "Path",
    "Sources",
    "Truth",
    "Verdict",
    "estimate",
    "read_flight",
    "read_log",
]
