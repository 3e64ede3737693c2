"""Whatever the bound of a mission is asked for: a ValueError that names the argument."""

from dataclasses import replace

import numpy as np
import pytest

from dslam_mav import Medium, Sources, bound

KNOWN = Medium(spread_m=1.0, static=True)
SOURCES = Sources([[1.0, 1.0], [-1.0, 0.5]], [3.0, 2.0], [1.0, 0.7], [np.nan, np.nan])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[("sources", v) for v in (None, [[0.0, 0.0]], replace(SOURCES, amplitude=[-1.0, 1.0]))],
        *[("medium", v) for v in (None, 3.0)],
        ("sources", replace(SOURCES, position_m=np.zeros((2, 3)))),
        *[("vertices_m", v) for v in (None, "x", [[0.0, 0.0]], np.zeros((3, 3)), [[0.0, np.nan], [1.0, 1.0]])],
        *[("readings_per_leg", v) for v in (None, "x", 0, 2.5)],
        *[(name, v) for name in ("speed_m_s", "noise_sd") for v in (None, "x", 0.0, np.nan)],
        *[("heading_sd_rad", v) for v in ("x", 0.0)],
    ],
)
def test_a_bound_of_what_cannot_be(name, value):
    given = {
        "vertices_m": [[0.0, 0.0], [3.0, 0.0], [0.0, 2.0]], "sources": SOURCES, "medium": KNOWN,
        "readings_per_leg": 8, "speed_m_s": 1.0, "noise_sd": 0.1, name: value,
    }  # fmt: skip
    with pytest.raises(ValueError, match=name):
        bound(given.pop("vertices_m"), given.pop("sources"), given.pop("medium"), **given)
