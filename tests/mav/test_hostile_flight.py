"""A flight over bad links: readings are where they were taken or left out, and no more is lost than they carried."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from hostile import Hostile, fly

from dslam_mav import Estimate, Flight, Medium, estimate
from dslam_mav.legs import FlownLeg
from sim_bridge.fields.field import Array
from sim_bridge.loopback.link_faults import LinkFaults

SPREAD_M = 5.0
SOURCES_M, AMPLITUDES = np.array([[11.5, 4.0], [4.0, 4.8]]), np.array([700.0, 570.0])
CORNERS = [
    (0.0, 0.0), (16.0, 0.0), (1.58, 6.94), (11.56, -5.57), (8.0, 10.03), (4.44, -5.57), (14.42, 6.94), (0.0, 0.0),
]  # fmt: skip
NOISE = 0.05
ALL = LinkFaults(loss=0.3, duplicate=0.1, reorder=0.1, silence=2.0, corrupt=0.01, stranger=0.1)
FAULTS = {
    "loss": LinkFaults(loss=0.3),
    "duplicate": LinkFaults(duplicate=0.3),
    "reorder": LinkFaults(reorder=0.2),
    "corrupt": LinkFaults(corrupt=0.1),
    "stranger": LinkFaults(stranger=0.3),
    "silence": LinkFaults(silence=2.0),
    "all": ALL,
}


class Sources:
    def read(self, time_s: Array, place_m: Array) -> Array:
        squared_m2 = ((place_m[:, None, :2] - SOURCES_M) ** 2).sum(axis=2)
        return np.asarray(20.0 + (AMPLITUDES * np.exp(-squared_m2 / SPREAD_M**2)).sum(axis=1) / (math.pi * SPREAD_M**2))


@functools.cache
def flown(faults: LinkFaults, seed: int) -> tuple[Hostile, tuple[FlownLeg, ...]]:
    flight = fly(faults, seed, CORNERS, Sources(), noise_sd=NOISE)
    return flight, flight.collected().legs(final=True)


def found(flight: Flight) -> Estimate:
    return estimate(flight, Medium(spread_m=SPREAD_M, static=True, ambient=None), 2)


def error_m(result: Estimate) -> float:
    """How far the sources are off, with the gauge taken out: leg 1 lies along x in truth as well."""
    pairs = (result.sources.position_m, result.sources.position_m * [1.0, -1.0])
    apart_m = [np.linalg.norm(p[order] - SOURCES_M, axis=1).max() for p in pairs for order in ([0, 1], [1, 0])]
    return float(min(apart_m))


@pytest.mark.parametrize(("name", "seed"), [*((name, 1) for name in FAULTS), ("loss", 0), ("silence", 2), ("all", 2)])
def test_readings_are_where_they_were_taken(name: str, seed: int) -> None:
    flight, legs = flown(FAULTS[name], seed)
    assert [(leg.start_seq, leg.end_seq) for leg in legs] == [(k, k + 1) for k in range(2, 9)]
    assert flight.misplaced_m(legs).max() < 0.3
    collector = flight.collected()
    used = sum(leg.value.size for leg in collector.legs(final=True))
    assert used + collector.legs_counts["readings outside legs"] == collector.counts["readings"]
    assert used > 0.9 * collector.counts["readings"]
    for leg in legs:
        true = [Sources().read(np.zeros(1), flight_place_m(flight, t))[0] for t in leg.time_ms]
        assert leg.value == pytest.approx(np.array(true), abs=7.0 * NOISE)


def flight_place_m(flight: Hostile, time_ms: int) -> Array:
    """(1, 3) where the vehicle was."""
    leg, distance_m = flight.true_place(np.array([time_ms]))
    a, b = np.array(CORNERS[int(leg[0])]), np.array(CORNERS[int(leg[0]) + 1])
    return np.array([[*(a + (b - a) * float(distance_m[0]) / np.linalg.norm(b - a)), 0.0]])


def test_the_estimate_of_a_flight_with_every_fault_is_good() -> None:
    for seed in range(3):
        flight, _ = flown(ALL, seed)
        assert error_m(found(flight.collected().flight(final=True))) < 0.03 * SPREAD_M


@pytest.mark.parametrize("name", ["loss", "silence", "all"])
def test_the_estimate_loses_what_the_missing_readings_carried_and_no_more(name: str) -> None:
    ours, ideal = [], []
    for seed in range(3):
        flight, legs = flown(FAULTS[name], seed)
        ours.append(error_m(found(flight.collected().flight(final=True))))
        ideal.append(error_m(found(flight.with_the_readings_of(legs))))
    assert math.sqrt(np.mean(np.square(ours))) < 1.3 * math.sqrt(np.mean(np.square(ideal)))


def test_a_clock_that_wraps_changes_nothing() -> None:
    flight, legs = flown(LinkFaults(wrap=20.0), 0)
    _, plain = flown(LinkFaults(), 0)
    ahead_ms = legs[0].start_ms - plain[0].start_ms
    for ours, theirs in zip(legs, plain, strict=True):
        assert (ours.time_ms - ahead_ms == theirs.time_ms).all()
        assert ours.distance_m.tobytes() == theirs.distance_m.tobytes()
        assert ours.value.tobytes() == theirs.value.tobytes()
    assert flight.misplaced_m(legs, -ahead_ms).max() < 0.01


@pytest.mark.parametrize("faults", [LinkFaults(reset=20.0), replace(ALL, reset=20.0)])
def test_after_a_reboots_reset_of_the_clock_the_longest_part_is_used_and_the_rest_counted(faults: LinkFaults) -> None:
    flight, legs = flown(faults, 1)
    collector = flight.collected()
    assert collector.legs(final=True)
    assert collector.counts["restarts"] == 1
    first = legs[0].start_seq - 2
    offset_ms = flight.corner_ms[first] - legs[0].start_ms
    assert len(legs) in (3, 4)
    assert flight.misplaced_m(legs, offset_ms).max() < 0.3
    used = sum(leg.value.size for leg in legs)
    assert used + collector.legs_counts["readings outside legs"] == collector.counts["readings"]
    assert any("clock started again 1 time" in note for note in collector.notes(legs))
