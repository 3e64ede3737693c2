"""The flights that real ArduPilot firmware flew in its simulator, blind: how far off their sources are.

Truth is where the simulator had vehicle and sources; an answer is held against it in the gauge of the first leg.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np
import pymap3d
from numpy.typing import NDArray

from dslam_mav import Estimate, Medium, estimate, read_flight
from dslam_mav.dslam.align import to_canonical
from dslam_mav.mav.tlog import read_tlog
from dslam_mav.records import Truth
from dslam_mav.replay import flight_from_frames

Array = NDArray[np.float64]

DATA = Path(__file__).parents[2] / "shared" / "data"
FLIGHTS = [
    ("copter_flow_k2_static", 2, Medium(static=True, ambient=None)),
    ("copter_flow_k3_static", 3, Medium(static=True, ambient=None)),
    ("copter_flow_k2_evolving", 2, Medium(diffusivity_m2_s=0.5, activation_s="shared", ambient=None)),
    ("rover_gps_k2_static", 2, Medium(static=True, ambient=None)),
]
"""Name, number of sources, and what is known of the medium: headings, ambient level and spread are not."""


@dataclass(frozen=True, eq=False)
class Held:
    """An estimate against the truth: `error` (K,) in √C of the answer or alternative nearest to it, `nees` (K,)."""

    result: Estimate
    error: Array
    nees: Array


def truth_of(flight: str) -> Truth:
    """Sources and planned path, east and north."""
    body = json.loads((DATA / "flights" / f"{flight}.truth.json").read_text())
    sources = np.array([s["position_ned_m"] for s in body["sources"]])[:, ::-1]
    amplitude = np.array([s["amplitude"] for s in body["sources"]])
    return Truth(sources, amplitude, np.array(body["planned_vertices_ned_m"])[:, ::-1])


def flown_path(flight: str) -> Array:
    """(L + 1, 2) where the simulator had the vehicle when each item was reached."""
    path = DATA / "flights" / f"{flight}.tlog"
    home = json.loads(path.with_suffix(".truth.json").read_text())["home"]
    places = [
        (f.received_ns // 1_000_000 % 10**9, f.message.lat_int / 1e7, f.message.lon_int / 1e7)
        for f in read_tlog(path)
        if f.message.get_type() == "SIM_STATE"
    ]
    time_ms, latitude, longitude = np.array(places).T
    east, north, _ = pymap3d.geodetic2enu(latitude, longitude, 0.0, home[0], home[1], 0.0)
    legs = flight_from_frames(list(read_tlog(path)), path.name).legs
    at_ms = [*(leg.start_ms for leg in legs), legs[-1].end_ms]
    return np.stack([np.interp(at_ms, time_ms, east), np.interp(at_ms, time_ms, north)], axis=1)


def held_against_truth(flight: str, k_sources: int, medium: Medium) -> Held:
    """One flight estimated, its sources assigned to the truth's."""
    result = estimate(read_flight(DATA / "flights" / f"{flight}.tlog"), medium, k_sources)
    spread_m = json.loads((DATA / "flights" / f"{flight}.truth.json").read_text())["spread_sqrtC_m_at_start"]
    return held(result, to_canonical(flown_path(flight)).apply(truth_of(flight).source_position_m), spread_m)


def held(result: Estimate, places_m: Array, spread_m: float) -> Held:
    """An answer held against the places (K, 2) of the sources, in its gauge."""
    found = []
    for mode in (result, *result.alternatives):
        for order in permutations(range(len(places_m))):
            off = mode.sources.position_m[list(order)] - places_m
            covariance = mode.position_covariance_m2[list(order)]
            nees = np.einsum("ki,kij,kj->k", off, np.linalg.inv(covariance), off)
            found.append(Held(result, np.linalg.norm(off, axis=1) / spread_m, nees))
    return min(found, key=lambda each: float(each.error.max()))
