"""dslam_mav: the sources of a diffusing field, and the drone's own path, from one scalar sensor.

The public names are here; their meaning is in docs/python.md. They are imported when first used, so that a
command that needs none of them starts at once.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dslam_mav.dslam.estimator import estimate
    from dslam_mav.dslam.paper.options import PaperOptions
    from dslam_mav.dslam.predict import bound
    from dslam_mav.flight_log import read_flight, read_log
    from dslam_mav.records import Estimate, Flight, Leg, Medium, ParametricPath, Path, Sources, Truth, Verdict

__version__ = "0.1.0"

__all__ = [
    "Estimate",
    "Flight",
    "Leg",
    "Medium",
    "PaperOptions",
    "ParametricPath",
    "Path",
    "Sources",
    "Truth",
    "Verdict",
    "bound",
    "estimate",
    "read_flight",
    "read_log",
]

_HOMES = {
    "PaperOptions": "dslam_mav.dslam.paper.options",
    "bound": "dslam_mav.dslam.predict",
    "estimate": "dslam_mav.dslam.estimator",
    "read_flight": "dslam_mav.flight_log",
    "read_log": "dslam_mav.flight_log",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOMES.get(name, "dslam_mav.records")), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
