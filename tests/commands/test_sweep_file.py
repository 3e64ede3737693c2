"""The file of a sweep: what is refused, in one line; what it comes to; every key is in the help."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from running import SCENE, run
from sweep_files import SMALL, written

from dslam_mav import Medium
from dslam_mav.commands.sweep_file import KEYS, read_sweep
from dslam_mav.commands.sweep_job import SceneJob, told_of
from dslam_mav.commands.sweep_options import KEYS as HELP
from dslam_mav.commands.sweep_points import Points, points_of

RANDOM, STAR, NOISE = "[scenes]\nrandom = 2\n", '[[missions]]\npattern = "star7"\nleg_m = 32\n', "[noise]\nsd = 0.1\n"


def points(folder: Path, text: str) -> Points:
    path = written(folder, text)
    return points_of(read_sweep(path), path)


def keys(found: Points) -> dict[tuple[object, ...], str]:
    return {tuple(job.coordinates.values()): job.key for job in found.jobs}


REFUSED = [
    ("", "scenes: expected exactly one of scenes and logs"),
    ("seeds = [", "expected TOML, got something else: "),
    ("seed = 1\n" + RANDOM, "seed: unknown key, expected one of scenes, missions, "),
    ('[scenes]\ncolour = "red"\n', "scenes.colour: unknown key, expected one of files, random, "),
    (RANDOM + STAR + "legs_m = 3\n", "missions[0].legs_m: unknown key, expected one of pattern, leg_m, "),
    ("[scenes]\n", "scenes.files: expected exactly one of files and random"),
    ('[scenes]\nfiles = ["*.json"]\nsources = 3\n', "scenes.sources: is of random scenes; expected without files"),
    ("[scenes]\nrandom = 0\n", "scenes.random: expected a whole number, 1 or more, got 0"),
    (RANDOM + "sources = [2, 9]\n", "scenes.sources[1]: expected a whole number from 1 to 8, got 9"),
    (RANDOM + "sources = [2, 2]\n", "scenes.sources[1]: expected each but once, got 2 again"),
    (RANDOM + "area_m = [3]\n", "scenes.area_m"),
    (RANDOM + "area_m = [3, -1]\n", "scenes.area_m: expected a positive number, got -1"),
    (RANDOM + "spread_m = [12, 8]\n", "scenes.spread_m: expected a positive number or [least, most], got (12.0, 8.0)"),
    (RANDOM + "spread_m = nan\n", "scenes.spread_m: expected a positive number or [least, most], got nan"),
    (RANDOM + 'peak = "high"\n', 'scenes.peak: expected a number, got "high"'),
    (RANDOM + "amplitude_ratio = 0.5\n", "scenes.amplitude_ratio: expected 1 or more, got 0.5"),
    (RANDOM + "area_m = [5, 5]\nsources = 4\n" + STAR + NOISE, "scenes: 4 sources 8 m apart do not fit into 5 × 5 m"),
    (RANDOM + NOISE, "missions: missing, random scenes have none of their own"),
    (RANDOM + STAR, "noise: missing, random scenes have none of their own"),
    (RANDOM + STAR + "[noise]\n", "noise.snr_db: expected exactly one of snr_db and sd"),
    (RANDOM + STAR + "[noise]\nsnr_db = [20, 20.0]\n", "noise.snr_db[1]: expected each but once, got 20.0 again"),
    (RANDOM + STAR + "[noise]\nsd = -0.1\n", "noise.sd: expected 0 or more, got -0.1"),
    (RANDOM + STAR + "[noise]\nsnr_db = []\n", "noise.snr_db: expected a finite number, got []"),
    (RANDOM + '[[missions]]\npattern = "star7"\n' + NOISE, "missions[0].leg_m: missing"),
    (
        RANDOM + "[[missions]]\nleg_m = 3\n" + NOISE,
        "missions[0].pattern: expected exactly one of pattern, plan and path",
    ),
    (RANDOM + '[[missions]]\nplan = "a.plan"\nlegs = 3\n' + NOISE, "missions[0].legs: is of a pattern; expected with"),
    (RANDOM + '[[missions]]\nplan = "a.plan"\n' + NOISE, "a.plan: cannot be read: no such file"),
    (RANDOM + '[[missions]]\npath = "scene"\n' + NOISE, "missions: scene random k2 1 has no path of its own"),
    (RANDOM + '[[missions]]\npattern = "star9"\nleg_m = 3\n' + NOISE, "missions[0]: pattern 'star9': expected one of"),
    (RANDOM + '[[missions]]\npattern = "best"\nleg_m = 3\n' + NOISE, "make it by dslam-mav plan --pattern best"),
    (RANDOM + STAR + STAR + NOISE, "missions: two are called 'star7 32 m'; give one of them another name"),
    (RANDOM + STAR + NOISE + "[sampling]\nspacing_m = 0\n", "sampling.spacing_m: expected a positive number, got 0"),
    (RANDOM + STAR + NOISE + '[estimate]\nmethods = ["guess"]\n', "estimate.methods: expected joint or paper, got 'gu"),
    (
        RANDOM + STAR + NOISE + '[estimate]\nn_sources = "all"\n',
        'estimate.n_sources: expected "true", "auto" or 1 to 8',
    ),
    (RANDOM + STAR + NOISE + '[estimate]\nknown = ["mu"]\n', "estimate.known: expected one of spread, diffusivity, "),
    (
        RANDOM + "diffusivity_m2_s = 1\n" + STAR + NOISE + '[estimate]\nknown = ["spread"]\n',
        "estimate.known: spread: scene random k2 1 evolves; expected diffusivity and activation",
    ),
    (
        RANDOM + STAR + NOISE + '[estimate]\nmethods = ["paper"]\nheading_sd_deg = 5\n',
        "estimate.heading_sd_deg: expected without the method paper",
    ),
    ("seeds = [-1]\n" + RANDOM + STAR + NOISE, "seeds: expected a whole number from 0 to 2^63 - 1, got -1"),
    ("[scenes]\nfiles = []\n", "scenes.files: expected names of scene files, got []"),
    ('[scenes]\nfiles = ["no/*.json"]\n', "scenes.files: no/*.json: no such file beside it"),
    ('[logs]\nfolder = "."\n', "logs.folder: "),
    ('[logs]\nfolder = "."\n[noise]\nsd = 0.1\n', "noise: expected without logs"),
    ('[logs]\nfolder = "."\n[assume]\nmu = 1\n', "assume.mu: unknown key, expected one of sources, spread, "),
    ('[logs]\nfolder = "."\n[assume]\nclosed = 1\n', "assume.closed: expected true or false, got 1"),
    ('[logs]\nfolder = "."\n[assume]\nsources = 99\n', "assume: argument --sources: '99': expected a whole number"),
]


@pytest.mark.parametrize(("text", "complaint"), REFUSED, ids=[complaint[:40] for _, complaint in REFUSED])
def test_what_cannot_be_is_refused_in_one_line(tmp_path, text, complaint):
    path = written(tmp_path, text)
    if "[assume]" in text:
        (tmp_path / "a.mcap").touch()
    done = run("sweep", path, "--out", tmp_path / "out")
    assert done.code == 2
    assert done.line().startswith(f"dslam-mav: {path}: ")
    assert complaint in done.line()
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_not_there_is_refused(tmp_path):
    done = run("sweep", tmp_path / "none.toml")
    assert (done.code, done.line()) == (
        2,
        f"dslam-mav: {tmp_path}/none.toml: cannot be read: no such file or directory",
    )


def test_every_key_is_in_the_help():
    text = run("sweep", "--help").out
    assert HELP in text
    assert "example: dslam-mav sweep docs/examples/sweep.toml" in text
    for table, names in KEYS.items():
        for name in names:
            assert re.search(rf"^ *\[*{name}( =|\])", text, re.MULTILINE), f"{table}.{name}"


def test_points_are_the_product_of_what_is_listed(tmp_path):
    found = points(tmp_path, SMALL)
    assert found.words == "2 scenes × 2 missions × 2 noise levels × 1 method × 2 seeds = 16 points"
    assert len(set(keys(found).values())) == len(found.jobs) == 16
    assert next(iter(keys(found))) == ("random k2 1", "star5 40 m", "25 dB", "joint", 3)


def test_adding_to_a_sweep_changes_no_point_of_it(tmp_path):
    before = keys(points(tmp_path, SMALL))
    more = SMALL.replace("random = 2", "random = 4").replace("sources = 2", "sources = [3, 2]")
    more = more.replace("[25, 35]", "[15, 35, 25]").replace("seeds = [3, 4]", "seeds = [4, 9, 3]")
    more += '[[missions]]\npattern = "star7"\nleg_m = 32\n[estimate]\nmethods = ["paper", "joint"]\n'
    after = keys(points(tmp_path, more))
    assert len(after) == 8 * 3 * 3 * 3 * 2
    assert {at: after[at] for at in before} == before


@pytest.mark.parametrize("change", ["[sampling]\nspeed_m_s = 6\n", '[estimate]\nknown = ["ambient"]\n'])
def test_points_of_other_flights_or_assumptions_are_other_points(tmp_path, change):
    assert not set(keys(points(tmp_path, SMALL)).values()) & set(keys(points(tmp_path, SMALL + change)).values())


@settings(deadline=None, max_examples=60)
@given(
    k=st.integers(1, 4), low=st.floats(1.0, 20.0), wider=st.floats(1.0, 1.5), ratio=st.floats(1.0, 20.0),
    apart=st.floats(0.1, 0.5), seed=st.integers(0, 1000),
)  # fmt: skip
def test_random_scenes_keep_what_the_file_says(tmp_path_factory, k, low, wider, ratio, apart, seed):
    folder = tmp_path_factory.mktemp("random")
    text = (
        f"[scenes]\nrandom = 3\nsources = {k}\nspread_m = [{low!r}, {low * wider!r}]\nseed = {seed}\n"
        f"area_m = [{4.0 * low!r}, {3.0 * low!r}]\nmin_separation_m = {apart * low!r}\namplitude_ratio = {ratio!r}\n"
    )
    for job in points(folder, text + STAR + NOISE).jobs:
        assert isinstance(job, SceneJob)
        scene = job.place.scene
        places, amplitude = scene.source_position_m, scene.amplitude
        assert len(places) == k
        assert (np.abs(places) <= [2.0 * low, 1.5 * low]).all()
        gaps = np.linalg.norm(places[:, None] - places, axis=2)[~np.eye(k, dtype=bool)]
        assert gaps.min(initial=np.inf) >= apart * low
        assert amplitude.max() / amplitude.min() <= ratio * (1.0 + 1e-9)
        spread = np.sqrt(-4.0 * scene.medium.diffusivity_m2_s * scene.activation_s)
        assert ((spread >= low * (1.0 - 1e-9)) & (spread <= low * wider * (1.0 + 1e-9))).all()


@pytest.mark.parametrize(
    ("estimate", "n_sources", "medium"),
    [
        ("", 3, Medium(spread_m=10.0, static=True)),
        ('n_sources = "auto"', None, Medium(spread_m=10.0, static=True)),
        ("n_sources = 2\nknown = []", 2, Medium(activation_s="shared", static=True, ambient=None)),
        ('known = ["diffusivity", "ambient"]', 3, Medium(25.0, activation_s="shared", static=True)),
    ],
)
def test_the_estimator_is_told_what_the_file_says_and_no_more(tmp_path, estimate, n_sources, medium):
    text = "[scenes]\nrandom = 1\nsources = 3\n" + STAR + NOISE + f"[estimate]\nclosed = true\n{estimate}\n"
    (job,) = points(tmp_path, text).jobs
    assert isinstance(job, SceneJob)
    told = told_of(job.place.scene, job.place.vertices_m, job.told, "joint")
    assert (told.n_sources, told.closed) == (n_sources, True)
    assert {name: getattr(told.medium, name) for name in ("activation_s", "ambient", "static")} == {
        name: getattr(medium, name) for name in ("activation_s", "ambient", "static")
    }
    for name in ("diffusivity_m2_s", "spread_m"):
        wanted = getattr(medium, name)
        assert getattr(told.medium, name) == (None if wanted is None else pytest.approx(wanted))


def test_scene_files_are_found_beside_the_file_and_begin_at_time_zero(tmp_path):
    late = json.loads(json.dumps(SCENE))
    late["sampling"]["start_s"] = 100.0
    for source in late["sources"]:
        source["activation_s"] = 87.5
    for name, scene in (("b", SCENE), ("a", late)):
        (tmp_path / "scenes").mkdir(exist_ok=True)
        (tmp_path / "scenes" / f"{name}.json").write_text(json.dumps(scene))
    found = points(tmp_path, '[scenes]\nfiles = ["scenes/*.json"]\n')
    assert [tuple(job.coordinates.values()) for job in found.jobs] == [
        (f"scenes/{name}.json", "scene's path", "scene's own", "joint", 0) for name in "ab"
    ]
    first, second = (job.place.scene for job in found.jobs if isinstance(job, SceneJob))
    assert first == second
    scene = json.loads(json.dumps(SCENE))
    scene["sources"][1]["activation_s"] = 5.0
    scene["medium"]["static"] = False
    (tmp_path / "scenes" / "c.json").write_text(json.dumps(scene))
    done = run("sweep", written(tmp_path, '[scenes]\nfiles = ["scenes/*.json"]\n'))
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert "c.json: sources[1].activation_s: expected before the flight's start at 0 s in a sweep, got 5" in done.err
