"""What every estimate must keep to, whatever it was made from."""

import numpy as np

from dslam_mav import Verdict
from dslam_mav.records import Estimate

WITH_POSITIONS = (Verdict.IDENTIFIED, Verdict.AMBIGUOUS, Verdict.MODEL_MISFIT)


def sound(result: Estimate) -> Estimate:
    """The verdict and the numbers agree, and shapes are kept."""
    k, d = result.sources.position_m.shape
    assert (
        result.sources.amplitude.shape == result.sources.peak_reading.shape == result.sources.activation_s.shape == (k,)
    )
    assert result.position_covariance_m2.shape == (k, d, d)
    told = result.verdict in WITH_POSITIONS
    assert np.isfinite(result.sources.position_m).all() == told
    assert np.isnan(result.sources.position_m).all() != told
    assert result.reason
    if told:
        for value in (result.sources.amplitude, result.path.vertices_m, result.path.heading_rad, result.residual):
            assert np.isfinite(value).all()
        assert np.isfinite(result.position_covariance_m2).all()
        assert np.isfinite(result.noise_sd)
    return result
