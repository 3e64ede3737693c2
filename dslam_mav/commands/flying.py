"""The flight itself: upload, start, read, estimate and log, whatever becomes of the vehicle or of us."""

from __future__ import annotations

import time
from argparse import Namespace
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from dslam_mav.assumed import estimator, visible_plan
from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.adaptive import Flying, steer
from dslam_mav.commands.assume import in_words, stood
from dslam_mav.commands.attached import as_logged, attach, predict
from dslam_mav.commands.background import Background, background
from dslam_mav.commands.flight_progress import FlightProgress
from dslam_mav.commands.folder import point_latest
from dslam_mav.commands.launching import begin, complain, loopback
from dslam_mav.commands.meeting import Met, met, suit
from dslam_mav.commands.odometry import sender
from dslam_mav.commands.outcome import Outcome, known_then, truth_of
from dslam_mav.commands.readings import Readings, left_out
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.summary import under_way
from dslam_mav.commands.truth_flown import attach_truth, log_truth, truth_along
from dslam_mav.errors import DslamError, LinkError
from dslam_mav.legs import LegCollector, flight_of, plan_facts
from dslam_mav.log.recorder import Also, Recorder
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT
from dslam_mav.mav.mission.transfer import upload
from dslam_mav.mav.onboard import Onboard, Update
from dslam_mav.mav.ports import Port
from dslam_mav.mav.signing import Signing
from dslam_mav.mission import LegPlan, Mission, home_of, leg_plan
from dslam_mav.records.words import count
from sim_bridge.bridge import Bridge
from sim_bridge.whereabouts import Whereabouts

ESTIMATE_PATIENCE_S = 120.0
"""How long the last estimate may take once the flight is over or interrupted; a second Ctrl-C ends it at once."""

_REFRESH_S = 0.1
_BEAT_AGAIN_S = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """All that is decided before anything flies; `notes` say what was changed in the plan."""

    mission: Mission
    readings: Readings
    assumptions: Assumptions
    plan_name: str
    notes: tuple[str, ...] = ()
    signing: Signing | None = None
    live: Also | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Crew:
    """Who is at work during the flight."""

    onboard: Onboard
    bridge: Bridge
    updates: list[Update]


def fly(setup: Setup, folder: Path, options: Namespace, screen: Screen) -> Outcome:
    """One flight, logged in `folder`. What ends it early once it has begun is in the outcome, not raised."""
    with ExitStack() as stack:
        urls = options.connect or (stack.enter_context(loopback(options, setup.mission, setup.signing)),) * 3
        vehicle = stack.enter_context(met(urls, options, setup.signing))
        system = vehicle.system
        stack.enter_context(vehicle.fed(bool(options.connect) and options.feed_odometry))
        if options.connect:
            here = options.here or options.plan is None
            setup = replace(setup, mission=suit(vehicle, setup.mission, options, screen, here=here))
        given = _upload(vehicle, setup, screen)
        held = as_logged(given)
        legs = leg_plan(held)
        recorder = stack.enter_context(Recorder(folder / "flight.mcap", setup.live))
        point_latest(folder)
        attach(recorder, held, setup.assumptions, system)
        attach_truth(recorder, setup.readings, held)
        prediction = predict(recorder, held, setup.assumptions, setup.readings.sensor)
        crew = _crew(vehicle, setup, held, recorder, options)
        collector = crew.onboard.collector
        flying = Flying(vehicle, given, collector, recorder, setup.assumptions, lambda: crew.onboard.result)
        now_held = steer(stack, flying, options, screen, lambda changed: _changed(changed, setup, crew, recorder))
        stopped = _follow(vehicle, crew, legs, screen)
        if options.connect and isinstance(stopped, KeyboardInterrupt):
            screen.warn(f"vehicle {system} was not told to stop: it goes on with its mission")
        held, flown = now_held(), collector.legs(final=True)
        legs = leg_plan(held)
        reached_m = crew.bridge.sampler.reached_m if options.connect else {}  # our own vehicle flies as planned
        truth = truth_along(setup.readings, held, reached_m)
        known = [(u.legs_flown, u.estimate) for u in crew.updates if u.estimate and not u.final]
        if truth is not None and reached_m:
            stopped = stopped or log_truth(recorder, truth)
        return Outcome(
            flight=flight_of(flown),
            estimate=crew.onboard.result,
            truth=truth_of(truth, held, flown),
            log=folder / "flight.mcap",
            facts=_facts(setup, legs, crew.bridge.sent) | in_words(setup.assumptions) | stood(collector, flown),
            warnings=(*_missing(setup.readings, crew.bridge), *collector.notes(flown)),
            stopped=stopped,
            assumptions=setup.assumptions,
            mission=held,
            prediction=prediction,
            under_way=known_then(known, flown),
        )


def _upload(vehicle: Met, setup: Setup, screen: Screen) -> Mission:
    ground, system = vehicle.ground, vehicle.system
    with screen.progress("mission upload") as advance:
        held = upload(
            ground,
            system,
            setup.mission,
            lambda done, total: advance("mission upload", done, total, f"{done} of {count(total, 'item')}"),
        )
    legs = leg_plan(held)
    screen.say(
        f"Vehicle {system} holds the mission, as read back: {setup.plan_name}, {count(len(legs.lengths_m), 'leg')}, "
        f"{legs.lengths_m.sum():.0f} m"
    )
    return held


def _crew(vehicle: Met, setup: Setup, held: Mission, recorder: Recorder, options: Namespace) -> _Crew:
    """Estimator and bridge, each a sender of its own."""
    collector = LegCollector(plan_facts(held), distance=setup.assumptions.distance)
    updates: list[Update] = []
    onboard = Onboard(
        vehicle.estimator(),
        vehicle.system,
        collector,
        estimator(setup.assumptions, collector, visible_plan(setup.assumptions, held)),
        recorder,
        on_update=updates.append,
        yaw=setup.assumptions.heading == "vehicle",
        ask_after_s=vehicle.profile.ask_after_s,
        odometry=sender(options, setup.assumptions, vehicle, held),
    )
    bridge = Bridge(
        vehicle.bridge(),
        vehicle.system,
        setup.readings.field,
        setup.readings.sampling,
        leg_plan(held).sequence,
        noise_sd=setup.readings.noise_sd,
        rng=setup.readings.rng,
        before_s=setup.readings.before_s,
        where=Whereabouts(options.truth_from if options.connect else "vehicle", home_of(held)),
        ask_after_s=vehicle.profile.ask_after_s,
    )
    return _Crew(onboard, bridge, updates)


def _changed(held: Mission, setup: Setup, crew: _Crew, recorder: Recorder) -> None:
    """The vehicle holds another mission: sensor and truth follow it."""
    crew.bridge.sampler.follow(leg_plan(held).sequence)
    if (truth := truth_along(setup.readings, held)) is not None:
        recorder.truth(time.time_ns(), truth)


def _follow(vehicle: Met, crew: _Crew, legs: LegPlan, screen: Screen) -> DslamError | KeyboardInterrupt | None:
    """Start the mission and stay until the estimator is done; what ended the flight early, if anything did."""
    interrupted = None
    with (
        background(crew.bridge.run, "bridge") as reading,
        background(crew.onboard.run, "onboard", ESTIMATE_PATIENCE_S) as estimating,
    ):
        try:
            begin(vehicle, (reading, estimating), screen)
            _watch(vehicle.ground, (reading, estimating), crew.updates, legs, screen)
        except KeyboardInterrupt as signal:
            interrupted = signal
    return interrupted or _problem(reading, estimating, answered=crew.onboard.result is not None)


def _watch(
    ground: Port, workers: tuple[Background, Background], updates: list[Update], legs: LegPlan, screen: Screen
) -> None:
    """Show what comes until the estimator is done."""
    reading, estimating = workers
    seen = FlightProgress(legs)
    shown = 0
    beat_s = 0.0
    with screen.progress(seen.what) as advance:
        while estimating.running:
            now_s = time.monotonic()
            if now_s - beat_s >= 1.0:
                beat_s = now_s
                ground.send_heartbeat()
            while time.monotonic() - now_s < _REFRESH_S and estimating.running:
                frame = ground.receive(0.02)
                if frame is not None and frame.message.get_srcComponent() == COMPONENT_AUTOPILOT:
                    seen.see(frame.message)
                    complain(frame.message, screen)
                    if frame.message.get_type() == "HEARTBEAT" and time.monotonic() - beat_s > _BEAT_AGAIN_S:
                        beat_s = time.monotonic()  # a simulator in a hurry counts our seconds by its clock
                        ground.send_heartbeat()
            if seen.flown:
                advance(f"{seen.what}, estimating", 0, None)
            else:
                advance(seen.what, seen.flown_m, seen.total_m, seen.detail)
            for update in updates[shown:]:
                shown += 1
                if update.estimate is not None and not update.final:
                    screen.follow(under_way(update.estimate, update.newest, len(legs.lengths_m)))
            if reading.error is not None and not isinstance(reading.error, LinkError):
                return


def _problem(reading: Background, estimating: Background, *, answered: bool) -> DslamError | None:
    """What ended the flight early. A bridge that lost a vehicle which had landed is none; a bug is raised."""
    late = answered and isinstance(reading.error, LinkError)
    problem = estimating.error or (None if late else reading.error)
    if problem is None or isinstance(problem, DslamError):
        return problem
    raise problem


def _missing(readings: Readings, bridge: Bridge) -> list[str]:
    lines = []
    if bridge.missing:
        lines.append(left_out(bridge.missing, readings.name, "it has no value for that time or place"))
    if bridge.sampler.skipped:
        lines.append(left_out(bridge.sampler.skipped, readings.name, "faster than one a millisecond"))
    if bridge.sampler.unplaced:
        lines.append(left_out(bridge.sampler.unplaced, readings.name, "the vehicle's place was not heard"))
    return lines


def _facts(setup: Setup, legs: LegPlan, sent: int) -> dict[str, str]:
    return {
        "mission": f"{setup.plan_name}: {count(len(legs.lengths_m), 'leg')}, {legs.lengths_m.sum():.1f} m",
        "readings": f"{sent} from {setup.readings.name}",
        "speed": f"{setup.readings.speed_m_s:g} m/s",
    }
