from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.dslam.field import field
from dslam_mav.errors import BadInputError
from missions.patterns import pattern
from sim_bridge.fields.demonstration import recorded_demo
from sim_bridge.fields.frame_field import Copy, FilmClock, FrameField
from sim_bridge.fields.frame_stack import FrameStack

DATA = Path(__file__).parents[4] / "shared" / "data"
recorded = pytest.mark.skipif(not DATA.is_dir(), reason="needs the recordings in ../shared/data")

PIXELS = (96, 120)


def gaussian(column: float, row: float, spread: float, peak: float = 0.6, ambient: float = 0.02) -> np.ndarray:
    rows, columns = np.mgrid[: PIXELS[0], : PIXELS[1]].astype(float)
    return ambient + peak * np.exp(-((columns - column) ** 2 + (rows - row) ** 2) / spread**2)


@settings(max_examples=25, deadline=None)
@given(
    column=st.floats(30, 90),
    row=st.floats(25, 70),
    spread=st.floats(6, 20),
    ambient=st.floats(-0.5, 0.5),
    seed=st.integers(0, 999),
)
def test_the_fit_finds_a_noisy_spot_between_dead_pixels(
    column: float, row: float, spread: float, ambient: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    image = gaussian(column, row, spread, ambient=ambient) + 0.01 * rng.standard_normal(PIXELS)
    image[rng.integers(0, PIXELS[0], 20), rng.integers(0, PIXELS[1], 20)] = ambient - 0.8
    fit = FrameStack(image[None], [0.0]).fit(0)
    assert fit.column_px == pytest.approx(column, abs=0.02 * spread)
    assert fit.row_px == pytest.approx(row, abs=0.02 * spread)
    assert fit.spread_px == pytest.approx(spread, rel=0.03)
    assert fit.peak == pytest.approx(0.6, abs=0.02)
    assert fit.ambient == pytest.approx(ambient, abs=0.02)


def test_interpolation_in_space_is_good_to_a_hundred_thousandth() -> None:
    stack = FrameStack(gaussian(60.3, 47.8, 15.0)[None], [0.0])
    rng = np.random.default_rng(1)
    column, row = rng.uniform(0, 119, 5000), rng.uniform(0, 95, 5000)
    true = 0.02 + 0.6 * np.exp(-((column - 60.3) ** 2 + (row - 47.8) ** 2) / 15.0**2)
    assert np.abs(stack.at(0, column, row) - true).max() < 1e-5 * 0.6


def test_interpolation_in_time_is_linear_between_frames_and_still_outside() -> None:
    stack = FrameStack(np.stack([np.full(PIXELS, v) for v in (1.0, 2.0, 6.0)]), [0.0, 10.0, 30.0])
    clock = FilmClock(0, 2, flight_s=60.0)  # 30 recorded seconds in 60 flown
    frame = clock.frame(stack, np.array([-5.0, 0.0, 10.0, 20.0, 40.0, 60.0, 99.0]))
    value = stack.at(frame, np.full(7, 5.0), np.full(7, 5.0))
    np.testing.assert_allclose(value, [1.0, 1.0, 1.5, 2.0, 4.0, 6.0, 6.0])
    held = FilmClock(1, 1).frame(stack, np.array([0.0, 50.0]))
    np.testing.assert_array_equal(held, [1.0, 1.0])


def test_copies_are_added_scaled_and_turned_north_up() -> None:
    stack = FrameStack(gaussian(60.0, 47.0, 12.0)[None], [0.0])
    copies = (Copy(0.0, 0.0), Copy(15.0, 4.0, 0.5))
    flown = FrameField(stack, copies, 10.0 / 12.0, FilmClock(0, 0))
    places = np.random.default_rng(2).uniform(-20, 20, (300, 3))
    read = flown.read(np.zeros(300), places)
    amplitude = 0.6 * np.pi * 100.0 * np.array([1.0, 0.5])
    true = 0.03 + field(places[:, :2], 100.0, [[0.0, 0.0], [15.0, 4.0]], amplitude)
    np.testing.assert_allclose(read, true, atol=1e-4)
    # a mark up in the image lies north, one to the right east
    marked = np.zeros(PIXELS)
    marked += gaussian(60, 47, 8, ambient=0.0)
    marked[20, 90] = 0.3
    field_m = FrameField(FrameStack(marked[None], [0.0]), (Copy(0.0, 0.0),), 1.0, FilmClock(0, 0))
    assert field_m.read(np.zeros(1), np.array([[30.0, 27.0]]))[0] == pytest.approx(0.3, abs=0.01)


def test_outside_the_image_is_ambient_and_a_flight_there_is_refused_beforehand() -> None:
    stack = FrameStack(gaussian(60.0, 47.0, 12.0)[None], [0.0], name="spot.npz")
    flown = FrameField(stack, (Copy(0.0, 0.0), Copy(5.0, 0.0)), 1.0, FilmClock(0, 0))
    far = np.array([[0.0, 400.0], [61.0, 0.0]])
    np.testing.assert_allclose(flown.read(np.zeros(2), far), 2 * 0.02, atol=1e-3)
    flown.check_inside([[-20.0, 0.0], [20.0, 10.0]])
    with pytest.raises(BadInputError, match=r"spot.npz: copy 1: vertex 1 at \[61.0, 0.0\] m is -2.0 m inside"):
        flown.check_inside([[-20.0, 0.0], [61.0, 0.0]])
    with pytest.raises(BadInputError, match="expected at least 40 m"):
        flown.check_inside([[-20.0, 0.0], [20.0, 10.0]], margin_m=40.0)


def test_a_stack_reads_back_and_a_wrong_one_is_told(tmp_path: Path) -> None:
    path = tmp_path / "spot.npz"
    frames = gaussian(60, 47, 12)[None].astype(np.float32)

    def told(**arrays: object) -> str:
        np.savez(path, **arrays)  # type: ignore[arg-type]
        with pytest.raises(BadInputError) as caught:
            FrameStack.read(path)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    np.savez(path, frames=frames, time_s=[3.0], pixel_m=2e-6)
    stack = FrameStack.read(path)
    assert (stack.frames.shape, stack.pixel_m) == ((1, *PIXELS), 2e-6)
    with pytest.raises(BadInputError, match="frame 1: expected 0 to 0"):
        stack.fit(1)
    assert "pixel_m, time_s: missing array, it has frames" in told(frames=frames)
    assert "frames: expected (T, H, W)" in told(frames=frames[0], time_s=[0.0], pixel_m=1.0)
    assert "time_s: expected 1 increasing times" in told(frames=frames, time_s=[0.0, 1.0], pixel_m=1.0)
    assert "pixel_m: expected one number" in told(frames=frames, time_s=[0.0], pixel_m=[1.0, 2.0])
    assert "frames[0, 0, 0]: expected finite" in told(frames=np.full((1, 8, 8), np.nan), time_s=[0.0], pixel_m=1.0)
    path.write_bytes(b"no zip at all")
    with pytest.raises(BadInputError, match=r"spot\.npz: expected a \.npz file"):
        FrameStack.read(path)
    with pytest.raises(BadInputError, match="cannot be read"):
        FrameStack.read(tmp_path / "none.npz")
    with pytest.raises(BadInputError, match="expected a bright spot"):
        FrameStack(np.zeros((1, 8, 8)), [0.0]).fit(0)


def test_the_demonstrations_truth_is_the_fit_moved_and_scaled() -> None:
    stack = FrameStack(gaussian(60.0, 47.0, 12.0)[None], [0.0], pixel_m=1e-6)
    demo = recorded_demo(stack, sources=3, seed=4, middle_m=(100.0, -50.0))
    assert demo.spread_m == 10.0
    assert demo.recorded_m_per_m == pytest.approx(1.2e-6)
    offset = demo.source_position_m - [100.0, -50.0]
    assert (np.abs(offset) <= 16.0).all()
    np.testing.assert_allclose(offset.mean(axis=0), 0.0, atol=1e-12)
    apart = np.linalg.norm(offset[:, None] - offset[None], axis=2) + 1e9 * np.eye(3)
    assert apart.min() >= 8.0
    gains = demo.amplitude / (0.6 * np.pi * 100.0)
    assert ((gains > 0.59) & (gains < 1.41)).all()
    places = demo.source_position_m + np.array([3.0, 1.0])
    demo.field.check_inside(places)
    model = demo.ambient + field(places, demo.spread_m**2, demo.source_position_m, demo.amplitude)
    np.testing.assert_allclose(demo.field.read(np.zeros(3), places), model, atol=2e-3)
    again = recorded_demo(stack, sources=3, seed=4, middle_m=(100.0, -50.0))
    np.testing.assert_array_equal(again.source_position_m, demo.source_position_m)
    np.testing.assert_array_equal(demo.truth([[0, 0], [1, 0]]).source_position_m, demo.source_position_m)
    with pytest.raises(BadInputError, match="sources 60: expected fewer"):
        recorded_demo(stack, sources=60, seed=0)


@recorded
def test_the_recorded_spot_spreads_by_diffusion() -> None:
    stack = FrameStack.read(DATA / "spot_bilayer_a.npz")
    fits = [stack.fit(i) for i in range(9)]
    squared_um2 = [(f.spread_px * stack.pixel_m * 1e6) ** 2 for f in fits]
    rate, at_zero = np.polyfit(stack.time_s[:9], squared_um2, 1)
    assert 1.5 < rate / 4.0 < 2.3  # µm²/s; the recording's README has 1.9
    assert 25.0 < at_zero / rate < 60.0  # s before the first frame
    released = [f.peak * f.spread_px**2 for f in fits]
    assert np.ptp(released[:6]) < 0.1 * np.mean(released)  # what was released stays


@recorded
@pytest.mark.parametrize("name", ["spot_bilayer_a.npz", "spot_bilayer_b.npz", "spot_laser_heated.npz"])
def test_every_recording_can_be_flown(name: str) -> None:
    stack = FrameStack.read(DATA / name)
    demo = recorded_demo(stack, sources=2, seed=1, frame=3)
    value = demo.field.read(np.zeros(2), demo.source_position_m)
    peaks = demo.amplitude / (np.pi * demo.spread_m**2)
    assert (value > demo.ambient + 0.7 * peaks).all()


@recorded
@pytest.mark.parametrize("sources", [2, 3])
def test_the_demonstrations_mission_stays_inside_every_copy(sources: int) -> None:
    stack = FrameStack.read(DATA / "spot_bilayer_a.npz")
    vertices = pattern("star7", 26.0, centre_m=(0.0, 0.0))
    for frame in range(5):
        for seed in range(20):
            recorded_demo(stack, sources=sources, seed=seed, frame=frame).field.check_inside(vertices, 0.5)


@recorded
def test_a_running_recording_reads_its_frames_one_after_another() -> None:
    stack = FrameStack.read(DATA / "spot_bilayer_a.npz")
    demo = recorded_demo(stack, sources=1, seed=0, until_frame=4, flight_s=80.0)
    here = np.repeat(demo.source_position_m, 3, axis=0)
    value = demo.field.read(np.array([0.0, 40.0, 80.0]), here)
    gain = demo.field.copies[0].gain
    expected = [gain * (stack.fit(i).peak + stack.fit(i).ambient) for i in (0, 2, 4)]
    np.testing.assert_allclose(value, expected, rtol=0.08)
