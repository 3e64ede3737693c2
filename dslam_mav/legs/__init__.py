"""What a vehicle tells of its flight becomes legs: their readings, lengths and order, and nothing that GPS knows."""

from dslam_mav.legs.assembly import FlownLeg
from dslam_mav.legs.collector import LegCollector, flight_of
from dslam_mav.legs.distance import Distance
from dslam_mav.legs.plan import PlanFacts, plan_facts, plan_headings_rad
from dslam_mav.legs.standing import Standing
from dslam_mav.legs.under_way import UnderWay

__all__ = [
    "Distance",
    "FlownLeg",
    "LegCollector",
    "PlanFacts",
    "Standing",
    "UnderWay",
    "flight_of",
    "plan_facts",
    "plan_headings_rad",
]
