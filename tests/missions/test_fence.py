"""Where a mission may fly, and the geofence in a plan file."""

from __future__ import annotations

import copy
import json
from pathlib import Path

import numpy as np
import pytest

import missions
from dslam_mav.errors import BadInputError
from dslam_mav.mission import Home
from missions.fence import Fence, area_m2, box, circle, contains, crosses_itself
from missions.plan_fence import parse_fence, read_fence

ROOM = Fence((box((10.0, 10.0)),), (box((2.0, 2.0), (1.0, 0.0)),))
HOME = Home(47.3977, 8.5455, 488.0)
SQUARE = [[47.3975, 8.5450], [47.3975, 8.5460], [47.3980, 8.5460], [47.3980, 8.5450]]
PLAN = {
    "fileType": "Plan",
    "version": 1,
    "geoFence": {
        "version": 2,
        "polygons": [{"inclusion": True, "polygon": SQUARE, "version": 1}],
        "circles": [{"inclusion": False, "circle": {"center": [47.3977, 8.5455], "radius": 5.0}, "version": 1}],
    },
    "mission": {"version": 2, "items": [], "plannedHomePosition": [47.3977, 8.5455, 488.0]},
}


@pytest.mark.parametrize(
    ("path", "margin_m", "passes"),
    [
        ([[-4, 2], [4, 2]], 0.0, True),
        ([[-4, 2], [4, 2]], 0.9, True),
        ([[-4, 2], [4, 2]], 1.1, False),
        ([[-4, 0], [4, 0]], 0.0, False),  # across the keep-out zone
        ([[-1, -2], [3, 2]], 0.0, False),  # through its corners
        ([[1, 0], [1.5, 0]], 0.0, False),  # inside it
        ([[-4, 3], [6, 3]], 0.0, False),
        ([[-5, -5], [5, -5]], 0.0, True),  # along the fence
        ([[6, 6], [8, 8]], 0.0, False),
    ],
)
def test_what_may_be_flown(path, margin_m, passes):
    assert ROOM.lets_pass(path, margin_m) is passes


def test_clearance_points_to_where_there_is_more_of_it():
    rng = np.random.default_rng(0)
    points = rng.uniform(-7.0, 7.0, (300, 2))
    clear, way = ROOM.clearance(points)
    more = ROOM.clearance(points + 1e-6 * way)[0]
    assert np.median((more - clear) / 1e-6) == pytest.approx(1.0, abs=1e-3)
    inside = (np.abs(points) < 5.0).all(axis=1) & ~((np.abs(points - [1.0, 0.0]) < 1.0).all(axis=1))
    assert np.array_equal(clear > 0.0, inside)


def test_circles_never_let_the_vehicle_past_them():
    angle = np.linspace(0.0, 2.0 * np.pi, 400)
    rim = 5.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    assert not contains(circle((0.0, 0.0), 5.0, keep_out=False), 1.0001 * rim).any()
    assert contains(circle((0.0, 0.0), 5.0, keep_out=True), 0.9999 * rim).all()


def test_polygons_that_cross_themselves_are_known():
    assert crosses_itself(np.array([[0, 0], [1, 1], [1, 0], [0, 1.0]]))
    assert not crosses_itself(box((2.0, 3.0)))
    assert area_m2(box((2.0, 3.0))) == pytest.approx(6.0)


def test_a_geofence_is_read_in_metres_about_home(tmp_path):
    file = tmp_path / "fence.plan"
    file.write_text(json.dumps(PLAN))
    found = read_fence(file)
    assert found.home == HOME
    fence = found.around(HOME)
    assert len(fence.within) == len(fence.keep_out) == 1
    assert area_m2(fence.within[0]) == pytest.approx(55.6 * 75.4, rel=0.01)
    assert fence.allows([[0.0, 20.0], [0.0, 0.0], [0.0, 60.0]]).tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("where", "value", "named"),
    [
        (("geoFence",), None, "geoFence"),
        (("geoFence", "version"), 1, "geoFence.version 1"),
        (("geoFence", "polygons"), [], "polygon"),
        (("geoFence", "polygons", 0, "polygon"), SQUARE[:2], "geoFence.polygons[0].polygon"),
        (("geoFence", "polygons", 0, "polygon"), [SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]], "edges cross"),
        (("geoFence", "polygons", 0, "polygon", 1), [95.0, 8.0], "polygon[1]"),
        (("geoFence", "polygons", 0, "polygon", 1), ["a", 8.0], "polygon[1]"),
        (("geoFence", "polygons", 0, "inclusion"), "yes", "inclusion"),
        (("geoFence", "circles", 0, "circle", "radius"), -5.0, "circle.radius -5"),
        (("geoFence", "circles", 0, "circle", "center"), None, "circle.center"),
    ],
)
def test_a_bad_geofence_is_named_in_one_line(where, value, named):
    plan = copy.deepcopy(PLAN)
    owner = plan
    for key in where[:-1]:
        owner = owner[key]
    owner[where[-1]] = value
    if where[-1] == "polygons":
        plan["geoFence"]["circles"] = []
    with pytest.raises(BadInputError) as caught:
        parse_fence(json.dumps(plan), "f.plan")
    assert str(caught.value).startswith("f.plan: ")
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_inclusion_zones_apart_leave_no_room():
    plan = copy.deepcopy(PLAN)
    far = [[lat + 0.01, lon] for lat, lon in SQUARE]
    plan["geoFence"]["polygons"].append({"inclusion": True, "polygon": far, "version": 1})
    with pytest.raises(BadInputError, match="no room in common"):
        parse_fence(json.dumps(plan), "f.plan").around(HOME)


def test_room_is_the_most_a_place_has_to_its_bounds():
    inside = Fence((box((10.0, 6.0)),), (box((2.0, 6.0)),))
    assert inside.room(9.0) == pytest.approx(2.0, abs=0.01)
    assert inside.room(1.0) >= 1.0
    assert Fence((), (box((2.0, 2.0)),)).room(1e6) == np.inf
    assert Fence((box((1.0, 1.0)), box((1.0, 1.0), (5.0, 0.0)))).room(0.0) < 0.0


def test_a_plan_without_zones_is_no_fence_where_none_is_needed(tmp_path):
    """As our own plans are, and older ones that have no geoFence at all."""
    drawn = Path(missions.__file__).with_name("star7.plan")
    body = json.loads(drawn.read_text(encoding="utf-8"))
    del body["geoFence"]
    older = tmp_path / "older.plan"
    older.write_text(json.dumps(body), encoding="utf-8")
    for plan in (drawn, older):
        assert read_fence(plan, needed=False).zones == ()
    with pytest.raises(BadInputError, match="expected at least one polygon or circle"):
        read_fence(drawn)
