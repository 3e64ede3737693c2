"""The live loop on board: link -> legs -> estimate -> log and link.

Estimates are computed in a thread of their own while the link goes on being read. The last one depends only
on the frames logged until then, never on an earlier estimate, so that a replay of the log repeats it.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

from dslam_mav.errors import DslamError, LinkError, LogError, MissionError
from dslam_mav.legs import FlownLeg, LegCollector, flight_of
from dslam_mav.mav import results
from dslam_mav.mav.decode import decode
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, Frame
from dslam_mav.mav.odometry import OdometryOut
from dslam_mav.mav.ports import FlightRecorder, OnboardLink
from dslam_mav.mav.streams import ONBOARD_US, YAW_US, StreamRequests
from dslam_mav.mav.watch import FlightWatch
from dslam_mav.observations import Observation, Progress, Reading
from dslam_mav.records import Estimate, Flight
from dslam_mav.records.words import agree, count

Legs = tuple[FlownLeg, ...]
Estimator = Callable[[Flight, Legs], Estimate]

HEARTBEAT_S = 1.0
MIN_LEGS = 3
"""With fewer legs an estimate under way has nothing to say; the last one says so itself."""


@dataclass(frozen=True, slots=True, eq=False)
class Update:
    """News of the flight: a leg more, or an estimate (of `legs_flown` legs, which may be fewer than flown by
    now). `newest`: the number of the last of them in the mission, more than `legs_flown` where some were left out.
    """

    legs_flown: int
    newest: int
    estimate: Estimate | None = None
    final: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class _Begun:
    """An estimate under way: flight and legs are one snapshot, more may be flown before it is done."""

    legs: Legs
    flight: Flight
    future: Future[Estimate]


class Onboard:
    """One flight's loop; `run` once. `result` is the last estimate, also after `run` raised a LinkError.

    `link` sends as (vehicle's system, 191). With `yaw` ATTITUDE.yaw is collected. `lost_s`, `quiet_s`: see
    `FlightWatch`; `ask_after_s`: how long a stream may be missing before the vehicle is asked for it; `odometry`: what
    the vehicle is to be told of its place.
    """

    def __init__(
        self,
        link: OnboardLink,
        vehicle_system: int,
        collector: LegCollector,
        estimate: Estimator,
        recorder: FlightRecorder,
        *,
        on_update: Callable[[Update], None] | None = None,
        yaw: bool = False,
        lost_s: float = 5.0,
        quiet_s: float = 1.0,
        ask_after_s: float = 2.0,
        odometry: OdometryOut | None = None,
    ) -> None:
        self.result: Estimate | None = None
        self.collector = collector
        self._link = link
        self._system = vehicle_system
        self._estimate = estimate
        self._recorder = recorder
        self._on_update = on_update or (lambda _: None)
        self._yaw = yaw
        self._lost_s = lost_s
        self._quiet_s = quiet_s
        self._worker: ThreadPoolExecutor | None = None
        self._running: _Begun | None = None
        self._waiting: Legs | None = None
        self._ask_after_s = ask_after_s
        self._odometry = odometry
        self._streams: StreamRequests | None = None
        self._beat_s = -1e9
        self._ended_ms = -1
        self._progress: Progress | None = None
        self._results = results.Results()

    def run(self, stop: threading.Event) -> Estimate | None:
        """Fly along until the mission is over or `stop` is set; the last estimate, None if no leg was flown.

        LinkError if the vehicle disappears before: `result` is then what the legs until then tell. MissionError if
        the mission ends before it begins. What the last estimate raises is raised only where nothing went wrong
        before.
        """
        now_s = time.monotonic()
        wanted_us = ONBOARD_US | (YAW_US if self._yaw or self._odometry else {})
        self._streams = StreamRequests(self._system, wanted_us, now_s, ask_after_s=self._ask_after_s)
        watch = FlightWatch(self._system, now_s, lost_s=self._lost_s, quiet_s=self._quiet_s)
        with ThreadPoolExecutor(max_workers=1, thread_name_prefix="estimate") as self._worker:
            problem = self._follow(watch, stop)
            failure = self._try_to_finish()
        if problem is not None:
            with contextlib.suppress(LogError):
                self._say(logging.ERROR, str(problem))
            raise problem from failure
        if failure is not None:
            raise failure
        return self.result

    def _follow(self, watch: FlightWatch, stop: threading.Event) -> DslamError | None:
        """Until the flight is over: None, or what went wrong."""
        while not stop.is_set():
            now_s = time.monotonic()
            frame, broken = self._exchange(now_s)
            if frame is not None:
                watch.see(frame, now_s)
                self._see(frame, now_s)
                self._take(frame)
                self._navigate(frame, now_s)
            elif broken is not None:
                return None if watch.ended else LinkError(f"{broken}, after {self._legs()} flown")
            self._collect_estimate()
            if watch.over(self.collector, now_s):
                return None if self.collector.last_event else MissionError(self._nothing_flown())
            if watch.lost(now_s):
                return LinkError(
                    f"vehicle {self._system} fell silent for {self._lost_s:g} s, after {self._legs()} flown"
                )
        return None

    def _exchange(self, now_s: float) -> tuple[Frame | None, LinkError | None]:
        """A frame, if there is one; what came before the link broke is still read."""
        broken = None
        try:
            self._keep_in_touch(now_s)
        except LinkError as error:
            broken = error
        try:
            return self._link.receive(0.1), broken
        except LinkError as error:
            return None, error

    def _keep_in_touch(self, now_s: float) -> None:
        if now_s - self._beat_s >= HEARTBEAT_S:
            self._beat_s = now_s
            self._link.send_heartbeat()
        for request in self._streams.due(now_s) if self._streams is not None else ():
            self._link.send(request)

    def _see(self, frame: Frame, now_s: float) -> None:
        source = frame.message.get_srcSystem(), frame.message.get_srcComponent()
        if self._streams is not None and source == (self._system, COMPONENT_AUTOPILOT):
            self._streams.see(frame.message, now_s)

    def _navigate(self, frame: Frame, now_s: float) -> None:
        if self._odometry is None:
            return
        muted = self._odometry.muted
        message = self._odometry.hear(frame.message, self.collector.last_event, now_s)
        if self._odometry.muted and not muted:
            self._say(logging.WARNING, "somebody else tells the vehicle where it is: no ODOMETRY is sent")
        if message is not None:
            with contextlib.suppress(LinkError):  # the next frame says so
                self._link.send(message)

    def _take(self, frame: Frame) -> None:
        self._recorder.frame(frame.received_ns, frame.raw)
        observation = decode(frame, self._system, yaw=self._yaw)
        if observation is None:
            return
        self._record(frame.received_ns, observation)
        if self.collector.add(observation):
            legs = self.collector.legs()
            if legs and legs[-1].end_ms > self._ended_ms:  # not by their number: a leg without readings ends a chain
                self._ended_ms = legs[-1].end_ms
                self._on_update(Update(len(legs), legs[-1].number))
                if len(legs) >= MIN_LEGS:
                    self._waiting = legs  # those still waiting are out of date

    def _record(self, received_ns: int, observation: Observation) -> None:
        if isinstance(observation, Reading):
            self._recorder.reading(received_ns, observation)
        elif isinstance(observation, Progress) and (observation.reached or observation != self._progress):
            self._recorder.progress(received_ns, observation)
            self._progress = observation if not observation.reached else self._progress

    def _collect_estimate(self) -> None:
        """Publish the estimate that is ready, start the one that waits."""
        if self._running is not None and self._running.future.done():
            begun, self._running = self._running, None
            if (error := begun.future.exception()) is not None:
                self._say(logging.WARNING, f"no estimate after {count(len(begun.legs), 'leg')}: {error}")
            else:
                if self._odometry is not None:
                    self._odometry.answered(begun.future.result(), begun.legs)
                self._publish(begun, final=False)
        if self._running is None and self._waiting is not None and self._worker is not None:
            self._running = self._submit(self._worker, self._waiting)
            self._waiting = None

    def _submit(self, worker: ThreadPoolExecutor, legs: Legs) -> _Begun:
        flight = flight_of(legs)
        return _Begun(legs, flight, worker.submit(self._estimate, flight, legs))

    def _try_to_finish(self) -> Exception | None:
        """The last estimate; what it raised is logged and given back."""
        try:
            self._finish()
        except Exception as error:
            with contextlib.suppress(LogError):
                self._say(logging.ERROR, f"no estimate of the whole flight: {error}")
            return error
        return None

    def _finish(self) -> None:
        """The estimate of the whole flight, from scratch; heartbeats go on meanwhile, frames are no longer
        taken.
        """
        legs = self.collector.legs(final=True)
        for note in self.collector.notes(legs):
            self._say(logging.WARNING, note)
        if not legs or self._worker is None:
            self._say(logging.WARNING, "no leg with readings was flown: nothing to estimate")
            return
        begun = self._submit(self._worker, legs)
        while not begun.future.done():
            try:
                self._keep_in_touch(time.monotonic())
                self._link.receive(0.05)
            except LinkError:
                break
        self._publish(begun, final=True)

    def _publish(self, begun: _Begun, *, final: bool) -> None:
        estimate, legs_flown = begun.future.result(), len(begun.legs)
        self.result = estimate
        self._recorder.estimate(time.time_ns(), estimate, legs_flown, final, begun.flight)
        lines = results.in_words(estimate, legs_flown, final=final)
        for line in lines:
            self._say(logging.INFO, line)
        try:
            for message in self._results.messages(estimate, lines, self.collector.clock.newest_ms or 0):
                self._link.send(message)
        except LinkError as error:
            self._say(logging.WARNING, f"results not sent: {error}")
        self._on_update(Update(legs_flown, begun.legs[-1].number, estimate, final))

    def _say(self, level: int, text: str) -> None:
        self._recorder.text(time.time_ns(), level, text)

    def _nothing_flown(self) -> str:
        return f"vehicle {self._system} ended its mission before any item of it was passed: no leg was flown"

    def _legs(self) -> str:
        n = len(self.collector.legs(final=True))
        return f"{count(n, 'leg')} {agree(n, 'was', 'were')}"
