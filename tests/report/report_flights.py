"""Flights and estimates made by hand: a star {7/3} over two or three sources, an estimate a little off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.field import field, peak_reading
from dslam_mav.records import Estimate, Flight, Leg, Medium, Path, Prediction, Sources, Truth, Verdict
from dslam_mav.report.data import ReportData
from dslam_mav.report.foreseen import Background
from dslam_mav.report.page import render

SPREAD_M, LEG_M, AMBIENT = 10.0, 32.0, 20.0
PLACES_M = np.array([[6.0, 7.0], [-9.0, -4.0], [3.0, -12.0]])
AMPLITUDES = np.array([2600.0, 1900.0, 1200.0])


def star_vertices_m(leg_m=LEG_M):
    angle = 2.0 * np.pi * np.arange(8) * 3 / 7 + 0.4
    radius = leg_m / (2.0 * np.sin(3.0 * np.pi / 7.0))
    return radius * np.stack([np.cos(angle), -np.sin(angle)], axis=1)


def star_truth(k):
    return Truth(PLACES_M[:k], AMPLITUDES[:k], star_vertices_m())


def star_flight(truth, readings=64, noise_sd=0.25, rng=None):
    rng = rng or np.random.default_rng(4)
    share = np.arange(readings) / readings
    legs, clean = [], []
    for j, (a, b) in enumerate(zip(truth.vertices_m[:-1], truth.vertices_m[1:], strict=True)):
        values = AMBIENT + field(a + share[:, None] * (b - a), SPREAD_M**2, truth.source_position_m, truth.amplitude)
        clean.append(values)
        noisy = values + rng.normal(0.0, noise_sd, readings)
        legs.append(Leg(LEG_M, share * LEG_M, 20.0 * (j + share), noisy))
    return Flight(tuple(legs), closed=True), np.concatenate(clean)


def estimate_near(truth, flight, clean, *, error_m=0.5, noise_sd=0.25, verdict=Verdict.IDENTIFIED, seed=1):
    """An estimate in the canonical gauge, off by about `error_m` in sources and (leg 1 apart) in corners."""
    rng = np.random.default_rng(seed)
    to = to_canonical(truth.vertices_m)
    k, legs = len(truth.amplitude), len(truth.vertices_m) - 1
    vertices = to.apply(truth.vertices_m)
    vertices[2:] += rng.normal(0.0, error_m / 1.5, vertices[2:].shape)
    steps = np.diff(vertices, axis=0)
    shapes = rng.normal(0.0, 0.6 * error_m, (k, 2, 2)) + 0.5 * error_m * np.eye(2)
    covariance = shapes @ shapes.transpose(0, 2, 1)
    amplitude = truth.amplitude * (1.0 + rng.normal(0.0, 0.03, k))
    names = tuple(f"heading of leg {j + 1}" for j in range(1, legs))
    names += (*(f"ln amplitude {i + 1}" for i in range(k)), "ambient")
    sd = np.concatenate([np.full(legs - 1, 0.012), np.full(k, 0.03), [0.02]])
    readings = np.concatenate([leg.reading for leg in flight.legs])
    return Estimate(
        sources=Sources(
            to.apply(truth.source_position_m) + rng.normal(0.0, error_m / 1.5, (k, 2)),
            amplitude,
            peak_reading(amplitude, SPREAD_M**2, 2),
            np.full(k, np.nan),
        ),
        path=Path(vertices, np.arctan2(steps[:, 1], steps[:, 0])),
        medium=Medium(spread_m=SPREAD_M, ambient=20.03, static=True),
        verdict=verdict,
        reason="One solution explains the readings; every direction is seen.",
        spread_m=SPREAD_M,
        position_covariance_m2=covariance,
        path_aligned_covariance_m2=0.5 * covariance,
        parameter_covariance=np.diag(sd**2),
        parameter_names=names,
        noise_sd=noise_sd,
        log_likelihood=-12.0,
        residual=readings - clean,
    )


def with_alternative(estimate):
    """The same with another solution: one source elsewhere, some corners moved."""
    rng = np.random.default_rng(9)
    position = estimate.sources.position_m.copy()
    position[-1] += [6.0, -5.0]
    vertices = estimate.path.vertices_m.copy()
    vertices[3:] += rng.normal(0.0, 2.0, vertices[3:].shape)
    steps = np.diff(vertices, axis=0)
    other = replace(
        estimate,
        sources=replace(estimate.sources, position_m=position),
        path=Path(vertices, np.arctan2(steps[:, 1], steps[:, 0])),
        log_likelihood=estimate.log_likelihood - 1.7,
    )
    reason = "One other solution is within 2 Δ log-likelihood of 3.4."
    return replace(estimate, verdict=Verdict.AMBIGUOUS, reason=reason, alternatives=(other,))


def without_positions(estimate, verdict, reason):
    """What an estimator gives when it cannot say where things are."""
    nothing = np.full_like(estimate.sources.position_m, np.nan)
    return replace(
        estimate,
        sources=replace(
            estimate.sources,
            position_m=nothing,
            amplitude=np.full(len(nothing), np.nan),
            peak_reading=np.full(len(nothing), np.nan),
        ),
        path=Path(np.full_like(estimate.path.vertices_m, np.nan), np.full_like(estimate.path.heading_rad, np.nan)),
        position_covariance_m2=np.full_like(estimate.position_covariance_m2, np.nan),
        path_aligned_covariance_m2=np.full_like(estimate.path_aligned_covariance_m2, np.nan),
        verdict=verdict,
        reason=reason,
        noise_sd=float("nan"),
        residual=np.full(estimate.residual.size, np.nan),
        unseen_directions=("source 2 across the path",),
    )


def expected(**changes):
    """What was predicted of such a flight."""
    given = {
        "n_sources": (3, 3), "spread_m": SPREAD_M, "area_m": (32.0, 31.2), "peak": 7.3, "noise_sd": 0.25,
        "readings_per_m": 2.0, "length_m": 7 * LEG_M, "source_error_m": (0.4, 0.9), "path_error_m": (0.3, 0.7),
        "source_error_aligned_m": (0.3, 0.7), "path_error_aligned_m": (0.2, 0.4), "unidentifiable_share": 0.0,
    }  # fmt: skip
    return Prediction(**given | changes)


def known_before(case, **changes):
    """What was assumed and expected of the flight, and what was known after 3 and 5 legs."""
    _, _, estimate = case
    none_yet = without_positions(estimate, Verdict.NOT_IDENTIFIABLE, "Too early.")
    given = {
        "medium": Medium(spread_m=SPREAD_M, ambient=None, static=True),
        "prediction": expected(),
        "predicted_then": True,
        "under_way": ((3, none_yet), (5, first_legs(estimate, 5))),
    }
    return Background(**given | changes)


def first_legs(estimate, legs):
    """The estimate as after so many legs: the same sources, twice as unsure."""
    names = [f"heading of leg {j}" for j in range(2, legs + 1)]
    own = [estimate.parameter_names.index(name) for name in names]
    return replace(
        estimate,
        path=Path(estimate.path.vertices_m[: legs + 1], estimate.path.heading_rad[:legs]),
        position_covariance_m2=4.0 * estimate.position_covariance_m2,
        parameter_names=tuple(names),
        parameter_covariance=4.0 * estimate.parameter_covariance[np.ix_(own, own)],
        alternatives=(),
    )


def page_of(case, **changes):
    """The page of a (truth, flight, estimate), with some of what it is given changed."""
    truth, flight, estimate = case
    given = {
        "flight": flight,
        "estimate": estimate,
        "truth": truth,
        "title": "A flight",
        "facts": {},
    } | changes
    return render(ReportData(**given))
