"""`--scene FILE` or `--readings FILE`: what the sensor will read, and how often, whichever it comes from."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from dslam_mav.commands.logged import open_logged
from dslam_mav.errors import BadInputError
from dslam_mav.forecast import Sensor
from dslam_mav.mission import Mission, leg_plan
from dslam_mav.records import Medium, Truth
from dslam_mav.records.arrays import Array
from dslam_mav.records.words import count
from dslam_mav.series import Series
from missions.patterns import pattern
from sim_bridge.fields.demonstration import RecordedDemo, recorded_demo
from sim_bridge.fields.field import Field
from sim_bridge.fields.frame_stack import FrameStack
from sim_bridge.fields.recorded import LoggedField, read_series
from sim_bridge.fields.scene import Scene, SceneField, encode_scene, read_scene, truth
from sim_bridge.sampling import Sampling

DEFAULT_SCENE = Path(__file__).parents[2] / "sim_bridge" / "scenes" / "star7_three_sources.json"
LEG_SPREADS = 2.6  # legs of the mission flown over a recording
READINGS_PER_LEG = 64
IN_SPACE = (
    "{}: sources in space; the estimate is of the slice flown: places on the map, amplitudes as this height sees them"
)
RECORDED_SPREAD_M = 10.0
RECORDED_LAST_FRAME = 4  # later ones of the shipped demonstration touch its edges


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """A field to read along a path, how it is sampled, and what is true of it (None: unknown).

    `medium`: what the estimator may be told of the medium. `peak`: a usual source's peak reading above ambient, where
    it is known. `notes`: what a person must be told. `before_s`: how often it is read before the first leg as well;
    None where what was recorded tells nothing of then.
    """

    field: Field
    sampling: Sampling
    noise_sd: float
    rng: np.random.Generator
    speed_m_s: float
    vertices_m: Array
    truth: Truth | None
    medium: Medium | None
    name: str
    attachment: tuple[str, str, bytes] | None = None
    peak: float | None = None
    notes: tuple[str, ...] = ()
    before_s: float | None = None

    @property
    def sensor(self) -> Sensor:
        """What is known of it before take-off."""
        spacing_m = self.sampling.spacing_m or (self.sampling.interval_s or 0.0) * self.speed_m_s
        return Sensor(1.0 / spacing_m, self.noise_sd, self.peak, self.speed_m_s)


def places_m(mission: Mission) -> Array:
    """(V, 3) where a mission's path turns: metres east and north of home, and up as its waypoints say."""
    legs = leg_plan(mission)
    heights_m = [mission.items[seq].z for seq in legs.sequence]
    return np.column_stack([legs.vertices_m, np.array(heights_m, dtype=np.float64)])


def left_out(number: int, name: str, why: str) -> str:
    """A warning of readings that were not sent."""
    return f"{name}: {count(number, 'reading')} left out, {why}"


Along = Callable[[Array | None, float | None], Readings]
"""A plan's vertices and speed -> the readings along it; along the source's own path without a plan."""


def open_readings(options: Namespace, vertices_m: Array | None, speed_m_s: float | None) -> Readings:
    """The readings the options ask for along the plan's vertices, or along the source's own path without a plan."""
    return source_of_readings(options)(vertices_m, speed_m_s)


def source_of_readings(options: Namespace) -> Along:
    """The file the options name, read: what is wrong with it is known before there is a path."""
    if options.scene and options.readings:
        raise BadInputError("--scene and --readings: expected one of them, got both")
    path = Path(options.readings or options.scene or DEFAULT_SCENE)
    frames = bool(options.readings) and path.suffix.lower() == ".npz"
    series = bool(options.readings) and not frames
    for name, applies, kind in (
        ("frames", frames, "a .npz"), ("copies", frames, "a .npz"), ("columns", series, "a .csv, .tlog or .mcap"),
    ):  # fmt: skip
        if getattr(options, name) is not None and not applies:
            raise BadInputError(
                f"--{name} {getattr(options, name)}: expected with --readings of {kind}, got {path.name}"
            )
    along = (_series if series else _frames if frames else _scene)(path, options)

    def checked(vertices_m: Array | None, speed_m_s: float | None) -> Readings:
        readings = along(vertices_m, speed_m_s)
        try:
            readings.sampling.check(readings.speed_m_s)
        except BadInputError as problem:
            raise BadInputError(f"{path}: {problem}") from None
        return readings

    return checked


def _scene(path: Path, options: Namespace) -> Along:
    return partial(_from_scene, path, read_scene(path), options.seed)


def _frames(path: Path, options: Namespace) -> Along:
    stack = FrameStack.read(path)
    first, last = 0, min(RECORDED_LAST_FRAME, len(stack.time_s) - 1)
    if options.frames is not None:
        first, last = _first_and_last(options.frames, path)
    copies = options.copies or (options.sources if isinstance(options.sources, int) else 2)
    return partial(_from_frames, path, stack, (first, last), copies, options.seed or 0)


def _series(path: Path, options: Namespace) -> Along:
    return partial(_from_series, path, read_series(path, options.columns))


def _from_scene(
    path: Path, scene: Scene, given_seed: int | None, vertices_m: Array | None, speed_m_s: float | None
) -> Readings:
    own = scene.vertices()
    vertices = vertices_m if vertices_m is not None else own
    if vertices is None:
        raise BadInputError(f"{path}: path: no vertices_m and no plan was given: there is nothing to fly")
    vertices = vertices[:, : scene.medium.dimensions]
    seed = scene.seed if given_seed is None else given_seed
    known = truth(scene, vertices)
    speed_m_s = speed_m_s or scene.sampling.speed_m_s
    interval_s = scene.sampling.interval_s or (scene.sampling.spacing_m or 0.0) / speed_m_s
    flat = Truth(known.source_position_m[:, :2], known.amplitude, known.vertices_m[:, :2])
    return Readings(
        field=SceneField(scene),
        sampling=Sampling(scene.sampling.spacing_m, scene.sampling.interval_s),
        noise_sd=scene.noise_sd(vertices),
        rng=np.random.default_rng(seed),
        speed_m_s=speed_m_s,
        vertices_m=vertices,
        truth=flat if scene.medium.dimensions == 2 else None,
        medium=scene.estimator_medium(),
        name=path.name,
        attachment=("scene.json", "application/json", encode_scene(scene)),
        peak=scene.usual_peak(),
        notes=(IN_SPACE.format(path.name),) if scene.medium.dimensions == 3 else (),
        before_s=interval_s,
    )


def _from_frames(
    path: Path,
    stack: FrameStack,
    frames: tuple[int, int],
    copies: int,
    seed: int,
    vertices_m: Array | None,
    speed_m_s: float | None,
) -> Readings:
    first, last = frames
    leg_m = LEG_SPREADS * RECORDED_SPREAD_M
    vertices = pattern("star7", leg_m, centre_m=(0.0, 0.0)) if vertices_m is None else vertices_m[:, :2]
    speed = speed_m_s or 5.0
    length_m = float(np.linalg.norm(np.diff(vertices, axis=0), axis=1).sum())
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    demo = recorded_demo(
        stack,
        sources=copies,
        seed=seed,
        frame=first,
        spread_m=RECORDED_SPREAD_M,
        middle_m=(float(middle[0]), float(middle[1])),
        until_frame=None if last == first else last,
        flight_s=length_m / speed,
    )
    demo.field.check_inside(vertices)
    return Readings(
        field=demo.field,
        sampling=Sampling(spacing_m=leg_m / READINGS_PER_LEG),
        noise_sd=0.0,
        rng=np.random.default_rng(seed),
        speed_m_s=speed,
        vertices_m=vertices,
        truth=demo.truth(vertices),
        medium=Medium(ambient=None, static=first == last),
        name=path.name,
        notes=(_what_was_made(path, demo, copies, first, last),),
    )


def _what_was_made(path: Path, demo: RecordedDemo, copies: int, first: int, last: int) -> str:
    frames = f"frame {first}" if first == last else f"frames {first} to {last} running during the flight"
    scale = demo.recorded_m_per_m
    lengths = f"1 m flown is {scale * 1e6:.3g} µm recorded" if np.isfinite(scale) else "no scale was recorded"
    return (
        f"{path.name}, {frames}: {copies} shifted copies added, lengths scaled so that √C is "
        f"{demo.spread_m:g} m at the start ({lengths}); truth is the centre fitted to the recording's own frame"
    )


def _first_and_last(text: str, path: Path) -> tuple[int, int]:
    parts = text.split(":")
    if len(parts) > 2 or not all(part.isdigit() for part in parts):
        raise BadInputError(f"{path}: --frames {text!r}: expected N or FIRST:LAST")
    return int(parts[0]), int(parts[-1])


def _from_leg_1(path: Path, series: Series) -> Series:
    """A flight's readings from its first leg on: those of before were read standing, or on the way. A log knows where
    it began, a table of times below zero counts from there.
    """
    begun_s = _leg_1_begun_s(path) if path.suffix.lower() == ".mcap" else 0.0
    own = series.time_s >= begun_s
    return replace(series, time_s=series.time_s[own], value=series.value[own]) if own.sum() > 1 else series


def _leg_1_begun_s(path: Path) -> float:
    try:
        return open_logged(path, Namespace()).replayed.legs[0].zero_ms / 1000.0
    except BadInputError:
        return -np.inf  # a log without legs


def _from_series(path: Path, series: Series, vertices_m: Array | None, speed_m_s: float | None) -> Readings:
    series = _from_leg_1(path, series)
    if vertices_m is None:
        raise BadInputError(f"{path}: logged readings have no path of their own: give a PLAN to fly")
    speed = speed_m_s or 5.0
    interval_s = float(np.median(np.diff(series.time_s)))
    try:
        sampling = Sampling(interval_s=interval_s)
    except BadInputError as problem:
        raise BadInputError(f"{path}: {problem}") from None
    return Readings(
        field=LoggedField(series),
        sampling=sampling,
        noise_sd=0.0,
        rng=np.random.default_rng(0),
        speed_m_s=speed,
        vertices_m=vertices_m,
        truth=None,
        medium=None,
        name=path.name,
        notes=(f"{path.name}: {count(series.value.size, 'reading')} over {series.duration_s:.1f} s, played by time",),
    )
