"""Over random scenes: the best answer is found, and its errors are what its covariance says (tables: `make bench`)."""

import numpy as np
import pytest
from random_scenes import judge, random_case

from dslam_mav import Medium

SCENES = 40
FIRST_SEED = 90_000


@pytest.mark.parametrize(("k_sources", "snr_db"), [(2, 20.0), (2, 40.0), (3, 20.0), (3, 40.0)])
def test_on_a_star_with_known_spread(k_sources, snr_db):
    cases = [random_case((FIRST_SEED + i, k_sources, int(snr_db)), k_sources, snr_db) for i in range(SCENES)]
    judged = [judge(case, k_sources) for case in cases]
    # 97 % of many scenes is asked for; a fair estimator misses more than 4 of 40 once in a thousand runs
    assert np.mean([j.found for j in judged]) >= 0.9
    assert np.mean([j.truth_listed for j in judged]) >= 0.85
    sharp = [j for j in judged if j.bound_m < 0.3]
    assert len(sharp) >= SCENES // 2
    assert 0.75 < np.sqrt(np.mean([j.mode_nees for j in sharp])) < 1.6
    median = np.nanmedian([j.error_m for j in judged])
    assert median < {20.0: 0.2, 40.0: 0.02}[snr_db]


def test_with_spread_and_ambient_unknown():
    medium = Medium(static=True, ambient=None)
    cases = [random_case((FIRST_SEED + i, 5), 2, 30.0, medium=medium, ambient=20.0) for i in range(20)]
    judged = [judge(case, 2) for case in cases]
    assert np.mean([j.found for j in judged]) >= 0.85
    assert np.nanmedian([j.error_m for j in judged]) < 0.06
    ambient = [j.estimate.medium.ambient for j in judged]
    assert np.median(np.abs(np.array(ambient) - 20.0)) < 1.0


def test_alternatives_that_fit_at_a_spread_of_their_own_are_listed():
    """The truth fits at a C 8 to 15 % from the best answer's, which hides it."""
    age = 2.0 * 22.4
    medium = Medium(diffusivity_m2_s=0.25 / age, activation_s="shared")
    seeds = [(700_000 + i, 2, 20) for i in (68, 99, 203, 207, 224, 244)]
    judged = [judge(random_case(seed, 2, 20.0, medium=medium, age_over_flight=2.0), 2) for seed in seeds]
    assert all(j.found for j in judged)
    assert np.mean([j.truth_listed for j in judged]) >= 0.5
