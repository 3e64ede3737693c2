"""Options of the commands that speak with a vehicle."""

from __future__ import annotations

from dslam_mav.commands import options as shared
from dslam_mav.commands.command import Commands, add_command
from dslam_mav.commands.live_options import live
from dslam_mav.commands.options import COUNT, NOT_NEGATIVE, POSITIVE, SEED


def add_vehicle(commands: Commands) -> None:
    """Add them to the command line."""
    for add in (_transfer, _check, _vehicle, _bridge, _onboard, _fly):
        add(commands)


def _transfer(commands: Commands) -> None:
    upload = add_command(
        commands, "upload", "send a mission to a vehicle, read it back and compare",
        "star.plan --connect udpout:127.0.0.1:14550 --start", ("transfer", "run_upload"),
    )  # fmt: skip
    upload.add_argument("plan", metavar="PLAN", help=".plan or .waypoints")
    upload.add_argument(
        "--hold", metavar="S", type=NOT_NEGATIVE,
        help="the least wait at each corner, that legs are straight; 0: as drawn (default: as fly has it, 1 for "
        "ArduPilot and PX4, unless the plan has holds of its own)",
    )  # fmt: skip
    upload.add_argument("--start", action="store_true", help="then arm the vehicle and start the mission")
    shared.vehicle_link(upload)
    download = add_command(
        commands, "download", "fetch a vehicle's mission",
        "--connect udpout:127.0.0.1:14550 -o held.plan", ("transfer", "run_download"),
    )  # fmt: skip
    download.add_argument("-o", "--output", metavar="FILE", required=True, help=".plan or .waypoints")
    shared.vehicle_link(download)
    clear = add_command(
        commands, "clear", "make a vehicle forget its mission",
        "--connect udpout:127.0.0.1:14550", ("transfer", "run_clear"),
    )  # fmt: skip
    shared.vehicle_link(clear)


def _check(commands: Commands) -> None:
    parser = add_command(
        commands, "check", "is a vehicle set to fly without GPS; set it so, or put back what was",
        "--connect tcp:127.0.0.1:5760 --navigation flow --fix", ("check", "run"),
    )  # fmt: skip
    parser.add_argument(
        "--navigation", choices=("flow", "odometry", "vision"),
        help="what it is to fly by: optical flow, ODOMETRY or VISION_POSITION_ESTIMATE (default: what it is set for, "
        "or else flow)",
    )  # fmt: skip
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--fix", action="store_true", help="set what differs, read it back, remember what it was")
    what.add_argument("--restore", action="store_true", help="put back what --fix changed")
    parser.add_argument(
        "--saved", metavar="FILE", help="where it is remembered (default: vehicle-ID-parameters.json here)"
    )
    shared.vehicle_link(parser)


def _vehicle(commands: Commands) -> None:
    parser = add_command(
        commands, "vehicle", "a MAVLink autopilot stand-in that flies missions in straight legs",
        "--listen udpin:127.0.0.1:14550 --speedup 10", ("vehicle", "run"),
    )  # fmt: skip
    parser.add_argument(
        "--listen", metavar="URL", action="append", help="udpin:HOST:PORT or tcpin:HOST:PORT, repeatable"
    )
    parser.add_argument("--speedup", metavar="X", type=POSITIVE, default=1.0, help="times real time (default: 1)")
    parser.add_argument("--system", metavar="ID", type=COUNT, default=1, help="MAVLink system id (default: 1)")
    parser.add_argument(
        "--profile", choices=("strict", "ardupilot", "px4"), default="strict",
        help="behave to the letter of the standard, or as ArduCopter or PX4 really do (default: strict)",
    )  # fmt: skip
    parser.add_argument(
        "--feed", choices=("gps", "flow", "odometry"), default="gps",
        help="what a vehicle with such a profile navigates by; odometry must be sent to it, or it lands (default: gps)",
    )  # fmt: skip
    parser.add_argument("--home", metavar="LAT,LON[,ALT]", help="where it stands, degrees and metres")
    parser.add_argument("--cruise-speed", metavar="M_S", type=POSITIVE, default=5.0, help="unless the mission says (5)")
    parser.add_argument("--seed", metavar="N", type=SEED, help="repeats a flight exactly")
    parser.add_argument(
        "--link-faults",
        metavar="SPEC",
        help="of all it sends and receives, e.g. loss=0.3,duplicate=0.1,reorder=0.1,corrupt=0.01,silence=2: shares of "
        "the packets lost, doubled, overtaken or garbled; stranger=0.1: repeated under another system id; silence=S: "
        "nothing passes for S seconds, again and again; wrap=S, reset=S: time_boot_ms starts at 0 again S seconds of "
        "its time after its start, by overflow or as a reboot does (--seed repeats them)",
    )
    shared.signing_key(parser)


def _bridge(commands: Commands) -> None:
    parser = add_command(
        commands, "bridge", "inject readings into a vehicle's flight as NAMED_VALUE_FLOAT THERMAL",
        "--scene scene.json --connect udpout:127.0.0.1:14550", ("bridge", "run"),
    )  # fmt: skip
    parser.add_argument("--plan", metavar="FILE", help="the mission flown (default: asked of the vehicle)")
    shared.source_of_readings(parser)
    parser.set_defaults(sources=None)
    parser.add_argument("--seed", metavar="N", type=SEED, help="of the noise (default: the scene's)")
    shared.truth_from(parser)
    shared.feed_odometry(parser)
    shared.vehicle_link(parser)


def _onboard(commands: Commands) -> None:
    parser = add_command(
        commands, "onboard", "the estimator, live and GPS-denied",
        "--connect udpout:127.0.0.1:14550 --out flight.mcap --sources 2", ("onboard", "run"),
    )  # fmt: skip
    parser.add_argument("--out", metavar="FILE", required=True, help="the log to write (.mcap)")
    parser.add_argument("--plan", metavar="FILE", help="the mission flown (default: asked of the vehicle)")
    live(parser)
    shared.assumptions(parser)
    shared.adaptive(parser)
    shared.send_odometry(parser)
    shared.vehicle_link(parser)


def _fly(commands: Commands) -> None:
    parser = add_command(
        commands, "fly", "fly a mission and reconstruct sources and path",
        "star.plan --scene scene.json --sources 3", ("fly", "run"),
    )  # fmt: skip
    parser.add_argument("plan", nargs="?", metavar="PLAN", help="(default: the path of the scene)")
    shared.source_of_readings(parser)
    shared.assumptions(parser)
    shared.adaptive(parser)
    shared.vehicle_link(
        parser, required=False, several=True,
        help_text=f"{shared.CONNECT_HELP}; all goes over it, or over several: again for the estimator, again for the "
        "bridge (default: a loopback vehicle of its own)",
    )  # fmt: skip
    parser.add_argument("--here", action="store_true", help="fly the PLAN from where the vehicle stands")
    shared.truth_from(parser)
    shared.feed_odometry(parser)
    shared.send_odometry(parser)
    live(parser)
    parser.add_argument("--out", metavar="DIR", default="logs", help="parent of the flight's folder (default: logs)")
    parser.add_argument(
        "--speedup",
        metavar="X",
        type=POSITIVE,
        help="of the loopback vehicle (default: 10; with --adaptive 1, for choosing legs takes its time)",
    )
