"""Parameters over the wire: ArduPilot's floats are values, PX4's are bytes."""

from __future__ import annotations

import struct

import pytest
from fakes import flying
from hypothesis import given
from hypothesis import strategies as st

from dslam_mav.errors import DslamError
from dslam_mav.mav.frames import messages
from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.talk import Talk
from dslam_mav.mav.params import Param, from_wire, read_param, set_param, to_wire

M = messages()
INT8, INT32, REAL32 = 2, 6, 9


@given(st.integers(-(2**31), 2**31 - 1))
def test_every_whole_number_survives_bytewise(value: int) -> None:
    packed = M.MAVLink_param_value_message(b"X", to_wire(value, INT32, bytewise=True), INT32, 1, 0)
    raw = packed.pack(M.MAVLink(None, srcSystem=1, srcComponent=1))
    back = M.MAVLink(None).decode(bytearray(raw))
    assert from_wire(back, bytewise=True) == value or value >> 23 & 0xFF == 0xFF  # NaN payloads are the wire's own


def test_px4s_integers_are_bytes_and_ardupilots_are_values() -> None:
    assert struct.pack("<f", to_wire(15, INT32, bytewise=True)) == struct.pack("<i", 15)
    assert to_wire(15, INT32, bytewise=False) == 15.0
    assert to_wire(2.5, REAL32, bytewise=True) == 2.5
    with pytest.raises(ValueError, match="whole number"):
        to_wire(2.5, INT8, bytewise=False)
    with pytest.raises(ValueError, match="too large"):
        to_wire(300, INT8, bytewise=False)


@pytest.mark.parametrize(("profile", "name", "value"), [("ardupilot", "GPS1_TYPE", 0), ("px4", "EKF2_GPS_CTRL", 3)])
def test_a_parameter_is_read_set_and_read_back(profile: str, name: str, value: int) -> None:
    with flying(profile=profile) as (url,), Link(url, system=255, component=190) as link:
        talk = Talk(link, wait_for_vehicle(link, 5.0))
        before = read_param(talk, name)
        assert before is not None
        assert before.value == {"GPS1_TYPE": 1, "EKF2_GPS_CTRL": 7}[name]
        assert set_param(talk, Param(name, value, before.type)).value == value
        after = read_param(talk, name)
        assert after is not None
        assert after.value == value


def test_a_value_that_the_vehicle_will_not_keep_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dslam_mav.mav.params._TRIES", 1)
    with flying() as (url,), Link(url, system=255, component=190) as link:
        talk = Talk(link, wait_for_vehicle(link, 5.0))
        with pytest.raises(DslamError, match="keeps CRUISE_M_S at 5, 9 was asked"):
            set_param(talk, Param("CRUISE_M_S", 9.0))
        assert read_param(talk, "NO_SUCH") is None
