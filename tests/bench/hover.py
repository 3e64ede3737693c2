"""What standing before take-off tells: `python -m tests.bench.hover [--scenes N]`.

Random scenes on the star {7/3}; the vehicle is read 200 times out of the sources' reach before its first leg. The noise
and level it tells, and what they do to the answer, beside those of legs alone. Headings are not told. Lengths in √C.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from random_scenes import Case, matched_error_m, random_case

from dslam_mav import Estimate, Medium, Verdict, estimate
from dslam_mav.assumptions import Assumptions
from dslam_mav.calibrated import Calibrated, calibrated_answer
from dslam_mav.dslam.certify import MISFIT_P_VALUE
from dslam_mav.dslam.warm import warm_up
from dslam_mav.legs import Standing
from dslam_mav.records.arrays import Array

AMBIENT = 20.0
READINGS = 200
MEDIUM = Medium(spread_m=1.0, static=True, ambient=None)
ROWS = ((2, 20.0, 64), (3, 20.0, 64), (3, 40.0, 64), (2, 20.0, 16), (3, 20.0, 16))
HOVER = Assumptions(ambient="hover", noise="hover")
INSIDE_95 = 5.991


def stood(case: Case, seed: int) -> Standing:
    """The sensor read standing out of reach."""
    rng = np.random.default_rng((seed, 1))
    return Standing(50 * np.arange(READINGS), AMBIENT + case.noise_sd * rng.standard_normal(READINGS))


def answers(case: Case, k_sources: int, standing: Standing) -> tuple[Estimate, Estimate, Estimate]:
    """With the ambient level estimated, by the stand, and given."""

    def answer(calibrated: Calibrated) -> Estimate:
        return estimate(case.flight, MEDIUM, k_sources, ambient_prior=calibrated.ambient, noise_prior=calibrated.noise)

    given = Medium(spread_m=1.0, static=True, ambient=AMBIENT)
    return answer(Calibrated()), calibrated_answer(HOVER, standing, answer), estimate(case.flight, given, k_sources)


def main() -> None:
    """A row for every number of sources, noise and readings a leg."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenes", type=int, default=24)
    scenes = parser.parse_args().scenes
    warm_up()
    print(f"{scenes} random scenes a row, {READINGS} readings standing; ambient estimated / by the stand / given")
    print("K  dB  a leg  noise/true: legs, stand  ambient error, noise sds  source error, √C       inside 95 %        "
          "misfit alarms")  # fmt: skip
    for k_sources, snr_db, per_leg in ROWS:
        rows = []
        for seed in range(scenes):
            case = random_case((seed, 77, k_sources), k_sources, snr_db, ambient=AMBIENT, readings_per_leg=per_leg)
            standing = stood(case, seed)
            results = answers(case, k_sources, standing)
            rows.append([standing.noise()[0] / case.noise_sd, *(x for each in results for x in _judged(each, case))])
        print(_line(k_sources, snr_db, per_leg, np.array(rows)), flush=True)


def _judged(result: Estimate, case: Case) -> tuple[float, float, float, float, float]:
    """Noise and ambient error in true noise sds, source error, share of sources in their ellipses, misfit alarms."""
    ambient = abs((result.medium.ambient or 0.0) - AMBIENT) / case.noise_sd
    error = matched_error_m(result, case.position_m)
    alarm = result.diagnostics.get("whiteness_p", 1.0) < MISFIT_P_VALUE or result.verdict is Verdict.MODEL_MISFIT
    return result.noise_sd / case.noise_sd, ambient, error, _inside(result, case), float(alarm)


def _inside(result: Estimate, case: Case) -> float:
    if not np.isfinite(result.sources.position_m).all():
        return np.nan
    off = result.sources.position_m[:, None] - case.position_m[None]
    squares = np.einsum("kji,kil,kjl->kj", off, np.linalg.inv(result.position_covariance_m2), off)
    return float((squares.min(axis=1) < INSIDE_95).mean())


def _line(k_sources: int, snr_db: float, per_leg: int, rows: Array) -> str:
    stand, judged = rows[:, 0], rows[:, 1:].reshape(len(rows), 3, 5)
    error = np.nanmedian(judged[:, :, 2], axis=0)
    ambient, inside = np.median(judged[:, :, 1], axis=0), np.nanmean(judged[:, :, 3], axis=0)
    alarms = judged[:, :, 4].sum(axis=0)
    return (
        f"{k_sources}  {snr_db:.0f}   {per_leg}   "
        f"{np.nanmean(judged[:, 0, 0]):.3f} ± {np.nanstd(judged[:, 0, 0]):.3f}, "
        f"{stand.mean():.3f} ± {stand.std():.3f}   {ambient[0]:.2f} / {ambient[1]:.2f} / {ambient[2]:.2f}   "
        f"{error[0]:.4f} / {error[1]:.4f} / {error[2]:.4f}   {inside[0]:.2f} / {inside[1]:.2f} / {inside[2]:.2f}   "
        f"{alarms[0]:.0f} / {alarms[1]:.0f} / {alarms[2]:.0f}"
    )


if __name__ == "__main__":
    main()
