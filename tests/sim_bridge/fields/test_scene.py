from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.errors import BadInputError
from sim_bridge.fields.scene import encode_scene, parse_scene, read_scene, simulate, truth

DEMO = Path(__file__).parents[3] / "sim_bridge" / "scenes" / "star7_three_sources.json"

CONTRACT: dict[str, Any] = {
    "medium": {"diffusivity_m2_s": 0.0939, "dimensions": 2, "ambient": 0.0, "static": True},
    "sources": [{"position_m": [1.0, 0.5], "amplitude": 100.0, "activation_s": -1.0}],
    "path": {"vertices_m": [[0, 0], [2, 0], [1, 1.7]]},
    "sampling": {"spacing_m": 0.0313, "speed_m_s": 1.9, "start_s": 0.0},
    "noise": {"snr_db": 20.0},
    "seed": 7,
}


def changed(**parts: Any) -> dict[str, Any]:
    """The contract's example with keys "medium__ambient" replaced (None: removed)."""
    document = json.loads(json.dumps(CONTRACT))
    for name, value in parts.items():
        *path, last = name.split("__")
        at = document
        for key in path:
            at = at[int(key)] if isinstance(at, list) else at[key]
        if value is None:
            del at[last]
        else:
            at[last] = value
    return document


def scene_of(**parts: Any) -> Any:
    return parse_scene(json.dumps(changed(**parts)).encode(), "scene.json")


def green(place: tuple[float, ...], source: dict[str, Any], mu: float, t: float) -> float:
    """Independent closed form, with math only."""
    c = 4.0 * mu * (t - source["activation_s"])
    if c <= 0.0:
        return 0.0
    r2 = sum((x - s) ** 2 for x, s in zip(place, source["position_m"], strict=True))
    return float(source["amplitude"] / (math.pi * c) ** (len(place) / 2) * math.exp(-r2 / c))


TWO = [
    {"position_m": [1.0, 0.5], "amplitude": 100.0, "activation_s": -1.0},
    {"position_m": [-0.3, 1.1], "amplitude": 40.0, "activation_s": 0.9},
]


@pytest.mark.parametrize("static", [True, False])
@pytest.mark.parametrize("dimensions", [2, 3])
def test_simulated_readings_are_the_closed_form(static: bool, dimensions: int) -> None:
    sources = [dict(s) for s in (TWO[:1] if static else TWO)]
    vertices = [[0.0, 0.0], [2.0, 0.0], [1.0, 1.7]]
    if dimensions == 3:
        sources = [s | {"position_m": [*s["position_m"], 0.2]} for s in sources]
        vertices = [[*v, 0.3 * i] for i, v in enumerate(vertices)]
    scene = scene_of(
        medium__static=static,
        medium__dimensions=dimensions,
        medium__ambient=18.5,
        sources=sources,
        path__vertices_m=vertices,
        sampling__start_s=0.25,
        noise={},
    )
    flight = simulate(scene, vertices, np.random.default_rng(0))
    flown = 0.0
    for a, b, leg in zip(vertices, vertices[1:], flight.legs, strict=False):
        length = math.dist(a, b)
        count = math.ceil(length / 0.0313)
        assert leg.length_m == pytest.approx(length)
        assert leg.reading.size == count
        for n in (0, 1, count // 2, count - 1):
            s = n * 0.0313
            t = 0.25 + (flown + s) / 1.9
            place = tuple(p + s / length * (q - p) for p, q in zip(a, b, strict=True))
            expected = 18.5 + sum(green(place, x, 0.0939, 0.25 if static else t) for x in sources)
            assert leg.distance_m[n] == pytest.approx(s, abs=1e-12)
            assert leg.time_s[n] == pytest.approx(t)
            assert leg.reading[n] == pytest.approx(expected, rel=1e-12)
        flown += length


def test_the_last_reading_lies_before_the_corner_even_if_spacing_divides_the_leg() -> None:
    scene = scene_of(sampling__spacing_m=0.1, path__vertices_m=[[0, 0], [0.3, 0], [0.3, 0.7]], noise={})
    flight = simulate(scene, [[0, 0], [0.3, 0], [0.3, 0.7]], np.random.default_rng(0))
    assert [leg.reading.size for leg in flight.legs] == [3, 7]


def test_interval_sampling_runs_on_over_the_corner() -> None:
    scene = scene_of(sampling={"interval_s": 0.1, "speed_m_s": 1.9, "start_s": 3.0}, noise={})
    flight = simulate(scene, scene.vertices(), np.random.default_rng(0))
    times = np.concatenate([leg.time_s for leg in flight.legs])
    np.testing.assert_allclose(times, 3.0 + 0.1 * np.arange(times.size), atol=1e-9)
    assert times.size == math.ceil(flight.lengths_m.sum() / 0.19)
    corner_s = 3.0 + 2.0 / 1.9
    assert flight.legs[1].distance_m[0] == pytest.approx((flight.legs[1].time_s[0] - corner_s) * 1.9)


@settings(max_examples=20, deadline=None)
@given(snr_db=st.floats(0.0, 40.0), ambient=st.floats(-50.0, 50.0), seed=st.integers(0, 1000))
def test_the_snr_asked_for_is_realised(snr_db: float, ambient: float, seed: int) -> None:
    parts = {"sampling__spacing_m": 0.001, "medium__ambient": ambient}
    clean_scene, scene = scene_of(noise={}, **parts), scene_of(noise={"snr_db": snr_db}, **parts)
    vertices = scene.vertices()
    clean = np.concatenate([g.reading for g in simulate(clean_scene, vertices, np.random.default_rng(0)).legs])
    noisy = np.concatenate([g.reading for g in simulate(scene, vertices, np.random.default_rng(seed)).legs])
    realised = 10.0 * math.log10(np.mean((clean - ambient) ** 2) / np.mean((noisy - clean) ** 2))
    assert realised == pytest.approx(snr_db, abs=0.5)  # 4000 readings: 5 sd of the sample variance


def test_noise_by_sd_and_repeatable_by_seed() -> None:
    scene = scene_of(noise={"sd": 0.3})
    vertices = scene.vertices()
    first, again, other = (simulate(scene, vertices, np.random.default_rng(s)) for s in (1, 1, 2))
    assert scene.noise_sd(vertices) == 0.3
    np.testing.assert_array_equal(first.legs[1].reading, again.legs[1].reading)
    assert not np.array_equal(first.legs[1].reading, other.legs[1].reading)


def test_truth_is_the_scene_and_the_estimator_hears_of_the_medium_only() -> None:
    scene = scene_of()
    known = truth(scene, [[0, 0], [5, 0]])
    np.testing.assert_array_equal(known.source_position_m, [[1.0, 0.5]])
    np.testing.assert_array_equal(known.amplitude, [100.0])
    np.testing.assert_array_equal(known.vertices_m, [[0, 0], [5, 0]])
    medium = scene.estimator_medium()
    assert (medium.diffusivity_m2_s, medium.static, medium.activation_s) == (0.0939, True, None)


BAD = [
    ({"sources__0__amplitude": "big"}, 'sources[0].amplitude: expected a number, got "big"'),
    ({"sources__0__amplitude": -3.0}, "sources[0].amplitude: expected a positive number, got -3"),
    ({"sources__0__amplitude": 0}, "sources[0].amplitude: expected a positive number, got 0"),
    ({"sources__0__colour": 1}, "sources[0].colour: unknown key, expected one of position_m, amplitude, act"),
    ({"wind": 1}, "wind: unknown key, expected one of medium, sources"),
    ({"medium__viscosity": 1}, "medium.viscosity: unknown key, expected one of diffusivity_m2_s"),
    ({"medium__diffusivity_m2_s": 0}, "medium.diffusivity_m2_s: expected a positive number, got 0"),
    ({"medium__dimensions": 4}, "medium.dimensions: expected 2 or 3, got 4"),
    (
        {"medium__dimensions": 3},
        "sources[0].position_m: expected 3 numbers (medium.dimensions is 3), got [1.0",
    ),
    ({"medium__static": "yes"}, 'medium.static: expected true or false, got "yes"'),
    ({"sources": []}, "sources: expected at least 1 source, got []"),
    ({"sources": None}, "sources: missing"),
    ({"sources__0__activation_s": None}, "sources[0].activation_s: missing"),
    (
        {"sources__0__activation_s": 2.0},
        "sources[0].activation_s: expected before the flight's start at 0 s, got 2",
    ),
    (
        {"sources__0__position_m": [1]},
        "sources[0].position_m: expected 2 or 3 finite numbers (metres), got [1.0]",
    ),
    ({"path__vertices_m": [[0, 0]]}, "path.vertices_m: expected at least 2 vertices, got 1"),
    ({"path__vertices_m": [[0, 0], [0, 0]]}, "path.vertices_m[1]: expected another place than vertex 0"),
    ({"path__vertices_m": [[0, 0], [1, "x"]]}, 'path.vertices_m[1][1]: expected a number, got "x"'),
    ({"path__vertices_m": [[0, 0], [1, 1, 1]]}, "path.vertices_m[1]: expected 2 numbers"),
    ({"sampling__spacing_m": -1}, "sampling.spacing_m: expected a positive number, got -1"),
    ({"sampling__spacing_m": None}, "sampling.spacing_m: expected exactly one of spacing_m and interval_s"),
    ({"sampling__interval_s": 1}, "sampling.spacing_m: expected exactly one of spacing_m and interval_s"),
    ({"sampling__speed_m_s": 0}, "sampling.speed_m_s: expected a positive number, got 0"),
    ({"noise": {"snr_db": 20, "sd": 1}}, "noise.sd: expected exactly one of snr_db and sd, got 20.0 and 1.0"),
    ({"noise": {"sd": -1}}, "noise.sd: expected 0 or more, got -1"),
    ({"seed": 1.5}, "seed: expected a whole number, got 1.5"),
    ({"seed": -1}, "seed: expected 0 or more, got -1"),
]


@pytest.mark.parametrize(("parts", "said"), BAD, ids=[said[:40] for _, said in BAD])
def test_a_wrong_scene_is_told_by_file_field_and_value(parts: dict[str, Any], said: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(changed(**parts)))
    with pytest.raises(BadInputError) as caught:
        read_scene(path)
    assert str(caught.value).startswith(f"{path}: {said}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [b"", b"{", b"[1, 2]", b"\xff\xfe", b'{"medium": 1e999}', b"nonsense\n", b'{"medium": 3', b"[" * 99999],
)
def test_what_is_no_scene_at_all_is_one_line(text: bytes, tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    path.write_bytes(text)
    with pytest.raises(BadInputError) as caught:
        read_scene(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=r"nowhere\.json: cannot be read"):
        read_scene(tmp_path / "nowhere.json")


def test_an_evolving_field_may_gain_sources_but_not_all_of_them() -> None:
    assert scene_of(medium__static=False, sources=TWO)
    with pytest.raises(BadInputError, match=r"sources\[1\]\.activation_s"):
        scene_of(medium__static=True, sources=TWO)
    with pytest.raises(BadInputError, match=r"sources\[0\]\.activation_s"):
        scene_of(medium__static=False, sources=TWO[1:])


def test_a_scene_put_into_a_log_reads_back() -> None:
    scene = scene_of()
    assert parse_scene(encode_scene(scene), "copy.json") == scene


def test_the_demonstration_scene_fits_its_path() -> None:
    scene = read_scene(DEMO)
    vertices = scene.vertices()
    flight = simulate(scene, vertices, np.random.default_rng(scene.seed))
    assert [leg.reading.size for leg in flight.legs] == [64] * 7
    spread_m = math.sqrt(4 * 0.5 * 50.0)
    assert spread_m == pytest.approx(10.0)
    inside = np.linalg.norm(scene.source_position_m - vertices[:-1].mean(axis=0), axis=1)
    assert (inside < 1.2 * spread_m).all()
