"""QGroundControl and MAVSDK read the mission files that we write, and what they write means the same to us."""

from __future__ import annotations

import json
import math
import struct

import pytest
from hypothesis import given, settings
from plans import ALIAS, GOOD, REAL, any_missions, meanings, needs_real, star7_mission

from dslam_mav.mission import with_home_item
from missions.plan_file import plan_bytes, read_plan


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
