"""Mission files are read, written and read again without loss, and other programs read what we write."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.errors import BadInputError
from dslam_mav.mission import (
    Home,
    Mission,
    MissionItem,
    has_home_item,
    leg_vertices,
    with_home_before,
    with_home_item,
)
from missions.patterns import pattern
from missions.plan import Profile, plan_mission
from missions.plan_file import parse_plan, plan_bytes, read_plan, write_plan

ROOT = Path(__file__).resolve().parents[2]
REAL = ROOT.parent / "shared" / "data" / "missions"
GOOD = [
    "qgroundcontrol_sample.plan",
    "qgroundcontrol_sample_with_survey.plan",
    "mission_planner_sample.txt",
    "sonoma_copter.waypoints",
]
ENDINGS = [".plan", ".waypoints", ".txt"]
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


def qgroundcontrol_refuses(text: str) -> str | None:  # noqa: PLR0911
    """What QGroundControl's own loader checks (PlanMasterController, MissionController, MissionItem)."""
    root = json.loads(text)
    shape = {"fileType": str, "version": int, "groundStation": str, "mission": dict, "geoFence": dict}
    for key, kind in (shape | {"rallyPoints": dict}).items():
        if not isinstance(root.get(key), kind):
            return key
    if (root["fileType"], root["version"]) != ("Plan", 1):
        return "fileType"
    if (root["geoFence"]["version"], root["rallyPoints"]["version"]) != (2, 2):
        return "section version"
    mission = root["mission"]
    kinds = {"plannedHomePosition": list, "items": list, "firmwareType": int, "vehicleType": int}
    for key, kind in (kinds | {"cruiseSpeed": int, "hoverSpeed": int}).items():
        if not isinstance(mission.get(key), kind):
            return f"mission.{key}"
    if mission["version"] != 2 or len(mission["plannedHomePosition"]) != 3:
        return "mission"
    for item in mission["items"]:
        fits = item["type"] == "SimpleItem" and len(item["params"]) == 7 and type(item["autoContinue"]) is bool
        fits &= all(type(item[key]) is int for key in ("frame", "command", "doJumpId"))
        fits &= all(isinstance(p, int | float) or (p is None and j < 4) for j, p in enumerate(item["params"]))
        if not fits or len({"AltitudeMode", "Altitude", "AMSLAltAboveTerrain"} & set(item)) not in (0, 3):
            return f"item {item}"
    ids = [item["doJumpId"] for item in mission["items"]]
    return None if ids == list(range(1, len(ids) + 1)) else "doJumpId"


@needs_real
@pytest.mark.parametrize("name", GOOD)
def test_qgroundcontrol_loads_the_real_missions_as_we_write_them(name):
    assert qgroundcontrol_refuses(plan_bytes(read_plan(REAL / name).mission).decode()) is None


@settings(deadline=None)
@given(any_missions())
def test_qgroundcontrol_loads_whatever_we_write(mission):
    assert qgroundcontrol_refuses(plan_bytes(mission).decode()) is None


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


@pytest.fixture(scope="module")
def mavsdk_importers():
    """MAVSDK's mission import, for an ArduPilot and for a PX4 vehicle; no socket is opened."""
    sdk = pytest.importorskip("mavsdk.mavsdk", reason="MAVSDK is not installed")
    from mavsdk.component_type import ComponentType
    from mavsdk.plugins.mission_raw.mission_raw import MissionRaw
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    made = []
    importers = {}
    for name, autopilot in (("ardupilot", 3), ("px4", 12)):
        configuration = sdk.Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        instance = sdk.Mavsdk(configuration)
        made += [instance, configuration]
        instance.add_any_connection("raw://")
        heartbeat = dialect.MAVLink_heartbeat_message(2, autopilot, 0, 0, 4, 3)
        instance.pass_received_raw_bytes(heartbeat.pack(dialect.MAVLink(None, 1, 1)))
        importers[name] = MissionRaw(instance.first_autopilot(5.0))
    yield importers
    for thing in made:
        thing.destroy()


def float32(number):
    return None if math.isnan(number) else struct.unpack("<f", struct.pack("<f", number))[0]


def mavsdk_meanings(items):
    return [
        (
            i.command, ALIAS.get(i.frame, i.frame),
            tuple(map(float32, (i.param1, i.param2, i.param3, i.param4))),
            i.x, i.y, float32(i.z), bool(i.autocontinue),
        )
        for i in items
    ]  # fmt: skip


def our_meanings(mission):
    return [
        (c, f, tuple(p if p is None else float32(p) for p in params), x, y, float32(z), auto)
        for c, f, params, x, y, z, auto in meanings(mission)
    ]


@pytest.mark.parametrize("source", ["ours", *GOOD])
def test_mavsdk_imports_what_we_write(source, mavsdk_importers):
    if source != "ours" and not REAL.is_dir():
        pytest.skip(f"recorded missions are not here: {REAL}")
    mission = with_home_item(star7_mission() if source == "ours" else read_plan(REAL / source).mission)
    # For ArduPilot, MAVSDK puts a plan's home before its items; for PX4 it takes a text file's lines as is.
    plan = mavsdk_importers["ardupilot"].import_qgroundcontrol_mission_from_string(plan_bytes(mission).decode())
    assert mavsdk_meanings(plan.mission_items) == our_meanings(mission)
    text = plan_bytes(mission, ".waypoints").decode()
    lines = mavsdk_importers["px4"].import_mission_planner_mission_from_string(text)
    assert mavsdk_meanings(lines.mission_items) == our_meanings(mission)


@needs_real
@pytest.mark.parametrize("name", GOOD)
def test_mavsdk_reads_the_real_files_as_we_do(name, mavsdk_importers):
    mission = read_plan(REAL / name).mission
    text = (REAL / name).read_text()
    if name.endswith(".plan"):
        theirs = mavsdk_importers["ardupilot"].import_qgroundcontrol_mission_from_string(text)
    else:
        theirs = mavsdk_importers["px4"].import_mission_planner_mission_from_string(text)
    found = mavsdk_meanings(theirs.mission_items)
    # A null param 7 (of a camera command) means nothing: we carry 0, which ArduPilot accepts.
    assert [(*m[:5], m[5] or 0.0, m[6]) for m in found] == our_meanings(mission)
