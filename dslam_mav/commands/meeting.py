"""Meeting a vehicle: the connections to it, how it behaves, where it stands, and the mission as it can fly it."""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from dslam_mav.commands.background import background
from dslam_mav.commands.screen import Screen
from dslam_mav.errors import BadInputError
from dslam_mav.mav.frames import (
    COMPONENT_BRIDGE,
    COMPONENT_ESTIMATOR,
    COMPONENT_GROUND,
    COMPONENT_STEERING,
    SYSTEM_GROUND,
)
from dslam_mav.mav.hub import Hub, Role
from dslam_mav.mav.link import wait_for_vehicle
from dslam_mav.mav.mission.suit import suited
from dslam_mav.mav.mission.talk import Talk
from dslam_mav.mav.mission.transfer import download
from dslam_mav.mav.position import stands_at
from dslam_mav.mav.profile import Profile, profile_named, profile_of
from dslam_mav.mav.signing import Signing
from dslam_mav.mission import (
    DEGREES_E7,
    Home,
    Mission,
    e7_to_enu,
    home_of,
    leg_plan,
    moved_to,
    with_home_item,
    without_home_item,
)
from dslam_mav.records.words import count
from missions.plan_file import read_plan
from sim_bridge.odometry_feed import COMPONENT_ODOMETRY, OdometryFeed

READY_PATIENCE_S = 120.0
"""How long a vehicle may take until it knows where it is, and until it can be armed: ArduPilot's EKF takes 42 s."""

FAR_M = 1000.0
"""A plan whose home is further from the vehicle is not flown unasked."""


@dataclass(frozen=True, slots=True)
class Met:
    """A vehicle, and the ground station's end of the connection to it."""

    ground: Role
    hubs: tuple[Hub, ...]
    system: int
    profile: Profile

    def numbered(self, mission: Mission) -> Mission:
        """A plan whose items have the numbers they have in the vehicle."""
        if self.profile.home_item and mission.items:
            return with_home_item(mission)
        return without_home_item(mission) if self.profile.no_home_item else mission

    def estimator(self) -> Role:
        """The estimator's end: on the second connection, if there are several."""
        return self._join(1, COMPONENT_ESTIMATOR)

    def steering(self) -> Role:
        """The end of who changes the mission in flight: beside the estimator, by the pilot's word on the vehicle."""
        role = self._join(1, COMPONENT_STEERING)
        role.profile = self.ground.profile
        return role

    def bridge(self) -> Role:
        """The bridge's end: on the last connection."""
        return self._join(2, COMPONENT_BRIDGE)

    @contextmanager
    def fed(self, wanted: bool) -> Iterator[None]:
        """While the block runs the vehicle gets ODOMETRY, if that is wanted."""
        if not wanted:
            yield
            return
        with (
            self.hubs[-1].join(self.system, COMPONENT_ODOMETRY) as link,
            background(OdometryFeed(link, self.system).run, "odometry"),
        ):
            yield

    def _join(self, place: int, component: int) -> Role:
        return self.hubs[min(place, len(self.hubs) - 1)].join(self.system, component)


@contextmanager
def met(urls: Sequence[str], options: Namespace, signing: Signing | None) -> Iterator[Met]:
    """Connect and wait for the vehicle; all connections are closed at the end."""
    profile = profile_named(options.profile) if getattr(options, "profile", None) else None
    with ExitStack() as stack:
        hubs = tuple(stack.enter_context(Hub(url, signing=signing)) for url in urls)
        ground = stack.enter_context(hubs[0].join(SYSTEM_GROUND, COMPONENT_GROUND))
        ground.profile = profile
        system = wait_for_vehicle(ground, options.timeout)
        yield Met(ground, hubs, system, profile or profile_of(ground.autopilots[system][0]))


def planned_path(options: Namespace) -> Mission | None:
    """The mission of `--plan`, read before anybody is connected to; BadInputError where it has no leg."""
    if not options.plan:
        return None
    mission = read_plan(Path(options.plan)).mission
    _check_legs(mission, options.plan)
    return mission


def flown(vehicle: Met, plan: Mission | None) -> Mission:
    """The plan as the vehicle numbers it, or the mission it holds."""
    mission = download(vehicle.ground, vehicle.system) if plan is None else vehicle.numbered(plan)
    _check_legs(mission, f"vehicle {vehicle.system}'s mission")
    return mission


def _check_legs(mission: Mission, name: str) -> None:
    if (n := len(leg_plan(mission).sequence)) < 2:
        raise BadInputError(f"{name}: {count(n, 'waypoint')}: expected 2 or more, to fly legs between")


def suit(vehicle: Met, mission: Mission, options: Namespace, screen: Screen, *, here: bool) -> Mission:
    """The mission where the vehicle stands and as it flies it well; BadInputError where that is far from its home."""
    with screen.progress("waiting for the vehicle's position") as advance:
        place = stands_at(
            vehicle.ground,
            vehicle.system,
            home_of(mission),
            READY_PATIENCE_S,
            lambda why: advance("waiting for the vehicle's position", 0, None, why),
        )
    if place is not None:
        mission = _near(mission, place, vehicle.system, options, here=here)
    mission, notes = suited(mission, vehicle.profile, Talk(vehicle.ground, vehicle.system).autopilot()[1])
    for note in notes:
        screen.say(f"{note[0].upper()}{note[1:]}")
    return mission


def _near(mission: Mission, place: Home, system: int, options: Namespace, *, here: bool) -> Mission:
    if here:
        return moved_to(mission, place)
    home = home_of(mission)
    away_m = 0.0 if home is None else _distance_m(home, place)
    if away_m > FAR_M:
        where = f"{place.latitude_deg:.6f},{place.longitude_deg:.6f},{place.altitude_m:.0f}"
        raise BadInputError(
            f"{options.plan}: its home is {away_m / 1000:.0f} km from vehicle {system}: plan it there "
            f"(--home {where}), or fly it from where the vehicle stands: --here"
        )
    return mission


def _distance_m(one: Home, other: Home) -> float:
    if abs(one.latitude_deg - other.latitude_deg) + abs(one.longitude_deg - other.longitude_deg) > 1.0:
        a, b = math.radians(one.latitude_deg), math.radians(other.latitude_deg)
        turn = math.radians(other.longitude_deg - one.longitude_deg)
        cosine = math.sin(a) * math.sin(b) + math.cos(a) * math.cos(b) * math.cos(turn)
        return 6_371_000.0 * math.acos(max(-1.0, min(1.0, cosine)))
    x, y = round(one.latitude_deg * DEGREES_E7), round(one.longitude_deg * DEGREES_E7)
    return math.hypot(*e7_to_enu(x, y, other))
