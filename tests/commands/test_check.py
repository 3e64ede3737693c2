"""`check`: what a vehicle's parameters are and should be, --fix, --restore."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from fakes import flying
from running import run

from dslam_mav.mav.gps_denied import findings


def values(url: str, *words: object) -> dict[str, float]:
    return {row["name"]: row["value"] for row in run("check", "--connect", url, *words, "--json").object["parameters"]}


@pytest.mark.parametrize(
    ("profile", "navigation", "named"),
    [("ardupilot", "flow", "EK3_SRC1_VELXY"), ("ardupilot", "odometry", "VISO_TYPE"), ("px4", "flow", "EKF2_OF_CTRL"),
     ("px4", "flow", "COM_POS_FS_EPH"), ("px4", "odometry", "EKF2_EV_CTRL")],
)  # fmt: skip
def test_what_is_wrong_is_set_remembered_and_put_back(
    profile: str, navigation: str, named: str, tmp_path: Path
) -> None:
    saved = tmp_path / "before.json"
    with flying(profile=profile) as (url,):
        to = ("--connect", url, "--saved", saved)
        shipped = values(url, "--navigation", navigation)
        first = run("check", *to, "--navigation", navigation)
        assert first.code == 1
        (line,) = [line for line in first.out.splitlines() if line.startswith(named)]
        assert "<--" in line
        fixed = run("check", *to, "--navigation", navigation, "--fix", "--json")
        assert (fixed.code, fixed.object["ready"], fixed.err) == (0, True, "")
        assert named in fixed.object["changed"]
        assert json.loads(saved.read_text())["parameters"][named]["value"] == shipped[named]
        assert fixed.object["reboot"] is (profile == "ardupilot")
        again = run("check", *to, "--json").object  # finds out itself what it is set for
        assert (again["ready"], again["navigation"]) == (True, navigation)
        assert run("check", *to, "--restore").code == 0
        assert values(url, "--navigation", navigation) == shipped
        assert not saved.exists()


def test_fixing_twice_keeps_what_was_there_first(tmp_path: Path) -> None:
    saved = tmp_path / "before.json"
    with flying(profile="ardupilot") as (url,):
        to = ("--connect", url, "--saved", saved)
        for navigation in ("flow", "odometry"):
            assert run("check", *to, "--navigation", navigation, "--fix").code == 0
        assert json.loads(saved.read_text())["parameters"]["EK3_SRC1_POSXY"]["value"] == 3.0


def test_what_the_vehicle_refuses_stays_and_the_rest_is_put_back(tmp_path: Path) -> None:
    saved = tmp_path / "before.json"
    with flying(profile="px4") as (url,):
        to = ("--connect", url, "--saved", saved)
        shipped = values(url, "--navigation", "flow")
        assert run("check", *to, "--navigation", "flow", "--fix").code == 0
        held = json.loads(saved.read_text())
        kept = {"EKF2_GONE": {"value": 1.0, "type": 6}, "COM_HALF": {"value": 0.5, "type": 6}}
        saved.write_text(json.dumps({**held, "parameters": kept | held["parameters"]}))
        done = run("check", *to, "--restore", "--json")
        assert done.code == 1
        silent, half = done.err.splitlines()
        assert "does not answer for parameter EKF2_GONE" in silent
        assert "COM_HALF 0.5: expected a whole number" in half
        assert json.loads(saved.read_text()) == {"system": 1, "parameters": kept}
        assert done.object["refused"] == {"EKF2_GONE": 1.0, "COM_HALF": 0.5}
        assert set(done.object["restored"]) == set(held["parameters"])
        assert values(url, "--navigation", "flow") == shipped
        told = run("check", *to, "--restore")
        assert (told.code, told.out) == (1, f"0 parameters put back, 2 parameters could not be, and stay in {saved}\n")


def test_only_its_owner_knows_a_real_vehicles_sensors() -> None:
    held = {"GPS1_TYPE": 0.0, "FLOW_TYPE": 0.0, "RNGFND1_TYPE": 20.0}
    found = {f.name: f for f in findings("ardupilot", "flow", held)}
    assert (found["FLOW_TYPE"].ok, found["FLOW_TYPE"].wanted) == (False, None)
    assert found["RNGFND1_TYPE"].ok
    assert "SIM_FLOW_ENABLE" not in found
    assert found["EK3_SRC1_YAW"].value is None
    old = {f.name: f for f in findings("ardupilot", "flow", {"GPS_TYPE": 1.0})}
    assert (old["GPS_TYPE"].ok, old["GPS_TYPE"].wanted) == (False, 0)
    more = {f.name: f for f in findings("px4", "vision", {"EKF2_EV_CTRL": 4.0})}
    assert more["EKF2_EV_CTRL"].wanted == 15.0, "bits that are set stay set"


@pytest.mark.parametrize(("value", "ok"), [(5.0, False), (0.0, False), (50.0, True), (100.0, True), (-1.0, True)])
def test_drift_of_optical_flow_must_not_end_a_mission(value: float, ok: bool) -> None:
    found = {f.name: f for f in findings("px4", "flow", {"COM_POS_FS_EPH": value})}["COM_POS_FS_EPH"]
    assert (found.ok, found.wanted) == (ok, value if ok else 50.0)
    others = [f.name for way in ("odometry", "vision") for f in findings("px4", way, {})]
    assert "COM_POS_FS_EPH" not in others


def test_bad_files_and_vehicles_are_one_line(tmp_path: Path) -> None:
    saved = tmp_path / "before.json"
    saved.write_text('{"system": 9, "parameters": {}}')
    with flying(profile="ardupilot") as (url,):
        other = run("check", "--connect", url, "--saved", saved, "--restore")
        assert (other.code, "system 9: expected 1" in other.line()) == (2, True)
        saved.write_text("{}")
        assert "expected what" in run("check", "--connect", url, "--saved", saved, "--restore").line()
        none = run("check", "--connect", url, "--saved", tmp_path / "none.json", "--restore")
        assert (none.code, "cannot be read: no such file" in none.line()) == (2, True)
    with flying() as (url,):
        assert "expected ardupilot or px4" in run("check", "--connect", url).line()
