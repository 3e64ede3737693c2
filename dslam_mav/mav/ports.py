"""What others need of a link, and the loop on board of a recorder."""

from __future__ import annotations

from typing import Any, Protocol

from dslam_mav.mav.frames import Frame
from dslam_mav.mav.profile import Profile
from dslam_mav.observations import Progress, Reading
from dslam_mav.records import Estimate, Flight


class OnboardLink(Protocol):
    """What the loop needs of `mav.link.Link`."""

    def send(self, message: Any) -> None: ...  # noqa: D102
    def send_heartbeat(self) -> None: ...  # noqa: D102
    def receive(self, timeout_s: float) -> Frame | None: ...  # noqa: D102


class Port(OnboardLink, Protocol):
    """One sender's end of a connection: a `mav.link.Link` of its own, or a `mav.hub.Role` on a shared one."""

    component: int
    autopilots: dict[int, tuple[int, int]]
    profile: Profile | None

    @property
    def url(self) -> str: ...  # noqa: D102
    @property
    def system(self) -> int: ...  # noqa: D102
    @property
    def refusals(self) -> str: ...  # noqa: D102


class FlightRecorder(Protocol):
    """What the loop needs of `log.recorder.Recorder`."""

    def frame(self, received_ns: int, raw: bytes) -> None: ...  # noqa: D102
    def reading(self, received_ns: int, reading: Reading) -> None: ...  # noqa: D102
    def progress(self, received_ns: int, progress: Progress) -> None: ...  # noqa: D102
    def estimate(  # noqa: D102
        self, received_ns: int, estimate: Estimate, legs_flown: int, final: bool, flight: Flight
    ) -> None: ...
    def text(self, received_ns: int, level: int, text: str) -> None: ...  # noqa: D102
