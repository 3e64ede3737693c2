"""`onboard`: the estimator on its own, beside any vehicle."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from dslam_mav.assumed import estimator
from dslam_mav.commands.assume import assumptions_from, configuration, in_words
from dslam_mav.commands.background import background
from dslam_mav.commands.logged import CONFIGURATION_ATTACHMENT, MISSION_ATTACHMENT
from dslam_mav.commands.outcome import Outcome, show
from dslam_mav.commands.screen import Screen
from dslam_mav.dslam.warm import warm_up
from dslam_mav.errors import DslamError
from dslam_mav.legs import LegCollector
from dslam_mav.log.recorder import Recorder
from dslam_mav.mav.frames import COMPONENT_ESTIMATOR, COMPONENT_GROUND
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission_transfer import download
from dslam_mav.mav.onboard import Onboard, Update
from dslam_mav.mission import Mission
from dslam_mav.plan_facts import plan_facts
from missions.plan_file import plan_bytes, read_plan

GROUND_SYSTEM = 255


def run(options: Namespace) -> int:
    """Listen to one flight, estimate after every leg, log everything."""
    screen = Screen(json_only=options.json)
    assumptions = assumptions_from(options)
    warm_up()
    mission, system = _mission(options)
    out = Path(options.out)
    with Recorder(out) as recorder:
        recorder.attach(
            CONFIGURATION_ATTACHMENT, "application/json", configuration(assumptions, f"onboard --out {out}")
        )
        recorder.attach(MISSION_ATTACHMENT, "text/plain", plan_bytes(mission, ".waypoints"))
        recorder.attach("plan.plan", "application/json", plan_bytes(mission, ".plan"))
        collector = LegCollector(plan_facts(mission), distance=assumptions.distance)
        with Link(options.connect, system=system, component=COMPONENT_ESTIMATOR) as link:
            onboard = Onboard(
                link,
                system,
                collector,
                estimator(assumptions, collector, mission),
                recorder,
                on_update=lambda update: _tell(screen, update),
                yaw=assumptions.heading == "vehicle",
            )
            screen.say(f"listening to vehicle {system} on {options.connect}, logging to {out}")
            with background(onboard.run, "onboard") as worker:
                while worker.running:
                    worker.join(0.2)
            if worker.error is not None and not isinstance(worker.error, DslamError):
                raise worker.error
        outcome = Outcome(
            flight=collector.flight(final=True),
            estimate=onboard.result,
            truth=None,
            log=out,
            facts=in_words(assumptions),
            warnings=collector.notes(collector.legs(final=True)),
            error=worker.error,
        )
    return show(screen, outcome)


def _mission(options: Namespace) -> tuple[Mission, int]:
    with Link(options.connect, system=GROUND_SYSTEM, component=COMPONENT_GROUND) as ground:
        system = wait_for_vehicle(ground, options.timeout)
        mission = read_plan(Path(options.plan)).mission if options.plan else download(ground, system)
    return mission, system


def _tell(screen: Screen, update: Update) -> None:
    if update.estimate is not None and not update.final:
        screen.say(f"after leg {update.legs_flown}: {update.estimate.verdict.name}. {update.estimate.reason}")
