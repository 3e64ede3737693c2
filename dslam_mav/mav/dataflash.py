"""DataFlash logs (.bin) that ArduPilot keeps on board: records to observations and the mission; the gate for them. Pure
but for the file.

Of a record only what `mav.decode` would let through of the same flight's packets becomes an observation: NVAL is
NAMED_VALUE_FLOAT as received, MISE a mission item begun, MSG "Reached command" an item reached, XKF1 (NKF1 of old
firmware) the vehicle's own dead reckoning, ATT its yaw. Fields as in ArduPilot's LogStructure.h (AP_Logger, AP_Mission,
AP_NavEKF3, AP_AHRS) and GCS_Common.cpp; positions (POS, GPS, ORGN) are never read.
"""

from __future__ import annotations

import contextlib
import io
import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dslam_mav.errors import BadInputError, unreadable
from dslam_mav.mav.decode import READING_NAME
from dslam_mav.mav.frames import COMPONENT_BRIDGE, COMPONENT_ESTIMATOR
from dslam_mav.mission import DEGREES_E7, Mission, MissionItem
from dslam_mav.observations import Observation, Odometry, Progress, Reading, Yaw

MAGIC = b"\xa3\x95\x80"
"""A record's two head bytes, and FMT, which describes itself first."""

LAST_NAVIGATION_COMMAND = 95
"""MAV_CMD_NAV_LAST: commands above are done on the way, and end no leg."""

_HEAD, _FMT = MAGIC[:2], MAGIC[2]
_PAGE_BYTES = 256
_USED = ("NVAL", "CMD", "MISE", "MSG", "XKF1", "XKF4", "NKF1", "NKF4", "ATT")
_REACHED = re.compile(r"Reached (?:command|waypoint) #(\d+)")


@dataclass(frozen=True, slots=True)
class DataFlash:
    """What a DataFlash log tells of a flight. `observations` in the order logged, `mission`
    as the vehicle held it last (None: none or not all of it), `names` of all values received, `records` of each kind
    used, `duration_s` between the first and the last of them, `bad_bytes` that are in no record.
    """

    observations: tuple[Observation, ...]
    mission: Mission | None
    names: tuple[str, ...]
    records: dict[str, int]
    duration_s: float
    bad_bytes: int


def read_dataflash(path: Path) -> DataFlash:
    """The log at `path`; BadInputError in one line for what cannot be read. Damaged records are left out."""
    contents = _Contents()
    bad_bytes = _use_records(path, contents.take)
    duration_s = (contents.last_us - (contents.first_us or 0)) / 1e6
    return DataFlash(
        tuple(contents.observations),
        contents.commands.mission(),
        tuple(sorted(contents.names)),
        dict(sorted(contents.counts.items())),
        duration_s,
        bad_bytes,
    )


def lack(log: DataFlash) -> str | None:
    """What the log has not that a flight is made of, in words; None where nothing is missing."""
    kinds = {type(observation) for observation in log.observations}
    if not log.records.get("NVAL"):
        return "no NVAL records: the autopilot received no NAMED_VALUE_FLOAT, or logged none"
    if Reading not in kinds:
        return f"no {READING_NAME} readings; names in NVAL: {', '.join(log.names)}"
    if Progress not in kinds:
        return 'no MISE records of navigation commands, nor MSG "Reached command": the legs cannot be told apart'
    if Odometry not in kinds:
        return "no XKF1 records: the distance flown cannot be told"
    return None


class _Contents:
    """What is kept of the records, one after the other."""

    def __init__(self) -> None:
        self.observations: list[Observation] = []
        self.commands = _Commands()
        self.names: set[str] = set()
        self.counts: Counter[str] = Counter()
        self.first_us: int | None = None
        self.last_us = 0
        self._kinds = _Kinds()

    def take(self, record: Any) -> None:
        kind, time_us = record.get_type(), int(record.TimeUS)
        self.counts[kind] += 1
        self.first_us = time_us if self.first_us is None else min(self.first_us, time_us)
        self.last_us = max(self.last_us, time_us)
        if kind == "CMD":
            self.commands.take(record)
        elif kind == "NVAL":
            self.names.add(str(record.Name))
        observation = self._kinds.observation(kind, record)
        if observation is not None:
            self.observations.append(observation)


class _Kinds:
    """Record -> observation; remembers which core of the filter is in charge."""

    def __init__(self) -> None:
        self._primary = 0

    def observation(self, kind: str, record: Any) -> Observation | None:
        time_ms = int(record.TimeUS) // 1000
        match kind:
            case "NVAL":
                return _reading(record)
            case "MISE" if record.CId <= LAST_NAVIGATION_COMMAND:
                return Progress(int(record.CNum), reached=False)
            case "MSG":
                reached = _REACHED.match(record.Message)
                return None if reached is None else Progress(int(reached[1]), reached=True)
            case "XKF1" | "NKF1" if getattr(record, "C", 0) == self._primary:
                return Odometry(time_ms, float(record.PN), float(record.PE), float(record.VN), float(record.VE))
            case "XKF4" | "NKF4" if record.PI >= 0:
                self._primary = int(record.PI)
            case "ATT":
                return Yaw(time_ms, math.radians(record.Yaw))
        return None


def _reading(record: Any) -> Reading | None:
    component = int(getattr(record, "SCom", COMPONENT_BRIDGE))
    if component == COMPONENT_ESTIMATOR or not record.Name.startswith(READING_NAME):
        return None
    return Reading(int(record.TimeBootMS), float(record.Value), str(record.Name), component)


class _Commands:
    """CMD records -> the mission: written whole when a log begins, and item by item as it is uploaded."""

    def __init__(self) -> None:
        self._items: dict[int, MissionItem] = {}
        self._total = 0

    def take(self, record: Any) -> None:
        number = int(record.CNum)
        if record.CTot != self._total or number == 0:
            self._items.clear()
        self._total = int(record.CTot)
        frame = int(getattr(record, "Frame", 3))
        params = (float(record.Prm1), float(record.Prm2), float(record.Prm3), float(record.Prm4))
        # the format scales both fields as degrees, whatever the frame
        x, y = round(record.Lat * DEGREES_E7), round(record.Lng * DEGREES_E7)
        self._items[number] = MissionItem(int(record.CId), frame, params, x, y, float(record.Alt))

    def mission(self) -> Mission | None:
        if not self._total or set(self._items) != set(range(self._total)):
            return None
        return Mission(tuple(self._items[number] for number in range(self._total)))


def _reader(path: Path) -> Any:
    """pymavlink's reader; the compiled indexer writes of every bad byte to the terminal, the other to `sys.stderr`."""
    from pymavlink import DFReader  # slow to import, and few logs are of this kind

    class Reader(DFReader.DFReader_binary):
        def init_arrays_fast(self, progress_callback: Any = None) -> None:
            self.init_arrays(progress_callback)  # type: ignore[no-untyped-call]
            _index_the_rest(self)

    return Reader(str(path))  # type: ignore[no-untyped-call]


def _index_the_rest(reader: Any) -> None:
    """The records behind one of a kind that no FMT describes: there pymavlink's index ends, although it may be one
    damaged byte.
    """
    data, forms = reader.data_map, reader.formats
    ends = (reader.offsets[kind][-1] + forms[kind].len for kind, count in enumerate(reader.counts) if count)
    at = data.find(_HEAD, max(ends, default=0))
    while 0 <= at < len(data) - len(_HEAD):
        kind = data[at + len(_HEAD)]
        whole = kind in forms and at + forms[kind].len <= len(data)
        if whole and kind == _FMT:
            reader.offset = at
            told = forms.get(getattr(reader._parse_next(), "Type", None))
            if told is not None:
                reader.name_to_id[told.name], reader.id_to_name[told.type] = told.type, told.name
        if whole:
            reader.offsets[kind].append(at)
            reader.counts[kind] += 1
            reader._count += 1
        at = data.find(_HEAD, at + (forms[kind].len if whole else 1))
    reader.offset = 0


def _use_records(path: Path, use: Callable[[Any], None]) -> int:
    """Every record used, whole ones only; how many bytes are in none. What the reader says of those is not for the
    person at the terminal.
    """
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            reader = _reader(path)
            while (record := reader.recv_match(type=list(_USED), strict=True)) is not None:
                if record.get_type() in _USED and "TimeUS" in record.get_fieldnames():
                    use(record)
    except OSError as problem:
        raise unreadable(path, problem) from None
    except Exception as problem:  # the library raises whatever a broken file makes it raise
        raise BadInputError(f"{path}: no DataFlash log that can be read: {problem}") from None
    if not any(reader.counts):
        raise BadInputError(f"{path}: no DataFlash log: expected records that begin with a3 95, found none")
    return _bad_bytes(reader)


def _bad_bytes(reader: Any) -> int:
    """Bytes in no record, but for what pads the last page of logs that are kept in pages."""
    bad = reader.data_len - sum(n * reader.formats[kind].len for kind, n in enumerate(reader.counts) if n)
    return 0 if bad < _PAGE_BYTES else int(bad)
