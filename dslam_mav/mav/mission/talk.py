"""Talking to one vehicle: its messages to us, its last words in text, commands with their answers."""

from __future__ import annotations

import math
import time
from typing import Any

from dslam_mav.errors import LinkError
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, messages
from dslam_mav.mav.ports import Port
from dslam_mav.mav.profile import GENERIC, Profile, profile_of

HEARTBEAT_S = 1.0
SILENCE_S = 5.0  # autopilots send a HEARTBEAT every second
COMMAND_TIMEOUT_S = 1.0
COMMAND_RETRIES = 11  # a radio that loses three packets in ten answers one question in two, and none when it is silent
_TEXT_WAIT_S = 0.3
_WARNING = 4

_RESULTS = (
    "accepted",
    "temporarily rejected",
    "denied",
    "unsupported",
    "failed",
    "in progress",
    "cancelled",
)
_IN_PROGRESS = 5
ACCEPTED = 0
UNSUPPORTED = 3


class Talk:
    """One vehicle on a link, for as long as something is asked of it.

    `text` is the last STATUSTEXT of a warning or worse, "" if none; `armed` whether any HEARTBEAT said so, `state` what
    the last one said: (armed, custom_mode), `beats` how many there were; `under_way` whether a MISSION_CURRENT said
    that the mission is flown, since it was last set to False; `param_error` is the name of the parameter the vehicle
    last said it has not; `doing` names what is under way, for the message should the vehicle disappear.
    """

    def __init__(self, link: Port, vehicle_system: int) -> None:
        self.link = link
        self.system = vehicle_system
        self.text = ""
        self.armed = False
        self.state = (False, 0)
        self.beats = 0
        self.under_way = False
        self.param_error = ""
        self.doing = ""
        self.heard = False
        self.heard_s = time.monotonic()
        self._beat_s = -math.inf

    def receive(self, until_s: float) -> Any | None:
        """The next message of the vehicle's autopilot that is meant for us or for all; None at `until_s`.

        LinkError when the vehicle has not been heard at all for five seconds.
        """
        while True:
            now_s = time.monotonic()
            if now_s - self._beat_s >= HEARTBEAT_S:
                self.link.send_heartbeat()
                self._beat_s = now_s
            if now_s - self.heard_s > SILENCE_S:
                what = f"disappeared{self.doing}" if self.heard else "does not answer"
                silence = f"nothing heard for {SILENCE_S:g} s{self.link.refusals}"
                raise LinkError(f"vehicle {self.system} on {self.link.url} {what}: {silence}")
            next_s = min(until_s, self._beat_s + HEARTBEAT_S, self.heard_s + SILENCE_S + 0.01)
            frame = self.link.receive(max(0.0, next_s - now_s))
            if frame is not None and self._is_ours(frame.message):
                self._note(frame.message)
                return frame.message
            if now_s >= until_s:
                return None

    def send(self, message: Any) -> None:
        """Send one message."""
        self.link.send(message)

    def autopilot(self) -> tuple[int, int]:
        """(MAV_AUTOPILOT, MAV_TYPE) of the vehicle, waiting for a HEARTBEAT if none was heard yet."""
        deadline_s = time.monotonic() + SILENCE_S
        while self.system not in self.link.autopilots and time.monotonic() < deadline_s:
            self.receive(deadline_s)
        return self.link.autopilots.get(self.system, (GENERIC, 0))

    def profile(self) -> Profile:
        """How the vehicle behaves: as the pilot says, or else as its HEARTBEAT does."""
        return self.link.profile or profile_of(self.autopilot()[0])

    def command(self, command: int, *params: float) -> int:
        """Send COMMAND_LONG until it is answered: its MAV_RESULT. LinkError when no answer comes."""
        seven = (*params, *(0.0,) * (7 - len(params)))
        for confirmation in range(1 + COMMAND_RETRIES):
            self.send(
                messages().MAVLink_command_long_message(self.system, COMPONENT_AUTOPILOT, command, confirmation, *seven)
            )
            result = self._await_ack(command)
            if result is not None:
                return result
        raise LinkError(
            f"vehicle {self.system} on {self.link.url} did not answer command {command}, "
            f"sent {1 + COMMAND_RETRIES} times"
        )

    def last_words(self) -> str:
        """What the vehicle says about a refusal, as `: "text"`, or ""; waits a moment for it."""
        until_s = time.monotonic() + _TEXT_WAIT_S
        while not self.text and time.monotonic() < until_s:
            self.receive(until_s)
        return self.words()

    def words(self) -> str:
        """What the vehicle said last, as `: "text"`, or ""."""
        return f': "{self.text}"' if self.text else ""

    def _await_ack(self, command: int) -> int | None:
        until_s = time.monotonic() + COMMAND_TIMEOUT_S
        while True:
            message = self.receive(until_s)
            if message is None:
                return None
            if message.get_type() == "COMMAND_ACK" and message.command == command:
                if message.result != _IN_PROGRESS:
                    return int(message.result)
                until_s = time.monotonic() + COMMAND_TIMEOUT_S
            if time.monotonic() >= until_s:
                return None

    def _is_ours(self, message: Any) -> bool:
        return (
            message.get_srcSystem() == self.system
            and message.get_srcComponent() == COMPONENT_AUTOPILOT
            and getattr(message, "target_system", 0) in (0, self.link.system)
            and getattr(message, "target_component", 0) in (0, self.link.component)
        )

    def _note(self, message: Any) -> None:
        self.heard = True
        self.heard_s = time.monotonic()
        kind = message.get_type()
        if kind == "STATUSTEXT" and message.severity <= _WARNING:
            self.text = " ".join(message.text.split())
        elif kind == "HEARTBEAT":
            self.link.autopilots[self.system] = (int(message.autopilot), int(message.type))
            armed = bool(message.base_mode & messages().MAV_MODE_FLAG_SAFETY_ARMED)
            self.armed = self.armed or armed
            self.state = (armed, int(message.custom_mode))
            self.beats += 1
        elif kind == "MISSION_CURRENT":
            self.under_way = self.under_way or message.mission_state == messages().MISSION_STATE_ACTIVE
        elif kind == "PARAM_ERROR":
            self.param_error = message.param_id


def result_in_words(result: int) -> str:
    """A MAV_RESULT as a person reads it."""
    return _RESULTS[result] if 0 <= result < len(_RESULTS) else f"result {result}"
