"""`check`: is a vehicle set to fly without GPS; `--fix` sets it, `--restore` puts back what was."""

from __future__ import annotations

import json
from argparse import Namespace
from pathlib import Path
from typing import Any

from rich.table import Table

from dslam_mav.commands.meeting import Met, met
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.signing import signing_from
from dslam_mav.errors import BadInputError, DslamError, unreadable
from dslam_mav.files import check_output, write_whole
from dslam_mav.mav.gps_denied import NAVIGATION, Finding, findings, names_wanted, nearest_way, other_names
from dslam_mav.mav.mission.talk import Talk
from dslam_mav.mav.params import Param, read_params, set_param
from dslam_mav.records.words import agree, count


def run(options: Namespace) -> int:
    """0 when all is as it should be (or was put back), 1 when something is not."""
    screen = Screen(json_only=options.json)
    if options.saved and options.restore:
        _saved(Path(options.saved))
    elif options.saved and options.fix:
        check_output(Path(options.saved), (".json",))
    signing = signing_from(options, screen)
    with met([options.connect], options, signing) as vehicle:
        talk = Talk(vehicle.ground, vehicle.system)
        saved = Path(options.saved or f"vehicle-{vehicle.system}-parameters.json")
        if options.restore:
            return _restore(talk, saved, screen)
        return _check(vehicle, talk, saved, options, screen)


def _check(vehicle: Met, talk: Talk, saved: Path, options: Namespace, screen: Screen) -> int:
    profile = vehicle.profile.name
    if not any(known == profile for known, _ in NAVIGATION):
        raise BadInputError(f"vehicle {vehicle.system}: profile {profile}: expected ardupilot or px4, its parameters "
                            "for flight without GPS are known")  # fmt: skip
    held = _read(talk, names_wanted(profile), screen)
    values = {name: param.value for name, param in held.items()}
    way = options.navigation or nearest_way(profile, values)
    found = findings(profile, way, values)
    screen.say(f"Vehicle {vehicle.system} ({profile}), to navigate by {way}:")
    screen.table(_table(found))
    wrong = [f for f in found if not f.ok]
    changed: list[str] = []
    if options.fix and wrong:
        changed = _fix(talk, wrong, held, saved, screen)
        values |= {f.name: f.wanted for f in wrong if f.name in changed and f.wanted is not None}
        found = findings(profile, way, values)
        wrong = [f for f in found if not f.ok]
    reboot = any(f.reboot for f in found if f.name in changed)
    if reboot:
        screen.say("Reboot the vehicle: some of them are read only when it starts")
    screen.say(_verdict(wrong, fixed=bool(changed)))
    screen.result(
        {
            "system": vehicle.system, "profile": profile, "navigation": way, "ready": not wrong,
            "parameters": [_row(f) for f in found], "changed": changed, "reboot": reboot,
            "saved": str(saved) if changed else None,
        }
    )  # fmt: skip
    return 1 if wrong else 0


def _read(talk: Talk, names: tuple[str, ...], screen: Screen) -> dict[str, Param]:
    with screen.progress("reading parameters"):
        held = read_params(talk, names)
        held |= read_params(talk, other_names(names, held))
    if not held:
        raise DslamError(f"vehicle {talk.system} on {talk.link.url} does not tell its parameters")
    return held


def _fix(talk: Talk, wrong: list[Finding], held: dict[str, Param], saved: Path, screen: Screen) -> list[str]:
    """Remember first, then set; the names that were set."""
    able = [f for f in wrong if f.wanted is not None and f.name in held]
    if not able:
        return []
    before = _saved(saved, talk.system) if saved.exists() else {}
    before = {f.name: held[f.name] for f in able} | before  # what was there first is what is put back
    _save(saved, talk.system, before)
    screen.say(f"What they were is kept in {saved}: dslam-mav check --restore puts it back")
    for finding in able:
        assert finding.wanted is not None
        set_param(talk, Param(finding.name, finding.wanted, held[finding.name].type))
        screen.say(f"{finding.name} set to {finding.wanted:g}, read back")
    return [f.name for f in able]


def _restore(talk: Talk, saved: Path, screen: Screen) -> int:
    """1 where the vehicle refused some: those stay in the file."""
    before = _saved(saved, talk.system)
    left: dict[str, Param] = {}
    for param in before.values():
        try:
            set_param(talk, param)
        except DslamError as problem:
            left[param.name] = param
            screen.warn(str(problem))
        else:
            screen.say(f"{param.name} is {param.value:g} again")
    restored = {p.name: p.value for p in before.values() if p.name not in left}
    if left:
        _save(saved, talk.system, left)
        kept = f"{count(len(left), 'parameter')} could not be, and {agree(len(left), 'stays', 'stay')} in {saved}"
    else:
        saved.unlink(missing_ok=True)
        kept = f"{saved} removed"
    again = "; reboot the vehicle" if restored else ""
    screen.say(f"{count(len(restored), 'parameter')} put back, {kept}{again}")
    refused = {p.name: p.value for p in left.values()}
    told = {"restored": restored, "refused": refused, "saved": str(saved) if left else None, "reboot": bool(restored)}
    screen.result({"system": talk.system, **told})
    return 1 if left else 0


def _saved(path: Path, system: int | None = None) -> dict[str, Param]:
    """What was put by, of this vehicle if one is given."""
    expected = 'what "check --fix" wrote: {"system": N, "parameters": {NAME: {"value": V, "type": T}}}'
    try:
        root = json.loads(path.read_text(encoding="utf-8"))
        of, entries = int(root["system"]), dict(root["parameters"])
        params = {n: Param(str(n), float(e["value"]), int(e["type"])) for n, e in entries.items()}
    except OSError as problem:
        raise unreadable(f"--saved {path}", problem) from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise BadInputError(f"--saved {path}: expected {expected}") from None
    if system is not None and of != system:
        raise BadInputError(f"--saved {path}: system {of}: expected {system}, the vehicle's")
    return params


def _save(path: Path, system: int, params: dict[str, Param]) -> None:
    entries = {p.name: {"value": p.value, "type": p.type} for p in params.values()}
    data = json.dumps({"system": system, "parameters": entries}, indent=1) + "\n"
    write_whole(path, data.encode())


def _table(found: tuple[Finding, ...]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("parameter", "is", "should be", "", "what for"):
        table.add_column(name, justify="right" if name in ("is", "should be") else "left", no_wrap=True)
    for f in found:
        value = "missing" if f.value is None else f"{f.value:g}"
        wanted = "not 0" if f.wanted is None else f"{f.wanted:g}"
        table.add_row(f.name, value, wanted, "ok" if f.ok else "<--", f.why)
    return table


def _row(f: Finding) -> dict[str, Any]:
    return {"name": f.name, "value": f.value, "wanted": f.wanted, "ok": f.ok, "why": f.why, "reboot": f.reboot}


def _verdict(wrong: list[Finding], *, fixed: bool) -> str:
    if not wrong:
        return "All parameters are as they should be"
    by_hand = [f.name for f in wrong if f.wanted is None]
    missing = [f.name for f in wrong if f.value is None]
    rest = [f.name for f in wrong if f.wanted is not None and f.value is not None]
    parts = []
    if rest:
        parts.append(f"{len(rest)} {'still ' if fixed else ''}differ: --fix sets them, and keeps what they were")
    if by_hand:
        parts.append(f"set {', '.join(by_hand)} by hand, to the sensor the vehicle has")
    if missing:
        parts.append(f"the vehicle has no {', '.join(missing)}")
    return "; ".join(parts)
