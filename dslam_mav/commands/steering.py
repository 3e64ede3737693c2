"""The legs to come, chosen and sent while the one before is flown: the vehicle never waits.

Shortly before a leg ends the adviser is asked, with what was read until then, what to fly after it. Its answer (turns
and lengths) becomes waypoints in the vehicle's own frame here, on the far side of the gate from the estimator, which
never sees them. Whatever fails or comes too late, the mission the vehicle holds is flown on.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dslam_mav.commands.adaptive_options import Steered
from dslam_mav.errors import DslamError, LinkError
from dslam_mav.legs import LegCollector, UnderWay, flight_of
from dslam_mav.mav.mission.change import PlaceLostError, UnknownMissionError, change
from dslam_mav.mav.ports import Port
from dslam_mav.mission import Mission, leg_plan
from dslam_mav.records import Flight
from missions.adviser import Advice
from missions.continued import continued, first_turn, turns_so_far, vertices_to_come
from missions.fence import Fence
from missions.next_legs import Limits

EARLIEST = 0.5  # of the leg under way: asked later more is known, and less time is left
LATEST = 0.75
TRANSFER_S = 1.5  # before a leg ends no other mission is sent
FIRST_ADVICE_S = 2.0  # what the first takes, until its own time is known
ADVICE_FACTOR = 2.0  # of the longest so far is allowed for
LISTEN_S = 0.05
HEARTBEAT_S = 1.0
HURRY = 1.5  # times real time
LEAST_LEFT = 1e-3  # of the mission: less is no leg


@dataclass(frozen=True, slots=True, eq=False)
class Ear:
    """Who is told: `changed` of every mission the vehicle then holds, `tell` a person, `warn` of what went wrong."""

    changed: Callable[[Mission], None]
    tell: Callable[[str], None]
    warn: Callable[[str], None]


class Steering:
    """One flight's; `run` in a thread of its own. `held` is the mission the vehicle holds."""

    def __init__(
        self, link: Port, system: int, collector: LegCollector, steered: Steered, held: Mission, ear: Ear
    ) -> None:
        self.held = held
        self.changes = 0
        self.reached = False
        self._link = link
        self._system = system
        self._collector = collector
        self._steered = steered
        self._ear = ear
        self._asked: set[int] = set()
        self._advice_s = FIRST_ADVICE_S
        self._clock: tuple[float, int] | None = None  # host's seconds and vehicle's milliseconds when first heard
        self._pace = 1.0
        self._beat_s = -math.inf

    def run(self, stop: threading.Event) -> None:
        """Until told to stop, or the target is reached."""
        while not stop.is_set() and not self.reached:
            try:
                self._keep_in_touch()
            except LinkError as problem:
                self._ear.warn(f"adaptive: {problem}; the mission is flown on as it is")
                return
            way = self._collector.under_way()
            if way is not None and way.end_seq not in self._asked and self._due(way):
                self._asked.add(way.end_seq)
                try:
                    self._steer(way)
                except UnknownMissionError as problem:
                    self._ear.warn(f"adaptive, leg {len(way.legs)}: {problem}; nothing more is sent")
                    return
                except DslamError as problem:
                    self._ear.warn(f"adaptive, leg {len(way.legs)}: {problem}")

    def _keep_in_touch(self) -> None:
        """A vehicle answers only those it hears; what it says meanwhile is of no use here."""
        now_s = time.monotonic()
        if now_s - self._beat_s >= HEARTBEAT_S:
            self._beat_s = now_s
            self._link.send_heartbeat()
        while time.monotonic() - now_s < LISTEN_S:
            self._link.receive(LISTEN_S)

    def _due(self, way: UnderWay) -> bool:
        """Whether to ask now: as late as the answer can still be sent, but from a half of the leg on."""
        now_s = time.monotonic()
        begun_s, begun_ms = self._clock = self._clock or (now_s, way.now_ms)
        if now_s - begun_s > 1.0:
            self._pace = max(1e-3 * (way.now_ms - begun_ms) / (now_s - begun_s), 1e-3)  # of a sped-up vehicle's clock
        needed_s = ADVICE_FACTOR * self._advice_s + TRANSFER_S
        return way.share >= LATEST or (way.share >= EARLIEST and way.left_s <= needed_s * self._pace)

    def _steer(self, way: UnderWay) -> None:
        limits = self._limits(way)
        if limits.length_m < LEAST_LEFT * self._steered.total_m:
            return
        begun_s = time.monotonic()
        advice = self._steered.adviser.advise(_flight(way), limits, self._told(way))
        self._advice_s = max(self._advice_s if self.changes else 0.0, time.monotonic() - begun_s)
        sense = first_turn(self.held) or 1.0
        turns = [sense * turn for turn in advice.turn_rad]
        number = len(way.legs)
        if not self._steered.fence.lets_pass(vertices_to_come(self.held, way.end_seq, turns, advice.length_m)):
            self._ear.warn(f"adaptive, leg {number}: what was proposed leaves the fence; the old mission is flown on")
            return
        new = continued(self.held, way.end_seq, turns, advice.length_m)
        if not self._in_time(way):
            self._ear.warn(f"adaptive, leg {number}: {_too_late(self._pace)}; the old mission is flown on")
            return
        try:
            self.held = change(self._link, self._system, self.held, new, way.end_seq)
        except PlaceLostError as problem:
            self.held = problem.held
            self._ear.changed(self.held)
            raise
        self.changes += 1
        self.reached = advice.reached
        self._ear.changed(self.held)
        self._ear.tell(_in_words(number, advice, turns))
        after = self._collector.under_way()
        if after is not None and after.end_seq != way.end_seq:
            self._ear.warn(f"adaptive: leg {number} ended while the mission was changed: leg {number + 1} may be bent")

    def _limits(self, way: UnderWay) -> Limits:
        """What may still be flown; the fence as seen from the end of the leg under way."""
        steered, plan = self._steered, leg_plan(self.held)
        j = plan.sequence.index(way.end_seq)
        flown_m = float(plan.lengths_m[:j].sum())
        step = plan.vertices_m[j] - plan.vertices_m[j - 1]
        along = step / np.linalg.norm(step)
        across = (first_turn(self.held) or 1.0) * np.array([-along[1], along[0]])
        rows = np.stack([along, across])

        def seen(polygons: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
            return tuple((polygon - plan.vertices_m[j]) @ rows.T for polygon in polygons)

        fence = Fence(seen(steered.fence.within), seen(steered.fence.keep_out))
        return Limits(max(steered.total_m - flown_m, 0.0), least_leg_m=steered.least_leg_m, fence=fence)

    def _told(self, way: UnderWay) -> np.ndarray | None:
        """The turns so far, as the mission has them; None where a leg in between was not read."""
        turns = turns_so_far(self.held, way.end_seq)
        return turns if len(turns) == len(way.legs) - 1 else None

    def _in_time(self, asked: UnderWay) -> bool:
        """Whether the leg under way is still the one it was, and lasts long enough for the transfer."""
        now = self._collector.under_way()
        return now is not None and now.end_seq == asked.end_seq and now.left_s >= TRANSFER_S * self._pace


def _flight(way: UnderWay) -> Flight:
    """As far as it is read, the leg under way as long as it will be."""
    flight = flight_of(way.legs)
    return replace(flight, legs=(*flight.legs[:-1], replace(flight.legs[-1], length_m=way.planned_m)))


def _too_late(pace: float) -> str:
    why = f": the vehicle's clock runs {pace:.2g} times real time" if pace > HURRY else ""
    return f"the proposal came too late{why}"


def _in_words(number: int, advice: Advice, turns: list[float]) -> str:
    if advice.reached:
        return f"after leg {number}: every source is known to {advice.expected_m:.3g} m, as wanted: no more legs"
    if not turns:
        return f"after leg {number}: no length is left for another"
    legs = ", ".join(
        f"turn {abs(math.degrees(turn)):.0f}° {'left' if turn > 0.0 else 'right'} and fly {length:.0f} m"
        for turn, length in zip(turns, advice.length_m, strict=True)
    )
    return f"after leg {number}: {legs}; sources then expected to {advice.expected_m:.2g} m"
