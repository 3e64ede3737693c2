"""`paper scenes`: draw scenes until the paper's method gives Table II's errors, and write the best."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dslam_mav.commands.paper_world import SceneWorld
from dslam_mav.commands.screen import Screen
from dslam_mav.experiments.chosen import Geometry, Wanted, draw, missed, penalty, place_origin
from dslam_mav.experiments.tables import ON_THE_LEG, TABLE_II, scene_of_table2
from dslam_mav.files import check_folder, write_whole
from dslam_mav.records.arrays import Array
from sim_bridge.fields.scene import Medium, Noise, PathOfScene, Sampling, Scene, Source, encode_scene

MU, SPACING_M, AMPLITUDE = 0.0939, 0.0313, 100.0  # as printed
STATIC_SPEED_M_S = 18.9697
READINGS = {0.0: (128, 256, 512), 1.65e-3: (128, 256, 512), 1.65e-2: (1024, 2048)}
"""A leg, by the sampling period: long enough that an evolving field changes little on it."""
LOUD_DB, LOUDER = 5, 4  # at such an SNR and below legs have so many times the readings
GLANCE, FLIGHTS, FINAL, FINALISTS = 5, 16, 150, 3
LEAST_ANSWERED = 0.7  # of the glance, for a scene to be flown on
Row = tuple[int, int, float, float, float]


class _Scored(NamedTuple):
    score: float
    scene: Scene
    geometry: Geometry


def run(options: Namespace) -> int:
    """Choose the scene of every row, or of the rows of one scene file."""
    screen = Screen(json_only=options.json)
    check_folder(Path(options.out))
    found = {}
    for i, row in enumerate(TABLE_II):
        name = scene_of_table2(*row[:3])
        if options.scene not in (None, name):
            continue
        best = choose(row, options.draws, np.random.default_rng((options.seed, i)))
        if best is None:
            screen.say(f"{name}: no scene of {options.draws} gives answers")
            continue
        path = Path(options.out) / f"{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, encode_scene(best.scene))
        screen.say(f"{name}: its worse error is {np.exp(best.score):.2f} times off what is printed; written {path}")
        found[name] = {"off": float(np.exp(best.score)), "file": str(path)}
    screen.result(found)
    return 0


def choose(row: Row, draws: int, rng: np.random.Generator) -> _Scored | None:
    """The best of so many draws, the leading ones flown again at length."""
    drawn = [scored for _ in range(draws) if (scored := _flown(row, _drawn(row, rng), FLIGHTS, 0)) is not None]
    leading = sorted(drawn, key=lambda scored: scored.score)[:FINALISTS]
    again = [better for one in leading if (better := _flown(row, one.geometry, FINAL, 1)) is not None]
    return min(again, key=lambda scored: scored.score, default=None)


def _drawn(row: Row, rng: np.random.Generator) -> Geometry:
    k, snr_db, period_s = row[:3]
    readings = int(rng.choice(READINGS[period_s])) * (LOUDER if snr_db <= LOUD_DB and not period_s else 1)
    return draw(rng, k, readings * SPACING_M, readings, 10.0 ** (-snr_db / 20.0), 0.03)


def _flown(row: Row, geometry: Geometry, flights: int, seed: int) -> _Scored | None:
    """The scene with its origin placed; None where too few flights have an answer."""
    world = SceneWorld(_scene(row, geometry, np.zeros(2)))
    if missed(world, ON_THE_LEG, GLANCE, seed + 1000).answered < LEAST_ANSWERED:
        return None
    rows = [Wanted(missed(world, ON_THE_LEG, flights, seed), {"E_sources": row[3], "E_lines": row[4]})]
    origin, off = place_origin(world.truth, rows)
    return _Scored(off + penalty(rows), _scene(row, geometry, origin), geometry)


def _scene(row: Row, geometry: Geometry, origin: Array) -> Scene:
    _, snr_db, period_s = row[:3]
    speed = SPACING_M / period_s if period_s else STATIC_SPEED_M_S
    born_s = round(-(geometry.spread**2) / (4.0 * MU), 6)
    sources = tuple(Source(_place(x - origin), AMPLITUDE, born_s) for x in geometry.source)
    path = PathOfScene(vertices_m=tuple(_place(x - origin) for x in geometry.vertices))
    sampling = Sampling(round(speed, 4), SPACING_M, None, 0.0)
    return Scene(Medium(MU, 2, 0.0, not period_s), sources, sampling, path, Noise(snr_db=float(snr_db)), 1)


def _place(x: Array) -> tuple[float, ...]:
    return tuple(np.round(x, 5).tolist())
