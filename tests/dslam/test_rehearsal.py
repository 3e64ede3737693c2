"""Simulated missions come out as predicted, and a prediction without ground is found out."""

from __future__ import annotations

import numpy as np
import pytest

from dslam_mav.dslam.expected import Sensing, errors_on
from dslam_mav.dslam.layouts import Prior, Region, drawn
from dslam_mav.dslam.rehearsal import rehearse
from missions.patterns import centred, star

BOX = Region((-1.6, -1.6), (1.6, 1.6))
PATH = centred(star(5, 2, 4.5))


@pytest.mark.parametrize(
    "known",
    [
        {},
        {"heading_sd_rad": 0.02},
        {"length_sd_m": 0.01},
        {"spread_unknown": True, "ambient_unknown": True},
    ],
)
def test_what_is_flown_is_what_was_predicted(known):
    sensing = Sensing(0.01, 20.0, **known)
    group = drawn(Prior((2, 2), (1.0, 1.0), BOX), 15, np.random.default_rng(1))[0]
    flown = [rehearse(PATH, group, i, sensing, np.random.default_rng(i)) for i in range(len(group))]
    predicted = errors_on(PATH, group, sensing)
    assert all(one.answered for one in flown)
    ratio = np.array([one.source_m for one in flown]) / predicted.source
    assert 0.5 < np.median(ratio) < 1.3
    ratio = np.array([one.path_m for one in flown]) / predicted.path
    assert 0.4 < np.median(ratio) < 1.4


def test_a_rehearsal_repeats_with_its_noise():
    group = drawn(Prior((2, 2), (1.0, 1.0), BOX), 1, np.random.default_rng(1))[0]
    first, again, other = (rehearse(PATH, group, 0, Sensing(0.02, 20.0), np.random.default_rng(s)) for s in (1, 1, 2))
    assert first == again != other


def test_no_answer_is_infinitely_far_off():
    group = drawn(Prior((3, 3), (1.0, 1.0), BOX), 1, np.random.default_rng(1))[0]
    far = rehearse(PATH[:3] + 50.0, group, 0, Sensing(0.1, 20.0), np.random.default_rng(0))
    assert not far.answered
    assert far.source_m == far.path_m == np.inf
