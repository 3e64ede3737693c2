from __future__ import annotations

import math
from dataclasses import replace

import pytest
from fakes import mission

from dslam_mav.mav.mission.compare import first_difference
from dslam_mav.mission import CMD_LAND, MissionItem

SENT = (
    *mission(hold_s=2.7).items[:4],
    MissionItem(CMD_LAND, 6, (0.0, 0.0, 0.0, 0.0), 473977420, 85455940, 0.004),
)


def stored_by_ardupilot(item: MissionItem) -> MissionItem:
    frame = {6: 3, 5: 0}.get(item.frame, item.frame)
    hold, p2, p3, _ = item.params
    p4 = 1.0 if item.command == CMD_LAND else 0.0
    params = (float(int(hold)), *(0.0 if math.isnan(p) else p for p in (p2, p3)), p4)
    return replace(item, frame=frame, params=params, z=round(item.z, 2))


def test_known_roundings_are_no_difference() -> None:
    assert first_difference(SENT, tuple(map(stored_by_ardupilot, SENT))) is None
    px4 = tuple(replace(i, frame={3: 6, 0: 5}.get(i.frame, i.frame)) for i in SENT)
    assert first_difference(SENT, px4) is None


@pytest.mark.parametrize(
    ("seq", "change", "words"),
    [
        (2, {"x": SENT[2].x + 50}, "item 2 (NAV_WAYPOINT): x"),
        (3, {"y": SENT[3].y - 2}, "item 3 (NAV_WAYPOINT): y"),
        (2, {"z": 10.05}, "item 2 (NAV_WAYPOINT): z: sent 10.0, the vehicle holds 10.05"),
        (2, {"params": (1.0, 0, 0, 0)}, "item 2 (NAV_WAYPOINT): param1"),
        (1, {"params": (1.0, 5.0, -1.0, 0.0)}, "item 1 (DO_CHANGE_SPEED): param2: sent 8.0"),
        (0, {"z": 12.0}, "item 0 (NAV_TAKEOFF): z"),
        (3, {"frame": 0}, "item 3 (NAV_WAYPOINT): frame"),
        (
            4,
            {"command": 20},
            "item 4 (NAV_LAND): command: sent NAV_LAND, the vehicle holds NAV_RETURN_TO_LAUNCH",
        ),
    ],
)
def test_real_differences_name_item_and_field(seq: int, change: dict[str, object], words: str) -> None:
    held = list(SENT)
    held[seq] = replace(held[seq], **change)
    difference = first_difference(SENT, tuple(held))
    assert difference is not None
    assert words in difference


def test_a_short_mission_is_told() -> None:
    assert first_difference(SENT, SENT[:-1]) == "5 items were sent, the vehicle holds 4"


def test_the_vehicles_own_first_item_is_passed_over() -> None:
    home = MissionItem(16, 0, (0, 0, 0, 0), 1, 2, 3.0)
    moved = MissionItem(16, 0, (0, 0, 0, 0), 100, 200, 3.0)
    assert first_difference((home, *SENT), (moved, *SENT), first=1) is None
