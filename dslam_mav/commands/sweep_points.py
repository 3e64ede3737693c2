"""From the file of a sweep to its points."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from dslam_mav.commands.sweep_assume import assumed
from dslam_mav.commands.sweep_file import Sweep
from dslam_mav.commands.sweep_job import LogJob, Place, SceneJob, known_of, medium_told, versions
from dslam_mav.commands.sweep_parts import TRUE, Mission
from dslam_mav.commands.sweep_scenes import scenes_of
from dslam_mav.errors import BadInputError, unreadable
from dslam_mav.mission import leg_vertices
from dslam_mav.records.arrays import Array
from dslam_mav.records.words import count
from dslam_mav.sweep.job import Job
from dslam_mav.sweep.points.columns import OF_LOGS, OF_SCENES, RESULTS, SECONDS, Column, Row
from dslam_mav.sweep.points.seeds import key_of
from dslam_mav.sweep.points.summary import LEVELS, Group, grouped
from missions.patterns import pattern
from missions.plan_file import read_plan
from sim_bridge.fields.scene import Noise, Scene, encode_scene

LOG_ENDINGS = (".mcap", ".tlog", ".bin")


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """All jobs of a sweep in their order, the columns of their rows, and their number in words."""

    jobs: list[Job]
    columns: tuple[Column, ...]
    words: str
    of_logs: bool = False

    def groups(self, rows: Sequence[Row]) -> list[Group]:
        """The rows by mission, noise and method; of logs by method."""
        return grouped(rows, ("method",) if self.of_logs else LEVELS)


def points_of(sweep: Sweep, file: Path) -> Points:
    """The points; BadInputError names `file` and what of it cannot be, or another file it names."""
    return _logs(sweep, file) if sweep.logs is not None else _simulated(sweep, file)


def _simulated(sweep: Sweep, file: Path) -> Points:
    assert sweep.scenes is not None
    scenes = scenes_of(sweep.scenes, sweep.sampling, file)
    _told_checked(scenes, sweep, file)
    missions = _missions(sweep.missions or [Mission(path="scene")], file)
    levels = _levels(sweep)
    jobs: list[Job] = []
    for name, scene in scenes:
        for mission, vertices in missions:
            path = vertices if vertices is not None else scene.vertices()
            if path is None:
                raise BadInputError(f"{file}: missions: scene {name} has no path of its own; give a pattern or a plan")
            for label, noise in levels:
                place = Place(scene if noise is None else msgspec.structs.replace(scene, noise=noise), path)
                jobs += _jobs(sweep, place, {"scene": name, "mission": mission, "noise": label})
    counts = {
        "scene": len(scenes), "mission": len(missions), "noise level": len(levels),
        "method": len(sweep.estimate.methods), "seed": len(sweep.seeds),
    }  # fmt: skip
    return Points(jobs, (*OF_SCENES, *RESULTS, SECONDS), _words(counts))


def _jobs(sweep: Sweep, place: Place, at: dict[str, str]) -> list[Job]:
    """Of all methods and seeds at one place."""
    told = msgspec.to_builtins(sweep.estimate) | {"methods": []}
    content = [encode_scene(place.scene).decode(), place.vertices_m.tolist(), told, versions()]
    jobs: list[Job] = []
    for method in sweep.estimate.methods:
        for seed in sweep.seeds:
            coordinates = {**at, "method": method, "seed": seed}
            key = key_of([content, coordinates])
            jobs.append(SceneJob(key, coordinates, place, sweep.estimate, method, seed))  # type: ignore[arg-type]
    return jobs


def _missions(asked: Sequence[Mission], file: Path) -> list[tuple[str, Array | None]]:
    """Names and vertices (L+1, 2); None: the scene's own path."""
    named: list[tuple[str, Array | None]] = []
    for i, mission in enumerate(asked):
        try:
            named += _mission(mission, file)
        except BadInputError as problem:
            raise BadInputError(f"{file}: missions[{i}]: {problem}") from None
    for i, (name, _) in enumerate(named):
        if name in [other for other, _ in named[:i]]:
            raise BadInputError(f"{file}: missions: two are called {name!r}; give one of them another name")
    return named


def _mission(mission: Mission, file: Path) -> list[tuple[str, Array | None]]:
    if mission.path is not None:
        return [(mission.name or "scene's path", None)]
    if mission.plan is not None:
        vertices = leg_vertices(read_plan(file.parent / mission.plan).mission)
        if len(vertices) < 2:
            raise BadInputError(f"{mission.plan}: expected at least 2 waypoints, got {len(vertices)}")
        return [(mission.name or Path(mission.plan).stem, vertices)]
    if mission.pattern == "best":
        raise BadInputError("pattern 'best': expected its plan: make it by dslam-mav plan --pattern best -o best.plan")
    made: list[tuple[str, Array | None]] = []
    for leg_m in mission.legs_m:
        name = mission.name or f"{mission.pattern} {leg_m:g} m"
        vertices = pattern(
            str(mission.pattern),
            leg_m,
            legs=mission.legs,
            heading_rad=math.radians(mission.heading_deg),
            centre_m=mission.centre_m,
            rng=np.random.default_rng(0),
        )
        made.append((name, vertices))
    return made


def _levels(sweep: Sweep) -> list[tuple[str, Noise | None]]:
    if sweep.noise is None:
        return [("scene's own", None)]
    return [
        (f"{value:.12g} dB" if kind == "snr_db" else f"sd {value:.12g}", Noise(**{kind: value}))
        for kind, value in sweep.noise.levels
    ]


def _told_checked(scenes: Sequence[tuple[str, Scene]], sweep: Sweep, file: Path) -> None:
    """BadInputError where what is told does not go together."""
    for name, scene in scenes:
        known = known_of(scene, sweep.estimate)
        if "spread" in known and not scene.medium.static:
            raise BadInputError(
                f"{file}: estimate.known: spread: scene {name} evolves; expected diffusivity and activation"
            )
        if isinstance(medium_told(scene, known).activation_s, tuple) and sweep.estimate.n_sources != TRUE:
            raise BadInputError(
                f"{file}: estimate.n_sources: expected {TRUE!r} where the sources of scene {name} have activation "
                f"times of their own and known, got {sweep.estimate.n_sources!r}"
            )


def _logs(sweep: Sweep, file: Path) -> Points:
    assert sweep.logs is not None
    folder = file.parent / sweep.logs.folder
    # a log that a link leads to as well counts once
    paths = [p for p in sorted(folder.rglob("*"), reverse=True) if p.suffix.lower() in LOG_ENDINGS and p.is_file()]
    found = {path.resolve(): path for path in paths}
    if not found:
        raise BadInputError(f"{file}: logs.folder: {folder}: no {' or '.join(LOG_ENDINGS)} in it")
    jobs: list[Job] = []
    for path in sorted(found.values()):
        name = path.relative_to(folder).as_posix()
        content = _content(path)
        for method in sweep.logs.methods:
            options = assumed(sweep.assume or {}, method, file)
            key = key_of([name, content, vars(options), versions()])
            jobs.append(LogJob(key, {"log": name, "method": method}, path, options))
    return Points(
        jobs,
        (*OF_LOGS, *RESULTS, SECONDS),
        _words({"log": len(found), "method": len(sweep.logs.methods)}),
        of_logs=True,
    )


def _content(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as problem:
        raise unreadable(path, problem) from None


def _words(counts: dict[str, int]) -> str:
    product = " × ".join(count(number, name) for name, number in counts.items())
    return f"{product} = {count(math.prod(counts.values()), 'point')}"
