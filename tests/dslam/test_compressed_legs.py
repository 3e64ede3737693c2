"""A leg's generalised samples: nothing of the signal is lost, noise stays white, a constant drops out."""

import numpy as np
from random_scenes import random_case, truth_fit

from dslam_mav.dslam.beam import fitted
from dslam_mav.dslam.compress import Samples, compress
from dslam_mav.dslam.kernels.tables import sample
from dslam_mav.dslam.modes import Modes
from dslam_mav.dslam.scale import spread_scale


def _legs(case):
    return [Samples(leg.length_m, leg.distance_m, leg.reading, np.ones(leg.reading.size)) for leg in case.flight.legs]


def test_tables_give_every_curve_and_its_slope():
    comp = compress(_legs(random_case((1,), 2, 20.0)), 1.0, ambient_unknown=False)
    leg = random_case((1,), 2, 20.0).flight.legs[0]
    size = comp.legs.z.shape[1]
    phi, slope = np.empty(size), np.empty(size)
    for centre in np.linspace(-3.5, 6.5, 57):
        sample(comp.legs.table[0], comp.legs.y0, comp.legs.h, centre, phi, slope)
        curve = np.exp(-((leg.distance_m - centre) ** 2))
        # an orthonormal basis keeps lengths: what is missing from φ's length is what the span misses
        assert abs(phi @ phi - curve @ curve) < 1e-5
        by_centre = 2.0 * (leg.distance_m - centre) * curve
        assert abs(2.0 * phi @ slope - 2.0 * curve @ by_centre) < 1e-3


def test_noise_is_measured_from_what_is_left_over():
    ratios = []
    for seed in range(20):
        case = random_case((seed, 9), 3, 20.0)
        ratios.append(compress(_legs(case), 1.0, ambient_unknown=True).sigma / case.noise_sd)
    assert 0.97 < np.mean(ratios) < 1.03


def test_a_constant_drops_out_where_the_ambient_level_is_unknown():
    case = random_case((4,), 2, 30.0)
    shifted = [Samples(leg.length, leg.distance, leg.reading + 17.0, leg.spread2) for leg in _legs(case)]
    one = compress(_legs(case), 1.0, ambient_unknown=True)
    other = compress(shifted, 1.0, ambient_unknown=True)
    np.testing.assert_allclose(one.legs.z, other.legs.z, atol=1e-9)


def test_the_fit_on_samples_ends_where_the_fit_on_readings_does():
    case = random_case((5,), 3, 30.0)
    comp = compress(_legs(case), 1.0, ambient_unknown=False)
    state = truth_fit(case).state
    alpha = state.log_amplitude - np.log(np.pi * comp.sigma)
    start = Modes(state.theta[None] + 0.01 * np.arange(7), state.s[None] + 0.02, alpha[None] - 0.05, np.zeros(1))
    found = fitted(comp, start, 0, 6, 60)
    np.testing.assert_allclose(found.s[0], state.s, atol=2e-3)


def test_the_scale_of_the_readings_brackets_their_spread():
    for seed in range(30):
        case = random_case((seed, 11), 2 + seed % 3, (20.0, 40.0)[seed % 2], ambient=20.0)
        scale = spread_scale(_legs(case), ambient_unknown=True)
        assert 0.4 < 1.0 / scale.squared_spread < 8.0
        assert scale.sigma is not None
        assert 0.7 < scale.sigma / case.noise_sd < 1.4
