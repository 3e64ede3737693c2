"""The parameters that make an autopilot fly missions without GPS: what they should be, and what they are. Pure.

ArduPilot's as measured on ArduCopter 4.7 in SITL, PX4's as its source reads them.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass

from dslam_mav.mav.params import same_value

SIMULATED = "SIM_FLOW_ENABLE"
"""ArduPilot has this parameter in its simulator only."""


FLOW_ERROR_M = 50.0
"""By optical flow the error that PX4 expects of its position grows as long as it flies: above 2.5 times this one its
failsafe ends the mission. 5 m, as shipped, drift may reach.
"""


@dataclass(frozen=True, slots=True)
class Wanted:
    """One parameter. `others`: names it has in other versions. `bits`: these bits must be set, others may be. `limit`:
    a larger value will do as well, and so will a negative one, which is no limit.

    `sensor`: on a real vehicle anything but 0, only its owner knows which sensor it has; `value` is the simulator's.
    `simulator`: it is there in a simulator only.
    """

    name: str
    value: float
    why: str
    others: tuple[str, ...] = ()
    reboot: bool = False
    sensor: bool = False
    simulator: bool = False
    bits: bool = False
    limit: bool = False


@dataclass(frozen=True, slots=True)
class Finding:
    """What a parameter is (None: the vehicle has none such) and should be (None: the owner must know).

    `name` is the one the vehicle knows it by.
    """

    name: str
    value: float | None
    wanted: float | None
    ok: bool
    why: str
    reboot: bool


_NO_GPS = Wanted("GPS1_TYPE", 0, "no GPS", ("GPS_TYPE",), reboot=True)


def _sources(posxy: int, velxy: int, posz: int, velz: int, yaw: int) -> tuple[Wanted, ...]:
    words = {0: "none", 1: "barometer or compass", 5: "optical flow", 6: "external navigation"}
    values = {"POSXY": posxy, "VELXY": velxy, "POSZ": posz, "VELZ": velz, "YAW": yaw}
    what = {
        "POSXY": "position", "VELXY": "velocity", "POSZ": "height", "VELZ": "climb rate", "YAW": "heading",
    }  # fmt: skip
    return tuple(Wanted(f"EK3_SRC1_{n}", v, f"{what[n]} from: {words[v]}") for n, v in values.items())


_EXTERNAL = Wanted("VISO_TYPE", 1, "takes external navigation by MAVLink", reboot=True)
_PX4 = (
    Wanted("EKF2_GPS_CTRL", 0, "no GPS"),
    Wanted("COM_ARM_WO_GPS", 1, "may be armed without GPS"),
)

NAVIGATION: dict[tuple[str, str], tuple[Wanted, ...]] = {
    ("ardupilot", "flow"): (
        _NO_GPS,
        *_sources(0, 5, 1, 0, 1),
        Wanted("FLOW_TYPE", 10, "the optical flow sensor", reboot=True, sensor=True),
        Wanted("RNGFND1_TYPE", 100, "the range finder under it", reboot=True, sensor=True),
        Wanted(SIMULATED, 1, "the simulator's flow sensor", simulator=True),
    ),
    ("ardupilot", "odometry"): (_NO_GPS, _EXTERNAL, *_sources(6, 6, 6, 6, 6)),
    ("ardupilot", "vision"): (_NO_GPS, _EXTERNAL, *_sources(6, 0, 6, 0, 1)),
    ("px4", "flow"): (
        *_PX4,
        Wanted("EKF2_OF_CTRL", 1, "fuses optical flow", ("EKF2_OF0_CTRL",)),
        Wanted("COM_POS_FS_EPH", FLOW_ERROR_M, "position error in m that ends a mission: flow drifts", limit=True),
    ),
    ("px4", "odometry"): (
        *_PX4,
        Wanted("EKF2_EV_CTRL", 15, "fuses external position, height, velocity and heading", bits=True),
    ),
    ("px4", "vision"): (
        *_PX4,
        Wanted("EKF2_EV_CTRL", 11, "fuses external position, height and heading", bits=True),
    ),
}
_EXTERNAL_NAVIGATION = 6


def names_wanted(profile: str) -> tuple[str, ...]:
    """Every parameter that may matter for a profile, each once."""
    wanted = [w for (name, _), ways in NAVIGATION.items() if name == profile for w in ways]
    return tuple(dict.fromkeys(w.name for w in wanted))


def other_names(names: Container[str], held: Container[str]) -> tuple[str, ...]:
    """What those of the `names` that are not held are called in other versions."""
    wanted = [w for ways in NAVIGATION.values() for w in ways if w.name in names and w.name not in held]
    return tuple(dict.fromkeys(other for w in wanted for other in w.others))


def findings(profile: str, way: str, held: Mapping[str, float]) -> tuple[Finding, ...]:
    """What `held` (name -> value) is and should be for that way to navigate."""
    simulated = SIMULATED in held
    return tuple(_finding(w, held, simulated) for w in NAVIGATION[profile, way] if simulated or not w.simulator)


def nearest_way(profile: str, held: Mapping[str, float]) -> str:
    """The way to navigate that the vehicle is set for, or nearly; optical flow where nothing external is chosen."""
    external = held.get("EK3_SRC1_POSXY") == _EXTERNAL_NAVIGATION or held.get("EKF2_EV_CTRL", 0.0) != 0.0
    ways = ("odometry", "vision") if external else ("flow",)
    return min(ways, key=lambda way: sum(not f.ok for f in findings(profile, way, held)))


def _finding(wanted: Wanted, held: Mapping[str, float], simulated: bool) -> Finding:
    name = next((n for n in (wanted.name, *wanted.others) if n in held), wanted.name)
    value = held.get(name)
    target: float | None = wanted.value
    if wanted.bits and value is not None:
        target = float(int(value) | int(wanted.value))
    if wanted.limit and value is not None and (value < 0.0 or value >= wanted.value):
        target = value
    if wanted.sensor and not simulated:
        target = value if value else None
    ok = value is not None and target is not None and same_value(value, target)
    return Finding(name, value, target, ok, wanted.why, wanted.reboot)
