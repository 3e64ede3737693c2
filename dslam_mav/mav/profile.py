"""How an autopilot differs from the others in what we do with it: `ardupilot`, `px4`, `generic`. Pure.

Measured on ArduCopter and ArduRover 4.7 in SITL; PX4 as its source says.
"""

from __future__ import annotations

from dataclasses import dataclass

from dslam_mav.errors import BadInputError

GENERIC = 0
ARDUPILOT = 3
PX4 = 12

_COPTER_TYPES = frozenset({2, 3, 4, 12, 13, 14, 15, 29, 35})  # ArduSub too: GUIDED is 4, AUTO 3
_GROUND_TYPES = frozenset({10, 11})  # rover, boat


@dataclass(frozen=True, slots=True)
class Profile:
    """`home_item`: item 0 is its home; `no_home_item`: it has none and would fly there.

    `takes_unset`: NaN may stand for a parameter that is not set.

    `corner_hold_s`, `corner_accept_m`: the least wait and the acceptance radius (0: its own) with which corners are
    flown to and not past. `whole_holds`, `altitude_step_m`: how it rounds what it stores. `bytewise`: integer
    parameters travel as their bytes, not as their value. `starts_armed`: MISSION_START arms. `guided_first`: arming is
    judged in the mode GUIDED. `checks_later`: it accepts missions that it then will not fly. `asks_late`: it streams
    unasked, so that it is asked for what does not come only.
    """

    name: str
    home_item: bool = False
    no_home_item: bool = False
    takes_unset: bool = True
    corner_hold_s: float = 0.0
    corner_accept_m: float = 0.0
    whole_holds: bool = False
    altitude_step_m: float = 1e-3
    bytewise: bool = False
    starts_armed: bool = False
    guided_first: bool = False
    checks_later: bool = False
    asks_late: bool = True

    @property
    def ask_after_s(self) -> float:
        """How long a stream may be missing before it is asked for the first time."""
        return 2.0 if self.asks_late else 0.0


_ARDUPILOT = Profile(
    "ardupilot",
    home_item=True,
    takes_unset=False,
    corner_hold_s=1.0,
    whole_holds=True,
    altitude_step_m=0.01,
    guided_first=True,
    asks_late=False,
)
_PX4 = Profile(
    "px4",
    no_home_item=True,
    corner_hold_s=1.0,
    corner_accept_m=0.5,
    bytewise=True,
    starts_armed=True,
    checks_later=True,
)
# takes what either would make of an item: nothing is known of it
_GENERIC = Profile("generic", whole_holds=True, altitude_step_m=0.01)

PROFILES = {profile.name: profile for profile in (_ARDUPILOT, _PX4, _GENERIC)}


def profile_of(autopilot: int) -> Profile:
    """By the MAV_AUTOPILOT of a HEARTBEAT."""
    return {ARDUPILOT: _ARDUPILOT, PX4: _PX4}.get(autopilot, _GENERIC)


def profile_named(name: str) -> Profile:
    """By its name; BadInputError: there is none such."""
    if name not in PROFILES:
        raise BadInputError(f"--profile {name!r}: expected {', '.join(PROFILES)}")
    return PROFILES[name]


def modes_of(vehicle_type: int) -> tuple[int, int]:
    """ArduPilot's numbers of GUIDED and AUTO for a MAV_TYPE."""
    return (4, 3) if vehicle_type in _COPTER_TYPES else (15, 10)


def stays_on_ground(vehicle_type: int) -> bool:
    """Whether a MAV_TYPE neither takes off nor lands."""
    return vehicle_type in _GROUND_TYPES
