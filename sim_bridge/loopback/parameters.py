"""The loopback vehicle's parameters: those an autopilot's GPS-denied flight depends on, as it ships them. Pure."""

from __future__ import annotations

from typing import Any

from dslam_mav.mav.frames import messages
from dslam_mav.mav.params import REAL32, from_wire, to_wire
from sim_bridge.loopback.manners import Manners

_INT8, _INT32 = 2, 6

_SHIPPED: dict[str, dict[str, tuple[float, int]]] = {
    "strict": {},
    "ardupilot": {
        "AHRS_EKF_TYPE": (3, _INT8),
        "ARMING_CHECK": (1, _INT32),
        "EK3_ENABLE": (1, _INT8),
        "EK3_SRC1_POSXY": (3, _INT8),
        "EK3_SRC1_VELXY": (3, _INT8),
        "EK3_SRC1_POSZ": (1, _INT8),
        "EK3_SRC1_VELZ": (3, _INT8),
        "EK3_SRC1_YAW": (1, _INT8),
        "FLOW_TYPE": (0, _INT8),
        "GPS1_TYPE": (1, _INT8),
        "RNGFND1_TYPE": (0, _INT8),
        "SIM_FLOW_ENABLE": (0, _INT8),
        "VISO_TYPE": (0, _INT8),
        "WPNAV_ACCEL": (250.0, REAL32),
    },
    "px4": {
        "COM_ARM_WO_GPS": (1, _INT32),
        "COM_POS_FS_EPH": (5.0, REAL32),
        "EKF2_EV_CTRL": (0, _INT32),
        "EKF2_GPS_CTRL": (7, _INT32),
        "EKF2_OF_CTRL": (0, _INT32),
    },
}  # fmt: skip
_FED: dict[tuple[str, str], dict[str, float]] = {
    ("ardupilot", "flow"): {
        "EK3_SRC1_POSXY": 0, "EK3_SRC1_VELXY": 5, "EK3_SRC1_VELZ": 0, "FLOW_TYPE": 10, "GPS1_TYPE": 0,
        "RNGFND1_TYPE": 100, "SIM_FLOW_ENABLE": 1,
    },
    ("ardupilot", "odometry"): {
        "EK3_SRC1_POSXY": 6, "EK3_SRC1_VELXY": 6, "EK3_SRC1_POSZ": 6, "EK3_SRC1_VELZ": 6, "EK3_SRC1_YAW": 6,
        "GPS1_TYPE": 0, "VISO_TYPE": 1,
    },
    ("px4", "flow"): {"COM_POS_FS_EPH": 50.0, "EKF2_GPS_CTRL": 0, "EKF2_OF_CTRL": 1},
    ("px4", "odometry"): {"EKF2_GPS_CTRL": 0, "EKF2_EV_CTRL": 15},
}  # fmt: skip


class Parameters:
    """Names, values and types; whole-number types keep whole numbers."""

    def __init__(self, manners: Manners, own: dict[str, float]) -> None:
        self._bytewise = manners.bytewise
        self._held = {name: (value, REAL32) for name, value in own.items()} | _SHIPPED[manners.name]
        for name, value in _FED.get((manners.name, manners.feed), {}).items():
            self._held[name] = value, self._held[name][1]
        self._fixed = frozenset(own)

    def all(self) -> list[Any]:
        """A PARAM_VALUE for each."""
        return [self._message(name) for name in self._held]

    def read(self, name: str, index: int) -> list[Any]:
        """The PARAM_VALUE asked for; nothing if there is none such."""
        names = list(self._held)
        if index >= 0:
            return [self._message(names[index])] if index < len(names) else []
        return [self._message(name)] if name in self._held else []

    def set(self, message: Any) -> list[Any]:
        """PARAM_SET: the answer is what is held from now on, which for some is what was held before."""
        name = message.param_id
        if name not in self._held:
            return []
        kind = self._held[name][1]
        value = from_wire(message, bytewise=self._bytewise)
        whole = kind != REAL32
        if name not in self._fixed and not (whole and self._bytewise and message.param_type != kind):
            self._held[name] = (float(int(value)) if whole else value), kind
        return [self._message(name)]

    def _message(self, name: str) -> Any:
        value, kind = self._held[name]
        wire = to_wire(value, kind, bytewise=self._bytewise)
        index = list(self._held).index(name)
        return messages().MAVLink_param_value_message(name.encode(), wire, kind, len(self._held), index)
