"""`onboard`: the estimator on its own, beside any vehicle."""

from __future__ import annotations

from argparse import Namespace
from contextlib import ExitStack
from pathlib import Path

from dslam_mav.assumed import estimator, visible_plan
from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.adaptive import Flying, steer
from dslam_mav.commands.adaptive_options import check, check_mission
from dslam_mav.commands.assume import assumptions_from, in_words, stood
from dslam_mav.commands.attached import as_logged, attach, predict
from dslam_mav.commands.background import Background, background
from dslam_mav.commands.flying import ESTIMATE_PATIENCE_S
from dslam_mav.commands.live import served
from dslam_mav.commands.meeting import Met, flown, met, planned_path
from dslam_mav.commands.odometry import check as check_odometry
from dslam_mav.commands.odometry import sender
from dslam_mav.commands.outcome import Outcome, show
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.signing import signing_from
from dslam_mav.commands.summary import under_way
from dslam_mav.dslam.warm import warm_up
from dslam_mav.errors import BadInputError, DslamError
from dslam_mav.files import check_output
from dslam_mav.forecast import Sensor
from dslam_mav.legs import LegCollector, plan_facts
from dslam_mav.log.live import Live
from dslam_mav.log.recorder import Recorder
from dslam_mav.mav.onboard import Onboard, Update
from dslam_mav.mission import Mission, leg_plan
from dslam_mav.records.words import count


def run(options: Namespace) -> int:
    """Listen to one flight, estimate after every leg, log everything."""
    screen = Screen(json_only=options.json)
    assumptions = assumptions_from(options)
    check(options)
    check_odometry(options, assumptions)
    out = Path(options.out)
    if out.exists():
        raise BadInputError(f"--out {out}: exists already, and a log is never overwritten")
    check_output(out, (".mcap",))
    plan = planned_path(options)
    signing = signing_from(options, screen)
    with served(options, screen) as live, met([options.connect], options, signing) as vehicle:
        # to be changed in flight, a mission must be known as the vehicle holds it
        held = flown(vehicle, None if options.adaptive else plan)
        check_mission(options, held, f"vehicle {vehicle.system}'s mission")
        return _listen((vehicle, held), assumptions, options, screen, live)


def _listen(
    met_with: tuple[Met, Mission], assumptions: Assumptions, options: Namespace, screen: Screen, live: Live | None
) -> int:
    vehicle, held = met_with
    out, system = Path(options.out), vehicle.system
    mission = as_logged(held)
    vehicle.hubs[0].leave(vehicle.ground)
    with screen.progress("loading the estimator (compiled on first use)"):
        warm_up()
    with Recorder(out, live.send if live else None) as recorder:
        attach(recorder, mission, assumptions, system)
        predict(recorder, mission, assumptions, Sensor())
        collector = LegCollector(plan_facts(mission), distance=assumptions.distance)
        updates: list[Update] = []
        stopped: DslamError | KeyboardInterrupt | None = None
        onboard = Onboard(
            vehicle.estimator(),
            system,
            collector,
            estimator(assumptions, collector, visible_plan(assumptions, mission)),
            recorder,
            on_update=updates.append,
            yaw=assumptions.heading == "vehicle",
            ask_after_s=vehicle.profile.ask_after_s,
            odometry=sender(options, assumptions, vehicle, mission),
        )
        with ExitStack() as stack:
            flying = Flying(vehicle, held, collector, recorder, assumptions, lambda: onboard.result)
            steer(stack, flying, options, screen)
            screen.say(f"Listening to vehicle {system} on {options.connect}, logging to {out}")
            with background(onboard.run, "onboard", ESTIMATE_PATIENCE_S) as worker:
                try:
                    _watch(worker, updates, len(leg_plan(mission).lengths_m), screen)
                except KeyboardInterrupt as signal:
                    stopped = signal
        if worker.error is not None and not isinstance(worker.error, DslamError):
            raise worker.error
        outcome = Outcome(
            flight=collector.flight(final=True),
            estimate=onboard.result,
            truth=None,
            log=out,
            facts={**in_words(assumptions), **stood(collector, collector.legs(final=True))},
            warnings=collector.notes(collector.legs(final=True)),
            stopped=stopped or worker.error,
        )
    return show(screen, outcome)


def _watch(worker: Background, updates: list[Update], n_legs: int, screen: Screen) -> None:
    shown = 0
    with screen.progress("listening") as advance:
        while worker.running:
            worker.join(0.1)
            for update in updates[shown:]:
                shown += 1
                advance("listening", update.newest, n_legs, f"{update.newest} of {count(n_legs, 'leg')} flown")
                if update.estimate is not None and not update.final:
                    screen.follow(under_way(update.estimate, update.newest, n_legs))
