"""What cannot be read or written is refused in one line that names file, place and value."""

from __future__ import annotations

import copy
import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.errors import BadInputError
from dslam_mav.mission import Home, Mission, MissionItem, with_home_item
from missions.patterns import pattern
from missions.plan import plan_mission
from missions.plan_file import parse_plan, plan_bytes, read_plan, write_plan

MISSION = plan_mission(pattern("star5", 40.0), Home(47.3977507, 8.5456075, 488.0))
PLAN = json.loads(plan_bytes(MISSION))
LINES = plan_bytes(MISSION, ".waypoints").decode().splitlines()


def refusal(data: bytes) -> str:
    with pytest.raises(BadInputError) as caught:
        parse_plan(data, "flight")
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 250
    assert message.startswith("flight: ")
    return message.removeprefix("flight: ")


def edited(path, value):
    """The good plan with one value set (or, given `del`, taken away)."""
    plan = copy.deepcopy(PLAN)
    owner = plan
    for key in path[:-1]:
        owner = owner[key]
    if value is del_:
        del owner[path[-1]]
    else:
        owner[path[-1]] = value
    return json.dumps(plan).encode()


del_ = object()
ITEM = ("mission", "items", 2)


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("fileType",), "Parameters", "fileType Parameters: expected"),
        (("fileType",), del_, "fileType is missing"),
        (("version",), 2, "version 2: expected 1"),
        (("mission",), del_, "mission is missing"),
        (("mission",), [], "mission []: expected an object"),
        (("mission", "version"), 7, "mission.version 7: expected 2"),
        (("mission", "version"), "2", "mission.version 2: expected 2"),
        (("mission", "version"), True, "mission.version true"),
        (("mission", "items"), {}, "mission.items {}: expected a list"),
        (("mission", "items"), [], "mission.items []: expected at least one"),
        (ITEM, 5, "mission.items[2] 5: expected an object"),
        ((*ITEM, "type"), "missionItem", "mission.items[2].type missionItem: expected SimpleItem"),
        ((*ITEM, "type"), del_, "mission.items[2].type is missing"),
        ((*ITEM, "command"), "WAYPOINT", "mission.items[2].command WAYPOINT: expected a command's number"),
        ((*ITEM, "command"), 70000, "mission.items[2].command 70000: expected 0 to 65535"),
        ((*ITEM, "frame"), 1, "mission.items[2].frame 1: expected a global or mission frame"),
        ((*ITEM, "autoContinue"), 1, "mission.items[2].autoContinue 1: expected true or false"),
        ((*ITEM, "doJumpId"), "x", "mission.items[2].doJumpId x"),
        ((*ITEM, "params"), [0] * 6, "mission.items[2].params [0, 0, 0, 0, 0, 0]: expected 7 numbers, got 6"),
        ((*ITEM, "params"), del_, "mission.items[2].params is missing"),
        ((*ITEM, "params", 0), "1", "mission.items[2].params[0] 1: expected a number or null"),
        ((*ITEM, "params", 1), True, "mission.items[2].params[1] true: expected a number or null"),
        ((*ITEM, "params", 2), 10**400, "mission.items[2].params[2] 1000"),
        (
            (*ITEM, "params", 3),
            1e39,
            "mission.items[2].params[3] 1e+39: expected a finite number that fits 32",
        ),
        ((*ITEM, "params", 4), 90.5, "mission.items[2].params[4] 90.5: expected a latitude of -90 to 90"),
        ((*ITEM, "params", 5), -181, "mission.items[2].params[5] -181: expected a longitude of -180 to 180"),
        ((*ITEM, "params", 5), None, "mission.items[2].params[5] null: expected degrees"),
        ((*ITEM, "params", 6), None, "mission.items[2].params[6] null: expected an altitude"),
        (
            ("mission", "items", 1, "params", 4),
            2**31,
            "mission.items[1].params[4] 2147483648: expected a whole",
        ),
        (("mission", "plannedHomePosition"), [1, 2], "mission.plannedHomePosition [1, 2]: expected [lat"),
        (("mission", "plannedHomePosition"), ["a", 2, 3], "mission.plannedHomePosition a"),
        (
            ("mission", "plannedHomePosition"),
            [91, 2, 3],
            "mission.plannedHomePosition [91, 2, 3]: expected deg",
        ),
        (("mission", "plannedHomePosition"), [None, 2, 3], "mission.plannedHomePosition [null, 2, 3]"),
    ],
)
def test_a_plan_with_one_wrong_field(path, value, words):
    assert refusal(edited(path, value)).startswith(words)


def test_a_complex_item_without_its_items():
    landing = {"type": "ComplexItem", "complexItemType": "fwLandingPattern", "version": 2}
    message = refusal(edited(ITEM, landing))
    assert message.startswith("mission.items[2].complexItemType fwLandingPattern: expected one that carries")


def test_an_item_inside_a_survey_is_found():
    inner = copy.deepcopy(PLAN["mission"]["items"][2])
    inner["params"][4] = 99
    survey = {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "TransectStyleComplexItem": {"Items": [PLAN["mission"]["items"][2], inner]},
    }
    message = refusal(edited(ITEM, survey))
    assert message.startswith("mission.items[2].TransectStyleComplexItem.Items[1].params[4] 99: expected a lat")


def test_a_jump_to_nowhere():
    jump = {"type": "SimpleItem", "command": 177, "frame": 2, "autoContinue": True, "doJumpId": 3}
    message = refusal(edited(ITEM, jump | {"params": [77, 1, 0, 0, 0, 0, 0]}))
    assert message.startswith("mission.items[2].params[0] 77.0: expected the doJumpId of an item")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{\n  "fileType": "Plan",\n  oops\n}', "line 3 column 3: bad JSON"),
        ('{"fileType": "Plan", "version": NaN}', "NaN: JSON has no such number"),
        ('{"a": -Infinity}', "-Infinity: JSON"),
        ('{"a":' * 100_000, "bad JSON"),
        ('{"a": ' + "1" * 5000 + "}", "bad JSON"),
        ("", 'begins with "": expected a .plan'),
        ("   \n", 'begins with ""'),
        ("[1, 2]", "begins with [1, 2]: expected a .plan"),
        ("time_s,value\n0,1\n", "begins with time_s,value"),
        ("<?xml version='1.0'?>" + "x" * 1000, "begins with <?xml"),
        ("QGC WPL 100\n", "line 1 QGC WPL 100: expected QGC WPL 110"),
        ("QGC WPL 110\n", "expected at least one item"),
    ],
)
def test_files_that_are_no_missions(text, words):
    assert refusal(text.encode()).startswith(words)


def test_bytes_that_are_no_text():
    assert refusal(b"\x89MCAP0\r\n").startswith("byte 0 is no text")


@pytest.mark.parametrize(
    ("line", "column", "value", "words"),
    [
        (4, 0, "7", "line 5, sequence 7: expected 3"),
        (4, 0, "x", "line 5, sequence x: expected a whole number"),
        (4, 2, "1", "line 5, frame 1: expected a global or mission frame"),
        (4, 3, "-1", "line 5, command -1: expected 0 to 65535"),
        (4, 4, "fast", "line 5, param 1 fast: expected a number"),
        (4, 5, "inf", "line 5, param 2 Infinity: expected a finite number"),
        (4, 8, "91", "line 5, x (latitude) 91.0: expected a latitude"),
        (4, 9, "-180.5", "line 5, y (longitude) -180.5: expected a longitude"),
        (4, 9, "nan", "line 5, y (longitude) null: expected degrees"),
        (4, 10, "nan", "line 5, z (altitude) NaN: expected an altitude"),
        (3, 8, "1e12", "line 4, x (latitude) 1000000000000.0: expected a whole number of at most"),
        (4, 11, "2", "line 5, autocontinue 2: expected 0 or 1"),
    ],
)
def test_a_line_with_one_wrong_field(line, column, value, words):
    lines = list(LINES)
    fields = lines[line].split("\t")
    fields[column] = value
    lines[line] = "\t".join(fields)
    assert refusal("\n".join(lines).encode()).startswith(words)


def test_a_line_cut_short_and_a_line_too_long():
    cut = "\n".join(LINES)[:-20]
    assert refusal(cut.encode()) == f"line {len(LINES)}, 9 fields: expected 12"
    assert refusal("\n".join([*LINES[:3], LINES[3] + "\t0"]).encode()) == "line 4, 13 fields: expected 12"


def read_or_refused(data: bytes) -> str:
    """The complaint about a file, or nothing where it is read: then it can be written again."""
    try:
        mission = parse_plan(data, "flight").mission
    except BadInputError as error:
        return str(error)
    assert mission.items
    assert plan_bytes(with_home_item(mission), ".waypoints")
    return ""


@settings(deadline=None)
@given(st.binary(max_size=60), st.integers(0, 4000))
def test_damaged_files_are_read_or_refused_and_nothing_else(noise, place):
    for good in (plan_bytes(MISSION), plan_bytes(MISSION, ".txt")):
        message = read_or_refused(good[:place] + noise + good[place + len(noise) :])
        assert "\n" not in message


scalars = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), st.text(max_size=5))
anything = st.recursive(scalars, lambda s: st.lists(s, max_size=8) | st.dictionaries(st.text(max_size=3), s))


@settings(deadline=None)
@given(
    st.sampled_from([
        ("mission",), ("mission", "items"), ("mission", "items", 1), ("mission", "plannedHomePosition"),
        ITEM, (*ITEM, "params"), (*ITEM, "params", 0), (*ITEM, "params", 4),
        (*ITEM, "frame"), (*ITEM, "command"),
    ]),
    anything,
)  # fmt: skip
def test_plans_with_anything_anywhere_are_read_or_refused(path, value):
    assert "\n" not in read_or_refused(edited(path, value))


def test_what_other_editors_do_to_a_file_is_harmless():
    text = "\n".join(["QGC WPL 110", "# a comment", *LINES[1:4], "", *LINES[4:]])
    crlf = b"\xef\xbb\xbf" + text.replace("\n", "\r\n").replace("\t", "    ").encode()
    assert parse_plan(crlf, "flight").mission == MISSION
    assert parse_plan(b"\xef\xbb\xbf" + json.dumps(PLAN).encode(), "flight").mission == MISSION


def test_version_120_has_no_home():
    bare = ["QGC WPL 120", *(f"{q}\t{line.split(chr(9), 1)[1]}" for q, line in enumerate(LINES[2:]))]
    mission = parse_plan("\n".join(bare).encode(), "flight").mission
    assert mission.home is None
    assert mission.items == MISSION.items[1:]


def test_an_unset_home_is_noted_and_the_first_waypoint_stands_in():
    plan = parse_plan(edited(("mission", "plannedHomePosition"), [0, 0, 0]), "flight")
    assert plan.mission.home is None
    assert plan.mission.items == MISSION.items[1:]
    assert len(plan.notes) == 1
    assert "plannedHomePosition" in plan.notes[0]


def test_a_fraction_where_the_wire_has_whole_numbers_is_noted():
    plan = parse_plan(edited(("mission", "items", 1, "params", 5), 2.5), "flight")
    assert plan.notes == ("mission.items[1].params[5] 2.5 is carried as a whole number: 2",)


def test_missing_files_and_folders_are_named(tmp_path):
    with pytest.raises(BadInputError, match=r"gone\.plan: cannot be read: no such file"):
        read_plan(tmp_path / "gone.plan")
    with pytest.raises(BadInputError, match="cannot be read: is a directory"):
        read_plan(tmp_path)
    with pytest.raises(BadInputError, match=r"no/where\.plan: cannot be written: no such file"):
        write_plan(tmp_path / "no" / "where.plan", MISSION)


def test_an_unknown_ending_and_an_empty_mission_leave_no_file(tmp_path):
    with pytest.raises(BadInputError, match=r"star\.kml: ending '\.kml': expected \.plan .*, \.waypoints or \.txt"):
        write_plan(tmp_path / "star.kml", MISSION)
    with pytest.raises(BadInputError, match=r"empty\.plan: the mission is empty"):
        write_plan(tmp_path / "empty.plan", Mission(()))
    nowhere = Mission((MissionItem(20, 2, (math.nan,) * 4, 0, 0, 0.0),))
    with pytest.raises(BadInputError, match=r"nowhere\.txt: the mission has no home and no position"):
        write_plan(tmp_path / "nowhere.txt", nowhere)
    assert list(tmp_path.iterdir()) == []


def test_writing_replaces_whole_files_only(tmp_path):
    target = tmp_path / "flight.plan"
    target.write_text("what was there")
    write_plan(target, MISSION)
    assert target.read_bytes() == plan_bytes(MISSION)
    assert [p.name for p in tmp_path.iterdir()] == ["flight.plan"]
    blocked = tmp_path / "blocked.plan"
    blocked.mkdir()
    with pytest.raises(BadInputError, match="cannot be written"):
        write_plan(blocked, MISSION)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["blocked.plan", "flight.plan"]
