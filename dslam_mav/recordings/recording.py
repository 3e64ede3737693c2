"""What a recorded flight is to those who replay it, whatever file it lies in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from dslam_mav.legs import Distance, PlanFacts, plan_facts
from dslam_mav.mission import Mission
from dslam_mav.replay import Replayed


@dataclass(frozen=True, slots=True)
class Assumed:
    """What a person says of a recording: as `LegCollector` and `decode` take it; `system` None is found out. `planned`:
    the plan's directions are used.
    """

    distance: Distance | None = None
    yaw: bool = False
    system: int | None = None
    planned: bool = False

    def plan(self, mission: Mission | None, held: Mission | None) -> PlanFacts | None:
        """What legs may know of the mission. One that the recording itself `held` is not needed to tell legs apart, and
        has none from where a rover starts to its first waypoint: it is used where nothing else will do.
        """
        if mission is None or (mission is held and not self.planned and self.distance != "plan"):
            return None
        return plan_facts(mission)


class Recording(Protocol):
    """What a file holds of a flight. `mission`: as the vehicle held it, None where the file has none. `begun_ns`: when
    its first packet came, since 1970; None where the file does not tell.
    """

    @property
    def mission(self) -> Mission | None: ...  # noqa: D102
    @property
    def begun_ns(self) -> int | None: ...  # noqa: D102

    def flight(self, mission: Mission | None, assumed: Assumed) -> Replayed:
        """The flight along `mission`; BadInputError says in one line what the file lacks."""
