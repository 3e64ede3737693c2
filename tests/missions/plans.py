"""Missions to write and read: recorded, our own, and any at all."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import strategies as st

from dslam_mav.mission import Home, Mission, MissionItem, with_home_before
from missions.patterns import pattern
from missions.plan import Profile, plan_mission

ROOT = Path(__file__).resolve().parents[2]
REAL = ROOT.parent / "shared" / "data" / "missions"
GOOD = [
    "qgroundcontrol_sample.plan",
    "qgroundcontrol_sample_with_survey.plan",
    "mission_planner_sample.txt",
    "sonoma_copter.waypoints",
]
ALIAS = {5: 0, 6: 3, 11: 10}
needs_real = pytest.mark.skipif(not REAL.is_dir(), reason=f"recorded missions are not here: {REAL}")
EXAMPLE_HOME = Home(-35.3632621, 149.1652374, 584.19)


def star7_mission():
    return plan_mission(pattern("star7", 40.0, heading_rad=0.3), EXAMPLE_HOME, Profile(speed_m_s=3.5))


def meaning(item: MissionItem):
    """What an item says, NaN comparable and frames by one of their two names."""
    params = tuple(None if math.isnan(p) else p for p in item.params)
    return (
        item.command, ALIAS.get(item.frame, item.frame), params, item.x, item.y, item.z, item.autocontinue
    )  # fmt: skip


def meanings(mission: Mission):
    return [meaning(item) for item in mission.items]


finite32 = st.floats(allow_nan=False, allow_infinity=False, width=32)
global_items = st.builds(
    MissionItem,
    st.sampled_from([16, 17, 19, 21, 22, 82]),
    st.sampled_from([0, 3, 10]),
    st.tuples(*[st.one_of(st.just(math.nan), finite32)] * 4),
    st.integers(-900_000_000, 900_000_000),
    st.integers(-1_800_000_000, 1_800_000_000),
    finite32,
    st.booleans(),
)
other_items = st.builds(
    MissionItem,
    st.sampled_from([20, 178, 206, 530, 2000]),
    st.just(2),
    st.tuples(*[st.one_of(st.just(math.nan), finite32)] * 4),
    st.integers(-(2**31) + 1, 2**31 - 1),
    st.integers(-(2**31) + 1, 2**31 - 1),
    finite32,
    st.booleans(),
)


@st.composite
def any_missions(draw):
    home = Home(
        draw(st.integers(-900_000_000, 900_000_000)) / 1e7,
        draw(st.integers(1, 1_800_000_000)) / 1e7,
        draw(st.floats(-400, 9000, width=32)),
    )
    items = draw(st.lists(st.one_of(global_items, other_items), min_size=1, max_size=12))
    if draw(st.booleans()):
        items.append(MissionItem(177, 2, (float(draw(st.integers(0, len(items)))), 2.0, 0.0, 0.0), 0, 0, 0.0))
    return with_home_before(items, home)
