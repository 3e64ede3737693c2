"""MAVProxy and Rerun with what we fly and write: `make interop`, which installs them in an environment of their own.

MAVProxy loads our mission file into the loopback vehicle, lists it back, and hears our readings; Rerun checks and
converts a flight's log. One row each; exit code 1 if anything fails.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

from dslam_mav.mav.link import Link, wait_for_vehicle
from dslam_mav.mav.mission.transfer import download
from dslam_mav.mav.readings import to_message
from dslam_mav.mission import Home, Mission, leg_plan
from dslam_mav.observations import Reading
from missions.plan import Profile, plan_mission
from missions.plan_file import write_plan
from sim_bridge.vehicle import DEFAULT_HOME, Vehicle

STAR = [(0.0, 0.0), (40.0, 0.0), (4.0, 17.0), (29.0, -14.0), (20.0, 25.0), (11.0, -14.0), (36.0, 17.0), (0.0, 0.0)]
HOME = Home(DEFAULT_HOME.latitude_deg, DEFAULT_HOME.longitude_deg, DEFAULT_HOME.altitude_m)
READINGS = 200


class MavProxy:
    """MAVProxy without windows, commands on its standard input; what it says is in `said`."""

    def __init__(self, program: Path, url: str, folder: Path) -> None:
        self.said = ""
        words = [str(program), f"--master={url}", "--streamrate=-1", "--default-modules=wp,misc,link,param,mode"]
        words += [f"--state-basedir={folder}", f"--logfile={folder / 'mav.tlog'}", "--nowait"]
        self._process = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=folder,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )  # fmt: skip
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def tell(self, command: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(command + "\n")
        self._process.stdin.flush()

    def await_words(self, pattern: str, timeout_s: float = 30.0) -> bool:
        until_s = time.monotonic() + timeout_s
        while time.monotonic() < until_s and self._process.poll() is None:
            if re.search(pattern, self.said, re.DOTALL):
                return True
            time.sleep(0.1)
        return bool(re.search(pattern, self.said, re.DOTALL))

    def end(self) -> None:
        self._process.kill()
        self._process.wait()

    def _read(self) -> None:
        assert self._process.stdout is not None
        while piece := self._process.stdout.read(1):
            self.said += piece


def mavproxy(program: Path, folder: Path, profile: str) -> str:
    """What went wrong, "" if nothing."""
    plan = plan_mission(STAR, HOME, Profile(hold_s=1.0))
    written = folder / f"star_{profile}.waypoints"
    write_plan(written, plan)
    stop = threading.Event()
    vehicle = Vehicle(["udpin:127.0.0.1:0"], profile=profile)
    thread = threading.Thread(target=vehicle.run, args=(stop,))
    thread.start()
    url = vehicle.urls[0].replace("udpin", "udpout")
    client = MavProxy(program, url, folder)
    try:
        return _mavproxy_session(client, url, written, plan)
    finally:
        client.end()
        stop.set()
        thread.join()


def _mavproxy_session(client: MavProxy, url: str, written: Path, plan: Mission) -> str:
    if not client.await_words(r"Detected vehicle|online system|Mode |heartbeat", 60.0):
        return f"MAVProxy heard no vehicle: {client.said[-300:]!r}"
    client.tell(f"wp load {written}")
    if not client.await_words(r"Flight plan received|Sent waypoint|Loaded \d+ waypoints.*(all|accepted|ACK|received)"):
        return f"wp load: {client.said[-300:]!r}"
    time.sleep(2.0)
    with Link(url, system=255, component=191) as link:
        held = download(link, wait_for_vehicle(link, 5.0))
    ours, theirs = leg_plan(plan), leg_plan(held)
    if theirs.vertices_m.shape != ours.vertices_m.shape or abs(theirs.vertices_m - ours.vertices_m).max() > 0.05:
        return f"the vehicle holds {len(theirs.sequence)} vertices, {len(ours.sequence)} were loaded"
    client.tell("wp list")
    if not client.await_words(rf"Requesting {len(held.items)} waypoints"):
        return f"wp list: {client.said[-300:]!r}"
    client.tell("set target_component 0")  # or it watches the autopilot's own messages only
    client.tell("watch NAMED_VALUE_FLOAT")
    with Link(url, system=1, component=158) as bridge:
        wait_for_vehicle(bridge, 5.0)
        for n in range(READINGS):
            bridge.send(to_message(Reading(1000 + n, 20.0 + n)))
            time.sleep(0.01)
    if not client.await_words(rf"name : THERMAL, value : {20.0 + READINGS - 1}"):
        return f"watch: {client.said[-300:]!r}"
    return ""


def rerun(program: Path, folder: Path) -> str:
    """Rerun's own check of a flight's log, its conversion, and whether it has something to draw of every picture."""
    words = [sys.executable, "-m", "dslam_mav", "fly", "--sources", "3", "--speedup", "30", "--out", str(folder)]
    flown = subprocess.run(words, capture_output=True, text=True, check=False)
    logs = list(folder.glob("*Z/flight.mcap"))
    if flown.returncode or len(logs) != 1:
        return f"fly: {flown.stderr.strip()}"
    for words in (["mcap", "check", str(logs[0])], ["mcap", "convert", str(logs[0]), "-o", str(folder / "flight.rrd")]):
        done = subprocess.run([str(program), *words], capture_output=True, text=True, check=False)
        if done.returncode:
            return f"rerun {' '.join(words[:2])}: {(done.stderr or done.stdout).strip()[-300:]}"
    words = [str(program), "rrd", "print", str(folder / "flight.rrd")]
    told = subprocess.run(words, capture_output=True, text=True, check=False).stdout
    drawn = {line.split(" - ")[1] for line in told.splitlines() if "Points3D:positions" in line}
    missing = {"/path_points", "/source_points", "/field_points", "/reading_points"} - drawn
    return f"rerun draws nothing of {', '.join(sorted(missing))}" if missing else ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=Path, default=Path("build/interop/bin"), help="where mavproxy.py and rerun are")
    programs = parser.parse_args().bin.resolve()
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        jobs: list[tuple[str, Callable[[], str]]] = [
            (f"MAVProxy, vehicle {profile}: wp load, wp list, watch", lambda p=profile: _proxy(programs, folder, p))  # type: ignore[misc]
            for profile in ("strict", "ardupilot")
        ]
        jobs.append(("Rerun: mcap check, mcap convert", lambda: rerun(programs / "rerun", folder)))
        for what, job in jobs:
            problem = job()
            failed += bool(problem)
            print(f"{what:50} {'FAILED: ' + problem if problem else 'ok'}", flush=True)
    return 1 if failed else 0


def _proxy(programs: Path, folder: Path, profile: str) -> str:
    own = folder / profile
    own.mkdir()
    return mavproxy(programs / "mavproxy.py", own, profile)


if __name__ == "__main__":
    sys.exit(main())
