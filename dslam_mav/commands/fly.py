"""`fly`: plan, upload, start, read, estimate, log and report in one go."""

from __future__ import annotations

import shlex
import sys
import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from dslam_mav.assumed import estimator
from dslam_mav.commands.assume import assumptions_from, configuration, in_words
from dslam_mav.commands.background import Background, background
from dslam_mav.commands.folder import new_flight_folder
from dslam_mav.commands.logged import MISSION_ATTACHMENT
from dslam_mav.commands.outcome import Outcome, show, write_report
from dslam_mav.commands.readings import Readings, open_readings
from dslam_mav.commands.screen import Screen
from dslam_mav.dslam.warm import warm_up
from dslam_mav.errors import BadInputError, DslamError, LinkError
from dslam_mav.legs import LegCollector
from dslam_mav.log.recorder import Recorder
from dslam_mav.mav.frames import COMPONENT_BRIDGE, COMPONENT_ESTIMATOR, COMPONENT_GROUND
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission_transfer import start, upload
from dslam_mav.mav.onboard import Onboard, Update
from dslam_mav.mission import CMD_CHANGE_SPEED, Mission, home_of, leg_plan, with_home_item
from dslam_mav.plan_facts import plan_facts
from dslam_mav.records import Assumptions, Truth
from missions.plan import Profile, plan_mission
from missions.plan_file import plan_bytes, read_plan
from sim_bridge.bridge import Bridge
from sim_bridge.vehicle import DEFAULT_HOME, Vehicle

GROUND_SYSTEM = 255
VEHICLE_WAIT_S = 10.0
ARMING_PATIENCE_S = 60.0
ALTITUDE_M = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """All that is decided before anything flies."""

    mission: Mission
    readings: Readings
    assumptions: Assumptions
    plan_name: str


def run(options: Namespace) -> int:
    """Fly; exit code 0 when sources were reconstructed."""
    screen = Screen(json_only=options.json)
    setup = _set_up(options)
    for note in setup.readings.notes:
        screen.say(note)
    warm_up()
    folder = new_flight_folder(Path(options.out))
    outcome = _fly(setup, folder, options, screen)
    return show(screen, outcome)


def _set_up(options: Namespace) -> Setup:
    if options.plan:
        plan = read_plan(Path(options.plan))
        mission, name = with_home_item(plan.mission, DEFAULT_HOME), Path(options.plan).name
    else:
        own = open_readings(options, None, None)
        profile = Profile(altitude_m=ALTITUDE_M, speed_m_s=own.speed_m_s, hold_s=0.0)
        mission, name = plan_mission(own.vertices_m, DEFAULT_HOME, profile), f"the path of {own.name}"
    plan_legs = leg_plan(mission)
    if len(plan_legs.vertices_m) < 2:
        raise BadInputError(
            f"{options.plan}: {len(plan_legs.vertices_m)} waypoints: expected 2 or more, to fly legs between"
        )
    readings = open_readings(options, plan_legs.vertices_m, _speed_m_s(mission))
    readings.sampling.check(readings.speed_m_s)
    assumptions = assumptions_from(options, medium=readings.medium)
    if options.sources is None and readings.n_sources is not None:
        assumptions = replace(assumptions, n_sources=readings.n_sources)
    if options.frames and ":" in options.frames and not options.static:
        assumptions = replace(assumptions, static=assumptions.spread_m is not None)
    return Setup(mission, readings, assumptions, name)


def _speed_m_s(mission: Mission) -> float | None:
    speeds = [item.params[1] for item in mission.items if item.command == CMD_CHANGE_SPEED and item.params[1] > 0.0]
    return speeds[0] if speeds else None


def _fly(setup: Setup, folder: Path, options: Namespace, screen: Screen) -> Outcome:
    with ExitStack() as stack:
        url = options.connect or stack.enter_context(_loopback(options, setup.mission))
        ground = stack.enter_context(Link(url, system=GROUND_SYSTEM, component=COMPONENT_GROUND))
        system = wait_for_vehicle(ground, VEHICLE_WAIT_S)
        with screen.progress("mission upload") as advance:
            held = upload(ground, system, setup.mission, lambda done, total: advance(done, total, "mission upload"))
        legs = leg_plan(held)
        screen.say(
            f"Vehicle {system} holds the mission, read back and compared: {len(legs.lengths_m)} legs, "
            f"{legs.lengths_m.sum():.0f} m, {setup.plan_name}"
        )
        recorder = stack.enter_context(Recorder(folder / "flight.mcap"))
        truth = _truth(setup, held)
        _attach(recorder, setup, held, truth)
        collector = LegCollector(plan_facts(held), distance=setup.assumptions.distance)
        updates: list[Update] = []
        onboard = Onboard(
            stack.enter_context(Link(url, system=system, component=COMPONENT_ESTIMATOR)),
            system,
            collector,
            estimator(setup.assumptions, collector, held),
            recorder,
            on_update=updates.append,
            yaw=setup.assumptions.heading == "vehicle",
        )
        bridge = Bridge(
            stack.enter_context(Link(url, system=system, component=COMPONENT_BRIDGE)),
            system,
            setup.readings.field,
            setup.readings.sampling,
            legs.sequence,
            noise_sd=setup.readings.noise_sd,
            rng=setup.readings.rng,
        )
        with background(bridge.run, "bridge") as reading, background(onboard.run, "onboard") as estimating:
            time.sleep(0.3)  # a vehicle forwards only to those whose heartbeat it has heard
            for worker in (reading, estimating):
                worker.check()
            start(ground, system, ARMING_PATIENCE_S)
            _watch(ground, (reading, estimating), updates, len(legs.lengths_m), screen)
        problem = estimating.error or (reading.error if onboard.result is None else None)
        warnings = [] if problem is None else [str(problem)]
        outcome = Outcome(
            flight=collector.flight(final=True),
            estimate=onboard.result,
            truth=truth,
            log=folder / "flight.mcap",
            facts={**_facts(setup, held, bridge.sent), **in_words(setup.assumptions)},
            warnings=(*warnings, *collector.notes(collector.legs(final=True))),
            error=problem if isinstance(problem, DslamError) else None,
        )
        if problem is not None and not isinstance(problem, DslamError):
            raise problem
    return write_report(outcome, folder / "report.html")


def _watch(
    ground: Link, workers: tuple[Background, Background], updates: list[Update], n_legs: int, screen: Screen
) -> None:
    """Show what comes until the estimator is done."""
    reading, estimating = workers
    shown = 0
    beat_s = 0.0
    with screen.progress("legs flown") as advance:
        while estimating.running:
            now_s = time.monotonic()
            if now_s - beat_s >= 1.0:
                beat_s = now_s
                ground.send_heartbeat()
            while ground.receive(0.02) is not None and time.monotonic() - now_s < 0.1:
                pass  # nothing here is for us, but the socket must not fill up
            for update in updates[shown:]:
                shown += 1
                advance(update.legs_flown, n_legs, "legs flown")
                if update.estimate is not None and not update.final:
                    spread = f"√C {update.estimate.spread_m:.2f} m"
                    screen.say(
                        f"after leg {update.legs_flown}: {update.estimate.verdict.name}, {spread}. {update.estimate.reason}"
                    )
            if reading.error is not None and not isinstance(reading.error, LinkError):
                return


def _truth(setup: Setup, held: Mission) -> Truth | None:
    truth = setup.readings.truth
    if truth is None:
        return None
    return Truth(truth.source_position_m, truth.amplitude, leg_plan(held).vertices_m)


def _attach(recorder: Recorder, setup: Setup, held: Mission, truth: Truth | None) -> None:
    recorder.attach(MISSION_ATTACHMENT, "text/plain", plan_bytes(held, ".waypoints"))
    recorder.attach("plan.plan", "application/json", plan_bytes(held, ".plan"))
    command = "dslam-mav " + shlex.join(sys.argv[1:])
    recorder.attach("configuration.json", "application/json", configuration(setup.assumptions, command))
    if setup.readings.attachment is not None:
        recorder.attach(*setup.readings.attachment)
    if truth is not None:
        recorder.truth(time.time_ns(), truth)


def _facts(setup: Setup, held: Mission, sent: int) -> dict[str, str]:
    legs = leg_plan(held)
    return {
        "mission": f"{setup.plan_name}: {len(legs.lengths_m)} legs, {legs.lengths_m.sum():.1f} m",
        "readings": f"{sent} from {setup.readings.name}",
        "speed": f"{setup.readings.speed_m_s:g} m/s",
    }


@contextmanager
def _loopback(options: Namespace, mission: Mission) -> Iterator[str]:
    """A loopback vehicle of our own; the URL to reach it at."""
    home = home_of(mission) or DEFAULT_HOME
    vehicle = Vehicle(["udpin:127.0.0.1:0"], speedup=options.speedup, seed=options.seed or 0, home=home)
    with background(vehicle.run, "vehicle"):
        yield vehicle.urls[0].replace("udpin", "udpout", 1)
