"""The scenes of a sweep: read from files, or drawn at random."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec

from dslam_mav.commands.sweep_parts import Sampling as Asked
from dslam_mav.commands.sweep_parts import Scenes
from dslam_mav.dslam.layouts import Prior, Region, drawn
from dslam_mav.errors import BadInputError
from dslam_mav.sweep.points.seeds import generator
from sim_bridge.fields.scene import Medium, Sampling, Scene, Source, read_scene

SPACINGS = 20.0  # readings on a √C, where nothing is said
SPEED_M_S = 5.0
AREA_SPREADS = 3.2
AGE_S = 1.0  # of a field that stands still: only its √C counts


def scenes_of(scenes: Scenes, sampling: Asked | None, file: Path) -> list[tuple[str, Scene]]:
    """Names and scenes, each beginning at time 0 and read as `sampling` says; BadInputError names `file`."""
    named = _files(scenes, file) if scenes.files is not None else _random(scenes, file)
    return named if sampling is None else [(name, _sampled(scene, sampling)) for name, scene in named]


def _files(scenes: Scenes, file: Path) -> list[tuple[str, Scene]]:
    """Scenes of files, named by path relative to the sweep's file; every one begins at time 0."""
    paths: dict[Path, None] = {}
    for asked in scenes.files or ():
        found = sorted(file.parent.glob(asked)) if not Path(asked).is_absolute() else [Path(asked)]
        if not found:
            raise BadInputError(f"{file}: scenes.files: {asked}: no such file beside it")
        paths.update(dict.fromkeys(found))
    named = []
    for path in paths:
        scene = read_scene(path)
        if scene.medium.dimensions != 2:
            raise BadInputError(f"{path}: medium.dimensions: expected 2 in a sweep, got {scene.medium.dimensions}")
        name = path.relative_to(file.parent) if path.is_relative_to(file.parent) else path
        named.append((name.as_posix(), _from_zero(scene, path)))
    return named


def _from_zero(scene: Scene, path: Path) -> Scene:
    """The same with its first reading at time 0."""
    start_s = scene.sampling.start_s
    sources = []
    for k, source in enumerate(scene.sources):
        if source.activation_s >= start_s:
            raise BadInputError(
                f"{path}: sources[{k}].activation_s: expected before the flight's start at {start_s:g} s in a sweep, "
                f"got {source.activation_s:g}"
            )
        sources.append(msgspec.structs.replace(source, activation_s=source.activation_s - start_s))
    sampling = msgspec.structs.replace(scene.sampling, start_s=0.0)
    return msgspec.structs.replace(scene, sources=tuple(sources), sampling=sampling)


def _random(scenes: Scenes, file: Path) -> list[tuple[str, Scene]]:
    """`random` scenes of each number of sources; each is drawn by itself, so that more scenes change none."""
    low, high = scenes.spreads_m
    usual = math.sqrt(low * high)
    east, north = scenes.area_m or (AREA_SPREADS * usual, AREA_SPREADS * usual)
    region = Region((-0.5 * east, -0.5 * north), (0.5 * east, 0.5 * north))
    named = []
    for k in scenes.k_sources:
        prior = Prior(
            (k, k), (low, high), region, 0.0, scenes.peak, apart_m=scenes.min_separation_m, ratio=scenes.amplitude_ratio
        )
        for i in range(scenes.random or 0):
            named.append((f"random k{k} {i + 1}", _scene(scenes, prior, i, usual / SPACINGS, file)))
    return named


def _scene(scenes: Scenes, prior: Prior, i: int, spacing_m: float, file: Path) -> Scene:
    try:
        (layout,) = drawn(prior, 1, generator(scenes.seed, "scene", prior.k_sources[0], i))
    except ValueError as problem:
        raise BadInputError(f"{file}: scenes: {problem}; expected a larger area_m or less min_separation_m") from None
    c = float(layout.spread_m[0]) ** 2
    rate = scenes.diffusivity_m2_s
    age_s, mu = (AGE_S, 0.25 * c / AGE_S) if rate is None else (0.25 * c / rate, rate)
    sources = tuple(
        Source((float(x), float(y)), float(peak) * math.pi * c, -age_s)
        for (x, y), peak in zip(layout.places[0], layout.peak[0], strict=True)
    )
    medium = Medium(mu, ambient=scenes.ambient, static=rate is None)
    return Scene(medium, sources, Sampling(SPEED_M_S, spacing_m))


def _sampled(scene: Scene, s: Asked) -> Scene:
    """The scene read as the sweep says, and as it is where that says nothing."""
    spacing_m, interval_s = s.spacing_m, s.interval_s
    if spacing_m is None and interval_s is None:
        spacing_m, interval_s = scene.sampling.spacing_m, scene.sampling.interval_s
    read = Sampling(s.speed_m_s or scene.sampling.speed_m_s, spacing_m, interval_s)
    return msgspec.structs.replace(scene, sampling=read)
