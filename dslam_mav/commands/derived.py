"""A log made of another: the same flight under other assumptions, beside it, and where it comes from."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shlex
import sys
import time
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from dslam_mav.commands.assume import Recorded, configuration
from dslam_mav.commands.attached import CONFIGURATION_ATTACHMENT, MISSION_ATTACHMENT, attach
from dslam_mav.commands.logged import Logged
from dslam_mav.errors import LogError, unwritable
from dslam_mav.files import check_output
from dslam_mav.log.reader import read_log
from dslam_mav.log.recorder import LOG_ENDS, Recorder
from dslam_mav.mission import leg_plan
from dslam_mav.observations import Reading
from dslam_mav.recordings import PROVENANCE_ATTACHMENT, RECORDING_ATTACHMENT, Telemetry
from dslam_mav.records import Estimate

MAVLINK_1 = 0xFE


def derived_name(log: Path) -> Path:
    """`LOG.set-N.mcap` beside the log, N the first that is free."""
    number = 1
    while (path := log.with_name(f"{log.stem}.set-{number}.mcap")).exists():
        number += 1
    return path


def write_derived(logged: Logged, estimate: Estimate, settings: Sequence[str], columns: str | None) -> Path:
    """Write `LOG.set-N.mcap` beside the log: whole or not at all. It holds what the log holds, the assumptions and the
    estimate as they are now, and `provenance.json`.
    """
    path = derived_name(logged.path)
    check_output(path)
    beside = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with Recorder(beside) as recorder:
            last_ns = _content(recorder, logged)
            recorder.attach(PROVENANCE_ATTACHMENT, "application/json", _provenance(logged, settings, columns))
            legs, flight = logged.replayed.legs, logged.replayed.flight
            recorder.estimate(last_ns, estimate, len(legs), final=True, flight=flight)
        beside.rename(path)
    except LogError as problem:  # the file that says so is gone
        told = str(problem).replace(str(beside), str(path)).removesuffix(LOG_ENDS)
        raise LogError(told) from None
    except OSError as problem:
        raise unwritable(path, problem) from None
    finally:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
    return path


def _content(recorder: Recorder, logged: Logged) -> int:
    """Put in what the old log holds but its estimates; the time of its last message, ns."""
    own = logged.recorded or Recorded(logged.assumptions)
    again = Recorded(logged.assumptions, own.vehicle_system, own.home_item)
    if logged.log is None:
        last_ns = _recording(recorder, logged)
        held = {}
    else:
        full = read_log(logged.path)
        held = full.attachments
        last_ns = max((t for t, *_ in (*full.frames, *full.readings, *full.progress)), default=0)
        for time_ns, raw in full.frames:
            recorder.frame(time_ns, raw)
        for time_ns, reading in full.readings:
            recorder.reading(time_ns, reading)
        for time_ns, progress in full.progress:
            recorder.progress(time_ns, progress)
        for time_ns, level, text in full.texts:
            recorder.text(time_ns, level, text)
        if full.truth is not None:
            recorder.truth(last_ns, full.truth)
    for name, data in held.items():
        if name not in (CONFIGURATION_ATTACHMENT, PROVENANCE_ATTACHMENT):
            recorder.attach(name, "application/octet-stream", data)
    if MISSION_ATTACHMENT not in held and logged.mission is not None and leg_plan(logged.mission).sequence:
        attach(recorder, logged.mission, logged.assumptions, again.vehicle_system or 1)
    else:
        command = "dslam-mav " + shlex.join(sys.argv[1:])
        recorder.attach(CONFIGURATION_ATTACHMENT, "application/json", configuration(again, command))
    return last_ns


def _recording(recorder: Recorder, logged: Logged) -> int:
    """A recording of others: its packets, or where it has none of MAVLink 2 the file itself; its readings for eyes."""
    recording = logged.recording
    if isinstance(recording, Telemetry) and not any(frame.raw[0] == MAVLINK_1 for frame in recording.frames):
        for frame in recording.frames:
            recorder.frame(frame.received_ns, frame.raw)
        last_ns, first_ns = recording.frames[-1].received_ns, recording.frames[0].received_ns
    else:
        name = RECORDING_ATTACHMENT + logged.path.suffix.lower()
        recorder.attach(name, "application/octet-stream", logged.path.read_bytes())
        first_ns = last_ns = 0
    time_ms, value = logged.replayed.collector.readings()
    for at_ms, each in zip((time_ms - time_ms[0]).tolist(), value.tolist(), strict=True):
        last_ns = max(last_ns, first_ns + at_ms * 1_000_000)
        recorder.reading(first_ns + at_ms * 1_000_000, Reading((at_ms + int(time_ms[0])) % 2**32, each))
    return last_ns


def _provenance(logged: Logged, settings: Sequence[str], columns: str | None) -> bytes:
    earlier = None if logged.log is None else logged.log.attachments.get(PROVENANCE_ATTACHMENT)
    body: dict[str, Any] = {
        "log": logged.path.name,
        "sha256": hashlib.sha256(logged.path.read_bytes()).hexdigest(),
        "set": dict(setting.split("=", 1) for setting in settings),
        "columns": columns,
        "command": "dslam-mav " + shlex.join(sys.argv[1:]),
        "version": version("dslam-mav"),
        "made": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }
    if earlier is not None:
        with contextlib.suppress(ValueError):
            body["made_from"] = json.loads(earlier)
    return json.dumps(body, indent=2).encode()
