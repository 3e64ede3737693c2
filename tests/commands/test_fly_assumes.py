"""What `fly` lets the estimator assume: never what only the maker of the readings knows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from running import run

from dslam_mav.commands import fly
from dslam_mav.commands.flying import Setup
from dslam_mav.errors import LinkError


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Five frames of one spot that spreads."""
    rows, columns = np.mgrid[:256, :256].astype(float)
    r2, spread2 = (columns - 128.0) ** 2 + (rows - 128.0) ** 2, 16.0**2 * (1.0 + 0.1 * np.arange(5.0))
    path = tmp_path / "spot.npz"
    frames = np.exp(-r2 / spread2[:, None, None]) / spread2[:, None, None] * spread2[0]
    np.savez(path, frames=frames, time_s=np.arange(5.0), pixel_m=1e-6)
    return path


@pytest.mark.parametrize(
    ("options", "told"),
    [((), None), (("--sources", "auto", "--copies", "3"), None), (("--sources", "3"), 3), (("--copies", "3"), None)],
)
def test_the_number_of_copies_is_not_told(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], told: int | None
) -> None:
    seen: list[Setup] = []

    def no_flight(setup: Setup, *_: object) -> None:
        seen.append(setup)
        raise LinkError("not flown")

    monkeypatch.setattr(fly, "fly", no_flight)
    done = run("fly", "--readings", recording, *options, "--out", tmp_path / "logs", "--json")
    assert (done.code, "not flown" in done.err) == (1, True)
    (setup,) = seen
    assert setup.assumptions.n_sources == told
    assert setup.readings.truth is not None
    assert len(setup.readings.truth.amplitude) == (3 if options else 2)
