"""Mission files are read, written and read again without loss."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plans import EXAMPLE_HOME, GOOD, REAL, ROOT, any_missions, meaning, meanings, needs_real, star7_mission

from dslam_mav.errors import BadInputError
from dslam_mav.mission import Mission, MissionItem, has_home_item, leg_vertices, with_home_item
from missions.patterns import pattern
from missions.plan import Profile, plan_mission
from missions.plan_file import parse_plan, plan_bytes, read_plan, write_plan

ENDINGS = [".plan", ".waypoints", ".txt"]


@needs_real
@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("name", GOOD)
def test_real_files_survive_either_format(name, ending, tmp_path):
    mission = read_plan(REAL / name).mission
    again_file = tmp_path / f"again{ending}"
    write_plan(again_file, mission)
    again = read_plan(again_file).mission
    assert meanings(again) == meanings(with_home_item(mission))
    assert [meaning(i) for _, i in again.waypoints()] == [meaning(i) for _, i in mission.waypoints()]
    assert np.allclose(np.diff(leg_vertices(again), axis=0), np.diff(leg_vertices(mission), axis=0), atol=1e-3)
    # From then on nothing changes at all.
    write_plan(tmp_path / f"third{ending}", again)
    assert (tmp_path / f"third{ending}").read_bytes() == again_file.read_bytes()


@needs_real
@pytest.mark.parametrize(
    ("name", "items", "vertices", "home"),
    [
        ("qgroundcontrol_sample.plan", 7, 3, (47.3977507, 8.5456075, 488.93101752001763)),
        (
            "qgroundcontrol_sample_with_survey.plan",
            14,
            8,
            (47.39801775617688, 8.545149580000002, 483.4261075265),
        ),
        ("mission_planner_sample.txt", 4, 2, None),
        ("sonoma_copter.waypoints", 77, 75, (38.161859, -122.457878, 498.570007)),
    ],
)
def test_real_files_hold_what_a_person_sees_in_them(name, items, vertices, home):
    mission = read_plan(REAL / name).mission
    assert len(mission.items) == items
    assert len(leg_vertices(mission)) == vertices
    assert has_home_item(mission) == (home is not None)
    if home is not None:
        found = mission.home
        assert (found.latitude_deg, found.longitude_deg, found.altitude_m) == pytest.approx(home, abs=1e-9)


@needs_real
def test_a_survey_is_expanded_with_a_note():
    plan = read_plan(REAL / "qgroundcontrol_sample_with_survey.plan")
    assert plan.notes == ("mission.items[1]: the survey is taken as the 12 items it expands to",)
    places = [(i.x, i.y) for _, i in plan.mission.waypoints()]
    assert places[0] == (473977060, 85463397)
    assert places[-1] == (473974811, 85463421)


@needs_real
def test_the_wrong_mission_version_is_named():
    path = REAL / "qgroundcontrol_sample_wrong_mission_version.plan"
    with pytest.raises(BadInputError) as caught:
        read_plan(path)
    assert str(caught.value) == f"{path}: mission.version 7: expected 2"


@settings(deadline=None)
@given(any_missions(), st.sampled_from(ENDINGS))
def test_any_mission_round_trips_exactly(mission, ending):
    again = parse_plan(plan_bytes(mission, ending), "again").mission
    assert again.home == mission.home
    assert meanings(again) == meanings(mission)


@settings(deadline=None)
@given(any_missions())
def test_both_formats_say_the_same(mission):
    json_form = parse_plan(plan_bytes(mission, ".plan"), "a").mission
    text_form = parse_plan(plan_bytes(mission, ".waypoints"), "b").mission
    assert meanings(json_form) == meanings(text_form)


@settings(deadline=None)
@given(st.integers(-900_000_000, 900_000_000), st.integers(-1_800_000_000, 1_800_000_000))
def test_wpl_keeps_every_step_of_1e7_degrees(x, y):
    items = (MissionItem(16, 3, (0.0, 0.0, 0.0, 0.0), x, y, 10.0),)
    text = plan_bytes(Mission(items, EXAMPLE_HOME), ".waypoints").decode()
    fields = text.splitlines()[2].split("\t")
    assert len(fields) == 12
    assert (round(float(fields[8]) * 1e7), round(float(fields[9]) * 1e7)) == (x, y)


def test_home_stands_apart_from_the_items_in_a_plan():
    mission = json.loads(plan_bytes(star7_mission()))["mission"]
    assert mission["plannedHomePosition"] == [-35.3632621, 149.1652374, 584.19]
    assert [i["command"] for i in mission["items"]] == [22, 178, *[16] * 8, 21]
    assert mission["hoverSpeed"] == 4


@pytest.mark.parametrize("name", ["star7", "star5", "lawnmower"])
def test_the_example_plans_are_what_our_writer_writes(name):
    mission = plan_mission(pattern(name, 40.0), EXAMPLE_HOME, Profile(speed_m_s=5.0))
    path = ROOT / "missions" / f"{name}.plan"
    assert path.read_bytes() == plan_bytes(mission)
    assert read_plan(path).mission == mission
