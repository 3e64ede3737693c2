"""The whole chain over recorded diffusion: `python -m tests.bench.recorded [--seeds N]`, part of `make bench`.

Every flight is `dslam-mav fly --readings spot_bilayer_a.npz`: mission upload, loopback vehicle, readings as
NAMED_VALUE_FLOAT, onboard estimator, log. Spread and ambient level are estimated.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import tempfile
from pathlib import Path

import numpy as np

from dslam_mav.cli import main as dslam_mav

RECORDING = Path(__file__).parents[3] / "shared" / "data" / "spot_bilayer_a.npz"
SPREAD_M = 10.0
FRAMES = ("0", "1", "2", "3", "4", "0:4")


def fly(seed: int, frames: str, out: str) -> tuple[float, str]:
    """RMS source error in √C and the verdict of one flight."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
        arguments = ["fly", "--readings", str(RECORDING), "--sources", "2", "--seed", str(seed), "--frames", frames]
        dslam_mav([*arguments, "--speedup", "50", "--out", out, "--json"])
    result = json.loads(printed.getvalue())
    errors = result["errors"]
    return (errors["sources_rms_m"] / SPREAD_M if errors else np.inf), result["verdict"]


def main() -> None:
    """A row for every choice of frames."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=20)
    seeds = parser.parse_args().seeds
    if not RECORDING.exists():
        print(f"recorded diffusion: skipped, {RECORDING} is missing")
        return
    print(f"spot_bilayer_a, two shifted copies, {seeds} seeds a row: source error in √C over the whole chain")
    print("frames  median    90 %  IDENTIFIED or AMBIGUOUS")
    with tempfile.TemporaryDirectory() as out:
        for frames in FRAMES:
            flown = [fly(seed, frames, out) for seed in range(seeds)]
            errors = [error for error, _ in flown]
            good = np.mean([verdict in ("IDENTIFIED", "AMBIGUOUS") for _, verdict in flown])
            print(f"{frames:>6}   {np.median(errors):.3f}   {np.percentile(errors, 90):.3f}  {good:.2f}", flush=True)


if __name__ == "__main__":
    main()
