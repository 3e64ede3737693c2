"""How the loopback vehicle behaves: to the letter of the standard (`strict`), or with the ways of ArduPilot or PX4.

ArduPilot's ways are those measured on ArduCopter 4.7 in SITL, PX4's those its source tells. Pure.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal

from dslam_mav.errors import BadInputError

Feed = Literal["gps", "flow", "odometry"]
FEEDS = ("gps", "flow", "odometry")


class Mode(IntEnum):
    """Flight modes, numbered as PX4 does (main << 16 | sub << 24), which ground stations know how to name."""

    HOLD = 50593792
    MISSION = 67371008
    RETURN = 84148224
    LAND = 100925440


@dataclass(frozen=True, slots=True)
class Manners:
    """`autopilot`: its MAV_AUTOPILOT. `modes`: its custom_mode numbers. `quiet`: streams nothing unasked.

    `missions`: which handshake it speaks. `guided_first`: it is armed in GUIDED only. `start_arms`: MISSION_START arms;
    `start_lies`: it accepts a start it will not follow. `ready_ms`: when it can be armed. `moves`: it accelerates,
    overshoots and cuts corners; `accept_m`: where a corner flown past counts as reached. `bytewise`: how whole-number
    parameters travel. `feed`: what it navigates by. `one_client`: its TCP ports serve one at a time. `echoes`: it sends
    readings on as its own, late, some only, and tells again which item was reached.
    """

    name: str
    autopilot: int = 0
    modes: dict[Mode, int] = field(default_factory=lambda: {mode: int(mode) for mode in Mode})
    quiet: bool = False
    missions: Literal["standard", "ardupilot", "px4"] = "standard"
    guided_first: bool = False
    start_arms: bool = False
    start_lies: bool = False
    ready_ms: int = 0
    moves: bool = False
    accept_m: float = 0.0
    bytewise: bool = False
    feed: Feed = "gps"
    one_client: bool = False
    echoes: bool = False

    @property
    def drifts(self) -> bool:
        """Whether it knows its place by dead reckoning only."""
        return self.feed == "flow"

    @property
    def needs_origin(self) -> bool:
        """Whether it must be told where it is."""
        return self.feed != "gps"


_ARDUPILOT_MODES = {Mode.HOLD: 4, Mode.MISSION: 3, Mode.RETURN: 6, Mode.LAND: 9}
_READY_MS = {"gps": 42_000, "flow": 24_000, "odometry": 24_000}
PROFILES = ("strict", "ardupilot", "px4")


def manners(profile: str = "strict", feed: str = "gps") -> Manners:
    """Of a profile that navigates by `feed`; BadInputError names what is unknown."""
    if feed not in FEEDS:
        raise BadInputError(f"vehicle feed {feed!r}: expected {', '.join(FEEDS)}")
    if profile == "strict":
        if feed != "gps":
            raise BadInputError(f"vehicle feed {feed!r}: expected gps, or profile ardupilot or px4")
        return Manners("strict")
    if profile == "ardupilot":
        return Manners(
            "ardupilot", 3, _ARDUPILOT_MODES, quiet=True, missions="ardupilot", guided_first=True, start_lies=True,
            ready_ms=_READY_MS[feed], moves=True, accept_m=2.0, one_client=True, feed=feed,  # type: ignore[arg-type]
        )  # fmt: skip
    if profile == "px4":
        return Manners(
            "px4", 12, missions="px4", start_arms=True, ready_ms=10_000, moves=True, accept_m=10.0, bytewise=True,
            echoes=True, feed=feed,  # type: ignore[arg-type]
        )  # fmt: skip
    raise BadInputError(f"vehicle profile {profile!r}: expected {', '.join(PROFILES)}")
