"""One trial of an experiment: fly, estimate by both methods, and compare with the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.estimator import estimate
from dslam_mav.dslam.field import field
from dslam_mav.dslam.paper.layout import Failure
from dslam_mav.dslam.paper.method import estimate_by_paper
from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.dslam.paper.peaks import peaks_of
from dslam_mav.dslam.paper.scenery import scenery
from dslam_mav.experiments.errors import in_scene, paper_errors
from dslam_mav.experiments.limits import first_leg
from dslam_mav.experiments.world import World
from dslam_mav.records import Estimate, Flight, Medium

Array = NDArray[np.float64]
Measured = dict[str, float]

METHODS = ("paper", "joint")
FINISHED = PaperOptions()
AS_PRINTED = PaperOptions(samples="robust")
"""The paper's chain as it stands: centres are what the filter gives, without a fit to the leg's readings."""


def medium_for(world: World, unknown: bool) -> Medium:
    """What the estimators are told: activation times too, unless they are unknown, one each."""
    if world.medium.spread_m is not None or unknown:
        return world.medium
    return replace(world.medium, activation_s=tuple(world.sources.activation_s.tolist()))


def estimates(
    flight: Flight, world: World, *, options: PaperOptions = AS_PRINTED, unknown: bool = False
) -> dict[str, Estimate]:
    """The estimates of both methods."""
    medium, k = medium_for(world, unknown), len(world.truth.amplitude)
    paper = estimate_by_paper(flight, medium, k, k, options, closed=flight.closed)
    return {"paper": paper, "joint": estimate(flight, medium, k)}


def localise(
    world: World, rng: np.random.Generator, *, options: PaperOptions = AS_PRINTED, unknown: bool = False
) -> Measured:
    """ "method.error" of both methods on one flight (V-A)."""
    flight = world.flight(rng)
    found: Measured = {}
    for name, answer in estimates(flight, world, options=options, unknown=unknown).items():
        found |= {f"{name}.{error}": value for error, value in paper_errors(answer, world).items()}
        largest = float(np.abs(readings_of(flight)).max())
        residual = answer.residual
        found[f"{name}.misfit"] = float(np.abs(residual).max() / largest) if residual.size else float("nan")
    return found


def readings_of(flight: Flight) -> Array:
    """(N,) all readings in the order taken."""
    if flight.parametric is not None:
        return flight.parametric.reading
    return np.concatenate([leg.reading for leg in flight.legs])


def first_centres(world: World, rng: np.random.Generator, *, relative: bool = False) -> Measured:
    """RMS error of Y_k1 over the sources: by the paper's samples, with a fit to the leg, and by the joint estimate."""
    flight = world.flight(rng)
    y, _ = first_leg(world)
    own = np.sort(y)
    size = own if relative else np.ones_like(own)
    found = {}
    for name, options in (("paper", AS_PRINTED), ("fitted", FINISHED)):
        found[f"{name}.Y"] = _rms((_centres(flight, world, options) - own) / size)
    placed = in_scene(estimate(flight, medium_for(world, False), len(own)), world)
    found["joint.Y"] = float("nan")
    if placed is not None:
        b = world.truth.vertices_m
        along = np.sort((placed[0] - b[0]) @ ((b[1] - b[0]) / np.linalg.norm(b[1] - b[0])))
        found["joint.Y"] = _rms((along - own) / size)
    return found


def _centres(flight: Flight, world: World, options: PaperOptions) -> Array:
    """(K,) the first leg's centres in metres, ascending; NaN where the leg has none."""
    medium, k = medium_for(world, False), len(world.truth.amplitude)
    scene = scenery(Flight(flight.legs[:1]), medium)
    found = peaks_of(scene, medium, k, options)
    if isinstance(found, Failure):
        return np.full(k, np.nan)
    return np.asarray(np.sort(found.legs[0].y) * scene.unit_m)


def held_still(world: World, rng: np.random.Generator) -> Measured:
    """IV-A on the first leg: what holding the field still at the middle sample does to readings and centre."""
    flight = world.flight(rng)
    actual, still = readings_held_still(flight, world)
    y, _ = first_leg(world)
    return {
        "paper.reading": float(np.abs(still - actual).max() / actual.max()),
        "paper.Y": float(np.abs(_centres(flight, world, FINISHED) - np.sort(y)).max()),
    }


def readings_held_still(flight: Flight, world: World) -> tuple[Array, Array]:
    """((N,), (N,)) readings of the first leg, and the same with the field as it is at its middle sample."""
    leg, truth = flight.legs[0], world.truth
    b = truth.vertices_m
    places = b[0] + leg.distance_m[:, None] * (b[1] - b[0]) / leg.length_m
    middle = leg.time_s[len(leg.time_s) // 2]
    c = 4.0 * float(world.medium.diffusivity_m2_s or 0.0) * (middle - world.sources.activation_s)
    return leg.reading, field_of(places, c, world)


def field_of(places: Array, c: Array, world: World) -> Array:
    """(N,) the true sources' field with squared spreads c (K,)."""
    return np.asarray(field(places, c, world.truth.source_position_m, world.truth.amplitude))


def distance(world: World, rng: np.random.Generator) -> Measured:
    """ε of one source over real readings, as a share of √C: activation time (its spread) known, and unknown (V-C)."""
    flight = world.flight(rng)
    found: Measured = {}
    for name, medium in (("known", world.medium), ("unknown", replace(world.medium, spread_m=None))):
        free = replace(medium, extent=0.0)
        answers = {"paper": estimate_by_paper(flight, free, 1, 1, FINISHED, closed=True)}
        answers["joint"] = estimate(flight, medium, 1)
        for method, answer in answers.items():
            placed = in_scene(answer, world)
            off = np.nan if placed is None else np.linalg.norm(placed[0][0] - world.truth.source_position_m[0])
            found[f"{method}.{name}"] = float(off)
    return found


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
