"""Recorded diffusion without the chain around it: `python -m tests.bench.recorded_fields [--flights N]`.

Shifted copies of a recorded frame added (K = 2, 3), a star {7/3} of 2.6 √C legs flown through them, all of it inside
every copy's image; nothing is added to the recording's own noise and faults. Spread, ambient level and headings are
unknown. Truth is the centre of the Gaussian fitted to the frame itself; errors are RMS over a flight's sources, in √C.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from itertools import pairwise, permutations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dslam_mav import Flight, Leg, Medium, estimate
from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.warm import warm_up
from dslam_mav.records import Estimate
from missions.patterns import star
from sim_bridge.fields.demonstration import RecordedDemo, recorded_demo
from sim_bridge.fields.frame_stack import FrameStack

Array = NDArray[np.float64]

DATA = Path(__file__).parents[3] / "shared" / "data"
MEDIUM = Medium(static=True, ambient=None)
READINGS_PER_LEG = 64
INSIDE = 5.991  # 95 % of χ² of two degrees of freedom
WRONG = 0.3  # √C: an answer further off is another mode
FIRST_SEED = 40_000
ROWS: tuple[tuple[str, tuple[int, ...], int, float | None], ...] = (
    ("a", (1, 2, 3, 4), 2, 0.03),
    ("a", (1, 2, 3, 4), 3, 0.055),
    ("a", (0,), 2, 0.03),
    ("a", (0,), 3, 0.09),
    ("b", (0,), 2, 0.06),
    ("b", (0,), 3, 0.09),
)  # recording, frames in turn, K, limit of the median


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """One flight's answer against truth; in √C. `off`, `half_axis` (K,): each source's error and its ellipse.

    `nearest`: error of the answer or alternative nearest to the truth; `nearest_inside`: whether its ellipses hold it.
    """

    off: Array
    half_axis: Array
    inside: NDArray[np.bool_]
    nearest: float
    nearest_inside: NDArray[np.bool_]
    seconds: float
    verdict: str
    extent: float

    @property
    def error(self) -> float:
        """RMS over the sources; infinite without an answer."""
        return float(np.sqrt(np.mean(self.off**2)))


def demo_of(stack: FrameStack, frame: int, k_sources: int, seed: int) -> tuple[RecordedDemo, Flight, Array]:
    """A field of copies, lengths in √C, the flight through it, and its sources in the flight's canonical gauge."""
    path = star(7, 3, 2.6)
    path = path - path[:-1].mean(axis=0)
    demo = recorded_demo(stack, sources=k_sources, seed=seed, frame=frame, spread_m=1.0)
    demo.field.check_inside(path)
    legs, start_s = [], 0.0
    for a, b in pairwise(path):
        length = float(np.linalg.norm(b - a))
        s = length * np.arange(READINGS_PER_LEG) / READINGS_PER_LEG
        t = start_s + s
        legs.append(Leg(length, s, t, demo.field.read(t, a + s[:, None] * (b - a) / length)))
        start_s += length
    return demo, Flight(tuple(legs)), to_canonical(path).apply(demo.source_position_m)


def matched(position: Array, truth: Array) -> list[int]:
    """Which found source is which true one."""
    return list(min(permutations(range(len(truth))), key=lambda p: float(((position[list(p)] - truth) ** 2).sum())))


def rms_error(mode: Estimate, truth: Array) -> float:
    """RMS over the sources; infinite without an answer."""
    position = mode.sources.position_m
    if not np.isfinite(position).all():
        return float("inf")
    return float(np.sqrt(((position[matched(position, truth)] - truth) ** 2).sum(axis=1).mean()))


def within(mode: Estimate, truth: Array) -> NDArray[np.bool_]:
    """(K,) whether each source's 95 % ellipse holds the true one."""
    order = matched(mode.sources.position_m, truth)
    off, blocks = mode.sources.position_m[order] - truth, mode.position_covariance_m2[order]
    return np.array([o @ np.linalg.solve(c, o) < INSIDE for o, c in zip(off, blocks, strict=True)])


def fly(stack: FrameStack, frame: int, k_sources: int, seed: int) -> Flown:
    """Estimate one flight and judge it."""
    _, flight, truth = demo_of(stack, frame, k_sources, seed)
    begun = time.perf_counter()
    result = estimate(flight, MEDIUM, k_sources)
    seconds = time.perf_counter() - begun
    nearest = min((result, *result.alternatives), key=lambda mode: rms_error(mode, truth))
    extent = float(result.diagnostics["extent"]) if "extent" in result.diagnostics else float("nan")
    if not np.isfinite(result.sources.position_m).all():
        none = np.full(k_sources, np.inf)
        outside = np.zeros(k_sources, bool)
        return Flown(none, none, outside, np.inf, outside, seconds, result.verdict.name, extent)
    order = matched(result.sources.position_m, truth)
    return Flown(
        off=np.linalg.norm(result.sources.position_m[order] - truth, axis=1),
        half_axis=np.sqrt(INSIDE * np.linalg.eigvalsh(result.position_covariance_m2[order])[:, -1]),
        inside=within(result, truth),
        nearest=rms_error(nearest, truth),
        nearest_inside=within(nearest, truth),
        seconds=seconds,
        verdict=result.verdict.name,
        extent=extent,
    )


def line(flown: list[Flown]) -> str:
    """A row's figures."""
    error = np.array([f.error for f in flown])
    answered = [f for f in flown if np.isfinite(f.error)]
    inside = np.concatenate([f.inside for f in answered])
    nearest_inside = np.concatenate([f.nearest_inside for f in answered])
    axis = np.concatenate([f.half_axis for f in answered])
    right = np.concatenate([f.off for f in answered if f.error < WRONG])
    words = [f.verdict for f in flown]
    verdicts = " ".join(f"{word} {words.count(word)}" for word in sorted(set(words)))
    return (
        f"{np.median(error):.3f} / {np.percentile(error, 90, method='lower'):.3f}   "
        f"{np.median([f.nearest for f in flown]):.3f}    "
        f"{100.0 * inside.mean():3.0f} % ({100.0 * nearest_inside.mean():3.0f} %)   "
        f"{np.median(axis):.3f}      {np.sqrt(np.mean(right**2)):.3f}    {np.mean(error >= WRONG):.2f}   "
        f"{np.median([f.extent for f in flown]):+.2f}  "
        f"{np.median([f.seconds for f in flown]):.2f}   {verdicts}"
    )


def main() -> None:
    """A line for every row."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--flights", type=int, default=40)
    flights = parser.parse_args().flights
    stacks = {name: DATA / f"spot_bilayer_{name}.npz" for name in "ab"}
    if not all(path.exists() for path in stacks.values()):
        print(f"recorded fields: skipped, {DATA} is missing")
        return
    warm_up()
    print(f"{flights} flights a row; source error in √C; headings, spread and ambient level unknown")
    print("inside: 95 % ellipses of the answer that hold the truth (of the answer or alternative nearest to it)")
    print(
        "recording, K, limit   error          nearest  inside          half-axis RMS of   wrong  κ      s      verdicts"
    )
    print("frames                med / 90 %     listed                   median     a right         median median")
    for name, frames, k_sources, limit in ROWS:
        stack = FrameStack.read(stacks[name])
        flown = [fly(stack, frames[i % len(frames)], k_sources, FIRST_SEED + i) for i in range(flights)]
        which = f"{name} {frames[0]}" if len(frames) == 1 else f"{name} {frames[0]}–{frames[-1]}"
        print(f"{which:<9}  {k_sources}  {limit or 0.0:.3f}   {line(flown)}", flush=True)


if __name__ == "__main__":
    main()
