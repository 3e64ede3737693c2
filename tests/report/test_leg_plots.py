"""The panels of the legs: scales that can be read, overshoot and hover told apart, nothing lost by thinning."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from report_flights import estimate_near, star_flight, star_truth

from dslam_mav.records import Flight, Leg
from dslam_mav.report.data import ReportData
from dslam_mav.report.leg_plots import leg_plots, thinned
from dslam_mav.report.page import render
from dslam_mav.report.words import title_of


def flown_past_corners(overshoot_m: float):
    """The star flight with `overshoot_m` added behind leg 2 and before leg 3, as a real copter flies."""
    truth = star_truth(2)
    flight, clean = star_flight(truth)
    legs = list(flight.legs)
    for j, past in ((1, slice(-5, None)), (2, slice(0, 5))):
        leg = legs[j]
        distance = leg.distance_m.copy()
        distance[past] = leg.length_m + overshoot_m if j == 1 else -overshoot_m
        legs[j] = Leg(leg.length_m, distance, leg.time_s, leg.reading)
    return truth, Flight(tuple(legs), closed=True), estimate_near(truth, flight, clean)


def plots_of(case):
    plots = leg_plots(case[1], case[2])
    assert plots is not None
    return plots


def test_a_corner_that_readings_lie_past_is_marked_where_it_is():
    case = flown_past_corners(1.7)
    plots = plots_of(case)
    length_m = case[1].legs[1].length_m
    assert [len(p.corners) for p in plots.panels] == [0, 1, 1, 0, 0, 0, 0]
    assert plots.panels[1].corners[0] == pytest.approx(plots.x_axis.units(np.array([length_m]))[0])
    assert plots.panels[2].corners[0] == pytest.approx(plots.x_axis.units(np.array([0.0]))[0])
    assert plots.x_axis.high > length_m + 1.6, "what is past the corner is drawn too"
    truth, flight, estimate = case
    page = render(ReportData(flight, estimate, truth, "A flight"))
    assert "readings past it are overshoot and hover" in page


def test_a_flight_from_corner_to_corner_has_no_word_of_overshoot():
    truth, flight, estimate = flown_past_corners(0.0)
    assert all(not p.corners for p in plots_of((truth, flight, estimate)).panels)
    assert "overshoot" not in render(ReportData(flight, estimate, truth, "A flight"))


@settings(deadline=None)
@given(st.floats(1e-6, 1e5))
def test_residuals_have_a_scale_whatever_their_size(size):
    truth = star_truth(2)
    flight, clean = star_flight(truth)
    estimate = estimate_near(truth, flight, clean)
    residual = estimate.residual * size
    plots = plots_of((truth, flight, replace(estimate, residual=residual, noise_sd=float(residual.std()))))
    assert plots.residual_axis is not None
    labels = [label for _, label in plots.residual_axis.ticks]
    assert len(set(labels)) == 3, labels
    units = [unit for unit, _ in plots.residual_axis.ticks]
    assert units[1] == pytest.approx((units[0] + units[2]) / 2.0)


def test_drawn_strokes_keep_the_extremes():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(50.0, 280.0, 20_000), rng.normal(size=20_000)
    centre, low, high = thinned(x, y, 200)
    assert centre.size == 200
    assert low.min() == y.min()
    assert high.max() == y.max()
    at = (x >= centre[7] - 0.575) & (x < centre[7] + 0.575)
    assert high[7] == pytest.approx(y[at].max(), abs=0.5)


@pytest.mark.parametrize(
    ("log", "title"),
    [
        ("logs/20261123T163053Z/flight.mcap", "Flight of 23 November 2026, 16:30:53 UTC"),
        ("logs/20261123T163053Z-2/flight.mcap", "Flight of 23 November 2026, 16:30:53 UTC"),
        ("flights/copter_flow.tlog", "Flight copter_flow"),
        ("20269999T999999Z/a.mcap", "Flight a"),
        ("old/flight.mcap", "Flight old"),
    ],
)
def test_a_flight_is_called_by_its_time_or_its_file(log, title):
    assert title_of(Path(log)) == title


def test_a_flight_whose_folder_does_not_say_when_it_was_is_dated_by_its_first_packet():
    assert title_of(Path("logs/latest/flight.mcap"), 1_795_451_453.9) == "Flight of 23 November 2026, 16:30:53 UTC"
    assert title_of(Path("a.tlog"), 1_795_451_453.9) == "Flight a, 23 November 2026, 16:30:53 UTC"


def test_long_labels_have_room_beside_the_axis_name():
    """A gas sensor's raw numbers: in panels of one width the axes begin farther right."""
    truth, flight, estimate = flown_past_corners(0.0)
    far = tuple(replace(leg, reading=leg.reading - 19_000.0) for leg in flight.legs)
    begins = [plots_of((truth, Flight(legs), estimate)).x_axis.start for legs in (flight.legs, far)]
    assert begins[1] - begins[0] > 10.0
