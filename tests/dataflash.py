"""DataFlash logs as ArduPilot 4.x writes them: FMT records first, then packed records of what they describe."""

from __future__ import annotations

import struct
from typing import Any

from flown import Flown

HEAD = b"\xa3\x95"
FORMATS = {  # name: (type, format, labels), as in LogStructure.h and GCS_Common.cpp
    "CMD": (30, "QHHHffffLLfB", "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame"),
    "MISE": (31, "QHHHffffLLfB", "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame"),
    "ATT": (32, "QccccCCCCB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF"),
    "POS": (33, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "XKF1": (34, "QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH"),
    "XKF4": (35, "QBHHHHHfffHBIHb", "TimeUS,C,SV,SP,SH,SM,SVT,errRP,OFN,OFE,FS,TS,SS,GPS,PI"),
    "MSG": (36, "QZ", "TimeUS,Message"),
    "NVAL": (200, "QINfBB", "TimeUS,TimeBootMS,Name,Value,SSys,SCom"),
}
SIZES = {"Q": "Q", "H": "H", "f": "f", "L": "i", "B": "B", "c": "h", "C": "H", "e": "i", "I": "I", "b": "b",
         "Z": "64s", "N": "16s", "n": "4s"}  # fmt: skip


def packing(form: str) -> str:
    return "<" + "".join(SIZES[letter] for letter in form)


def record(name: str, *values: Any) -> bytes:
    number, form, _ = FORMATS[name]
    return HEAD + bytes((number,)) + struct.pack(packing(form), *values)


def formats(*left_out: str) -> bytes:
    """The FMT records, FMT's own first."""
    own = {"FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns")}
    out = b""
    for name, (number, form, labels) in {**own, **{k: v for k, v in FORMATS.items() if k not in left_out}}.items():
        length = 3 + struct.calcsize(packing(form))
        body = (number, length, name.encode(), form.encode(), labels.encode())
        out += HEAD + b"\x80" + struct.pack("<BB4s16s64s", *body)
    return out


def dataflash(
    flown: Flown, places: list[tuple[int, int]] | None = None, *, drop: str = "", turned_deg: int = 0
) -> bytes:
    """The flight as the vehicle's own log has it; `places` (lat, lon · 1e7) are its mission's, item 0 home.

    POS is nonsense: nobody may read it.
    """
    out = bytearray(formats())
    total = len(places or ())
    for number, (lat, lon) in enumerate(places or ()):
        out += record("CMD", 1000, total, number, 16, 0, 0, 0, 0, lat, lon, 10.0, 3 if number else 0)
    out += record("XKF4", 1000, 0, *[0] * 5, *[0.0] * 3, 0, 0, 0, 0, 1)  # core 1 is in charge
    for frame in flown.frames:
        message, now_us = frame.message, frame.received_ns // 1000
        match message.get_type():
            case "NAMED_VALUE_FLOAT":
                sender = message.get_srcSystem(), message.get_srcComponent()
                each = record("NVAL", now_us, message.time_boot_ms, message.name.encode(), message.value, *sender)
            case "LOCAL_POSITION_NED":
                m, at_us = message, message.time_boot_ms * 1000
                filtered = (m.vx, m.vy, m.vz, 0.0, m.x, m.y, m.z)
                wrong = [10.0 * value + 1.0 for value in filtered]
                each = record("XKF1", at_us, 0, 0, 0, 0, *wrong, 0, 0, 0, 0)
                each += record("XKF1", at_us, 1, 0, 0, 0, *filtered, 0, 0, 0, 0)
                each += record("POS", at_us, at_us % 10**9, 7, 1.0, 2.0, 3.0)
                each += record("ATT", at_us, 0, 0, 0, 0, 0, (9000 + 100 * turned_deg) % 36000, 0, 0, 3)
            case "MISSION_CURRENT":
                each = record("MISE", now_us, total, message.seq, 16, 0, 0, 0, 0, 0, 0, 10.0, 3)
                each += record("MISE", now_us, total, message.seq + 1, 178, 0, 5, 0, 0, 0, 0, 0.0, 3)
            case "MISSION_ITEM_REACHED":
                each = record("MSG", now_us, f"Reached command #{message.seq}".encode())
            case _:
                each = record("MSG", now_us, b"EKF3 IMU0 is using GPS")
        out += each
    return bytes(out)
