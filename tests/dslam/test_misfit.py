"""Fields that are not quite the model's: what is found in them, how sure the answer says it is, and what it says."""

import numpy as np
import pytest
from bench.recorded_fields import DATA, MEDIUM, demo_of, fly, rms_error
from random_scenes import random_case

from dslam_mav import Medium, estimate
from dslam_mav.dslam.certify import noise
from sim_bridge.fields.frame_stack import FrameStack

needs_recordings = pytest.mark.skipif(not DATA.is_dir(), reason=f"{DATA} is missing")


@needs_recordings
@pytest.mark.parametrize(
    ("recording", "frame", "k_sources", "seed"),
    [("a", 1, 3, 50036), ("a", 0, 3, 50038), ("b", 0, 2, 50016), ("b", 0, 3, 50012)],
)
def test_misfit_does_not_hide_the_answer(recording, frame, k_sources, seed):
    """Fields in which a search that takes the misfit for signal loses the sources."""
    stack = FrameStack.read(DATA / f"spot_bilayer_{recording}.npz")
    assert fly(stack, frame, k_sources, seed).nearest < 0.15


@needs_recordings
def test_an_extended_release_is_told_by_its_shape():
    """Theory, section 10: κ ≈ −0.18 in the first frame, and it fits better than point releases do."""
    stack = FrameStack.read(DATA / "spot_bilayer_a.npz")
    _, flight, truth = demo_of(stack, 0, 2, 50001)
    free = estimate(flight, MEDIUM, 2)
    point = estimate(flight, Medium(static=True, ambient=None, extent=0.0), 2)
    assert free.medium.extent == pytest.approx(-0.18, abs=0.08)
    assert rms_error(free, truth) < 0.06
    assert free.diagnostics["cost"] < 0.9 * point.diagnostics["cost"]


@needs_recordings
def test_uncertainties_are_widened():
    stack = FrameStack.read(DATA / "spot_bilayer_a.npz")
    flown = [fly(stack, 1 + i % 4, 2, 50000 + i) for i in range(6)]
    inside = np.concatenate([f.inside for f in flown if f.error < 0.3])
    off = np.concatenate([f.off for f in flown if f.error < 0.3])
    axis = np.concatenate([f.half_axis for f in flown if f.error < 0.3])
    assert inside.mean() >= 0.8
    assert np.median(axis) < 4.0 * np.sqrt(np.mean(off**2))


def test_white_readings_keep_the_point_release():
    case = random_case((7, 2), 2, 30.0, medium=MEDIUM, ambient=20.0)
    result = estimate(case.flight, MEDIUM, 2)
    assert result.diagnostics["extent"] == 0.0
    assert result.noise_sd == pytest.approx(case.noise_sd, rel=0.15)


def test_only_residuals_that_are_not_white_widen():
    white = noise(100.0, 120, 20, (60.0, 60), 1.0)
    assert (white.variance, white.misfit) == (1.0, False)
    coloured = noise(220.0, 120, 20, (60.0, 60), 1.0)
    assert coloured.misfit
    assert coloured.variance > coloured.inside > coloured.outside
