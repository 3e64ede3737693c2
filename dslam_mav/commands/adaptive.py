"""`--adaptive` at work: the thread that steers, and everybody who has to follow a mission that changed."""

from __future__ import annotations

import logging
import math
import time
from argparse import Namespace
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.adaptive_options import steered
from dslam_mav.commands.attached import as_logged, attach
from dslam_mav.commands.background import background
from dslam_mav.commands.meeting import Met
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.steering import Ear, Steering
from dslam_mav.dslam.scoring import has_positions
from dslam_mav.legs import LegCollector, plan_facts
from dslam_mav.log.recorder import Recorder
from dslam_mav.mission import DEGREES_E7, Home, Mission, home_of
from dslam_mav.records import Estimate, Verdict
from missions.fence import Fence
from missions.plan_fence import read_fence


@dataclass(frozen=True, slots=True, eq=False)
class Flying:
    """What steering needs of a flight under way; `held` is the mission as the vehicle gave it back, `answer` the newest
    there is.
    """

    vehicle: Met
    held: Mission
    collector: LegCollector
    recorder: Recorder
    assumptions: Assumptions
    answer: Callable[[], Estimate | None]


def steer(
    stack: ExitStack,
    flying: Flying,
    options: Namespace,
    screen: Screen,
    follow: Callable[[Mission], None] = lambda _: None,
) -> Callable[[], Mission]:
    """Begin to steer, where `--adaptive` asks for it: the mission the vehicle holds by now, as logged.

    A mission that changed is logged before anybody goes by it; `follow` is told of it as well.
    """
    planned = steered(options, flying.assumptions, flying.held, _fence(options, flying.held))
    if planned is None:
        return lambda: as_logged(flying.held)
    planned.adviser.warm_up()
    recorder = flying.recorder

    def changed(held: Mission) -> None:
        logged = as_logged(held)
        attach(recorder, logged, flying.assumptions, flying.vehicle.system)
        flying.collector.plan = plan_facts(logged)
        follow(logged)

    def say(level: int, text: str, show: Callable[[str], None]) -> None:
        recorder.text(time.time_ns(), level, text)
        show(text)

    ear = Ear(
        changed,
        lambda text: say(logging.INFO, text, screen.say),
        lambda text: say(logging.WARNING, text, screen.warn),
    )
    link = stack.enter_context(flying.vehicle.steering())
    worker = Steering(link, flying.vehicle.system, flying.collector, planned, flying.held, ear)

    def told() -> None:
        if thread.error is not None:
            ear.warn(f"adaptive: {thread.error!r}: the mission was flown on as it was")
        if options.target_sd is not None and not worker.reached:
            _tell_target(options.target_sd, flying.answer(), ear)

    stack.callback(told)
    thread = stack.enter_context(background(worker.run, "steering"))
    return lambda: as_logged(worker.held)


def _tell_target(target_m: float, answer: Estimate | None, ear: Ear) -> None:
    """The legs were flown to the last: is every source as sure as wanted now?"""
    least_m = math.inf if answer is None or not has_positions(answer) else float(answer.sd_m.max())
    if answer is not None and answer.verdict is Verdict.IDENTIFIED and least_m <= target_m:
        ear.tell(f"--target-sd {target_m:g}: reached with the last leg: every source is known to {least_m:.3g} m")
        return
    known = f": the least sure source is known to {least_m:.3g} m" if math.isfinite(least_m) else ""
    also = ", and other answers fit" if answer is not None and answer.verdict is Verdict.AMBIGUOUS else ""
    ear.warn(f"--target-sd {target_m:g}: not reached{known}{also}")


def _fence(options: Namespace, held: Mission) -> Fence:
    """The plan's own geofence, where it has one."""
    plan = getattr(options, "plan", None)
    if not options.adaptive or plan is None or Path(plan).suffix.lower() != ".plan":
        return Fence()
    fence = read_fence(plan, needed=False)
    home = home_of(held) or Home(held.items[0].x / DEGREES_E7, held.items[0].y / DEGREES_E7)
    return fence.around(home) if fence.zones else Fence()
