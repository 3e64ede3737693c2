"""From options to `Assumptions`, and to and from the configuration a log carries."""

from __future__ import annotations

import json
import math
import platform
from argparse import Namespace
from dataclasses import asdict, dataclass, fields, replace
from importlib.metadata import version
from typing import Any

from dslam_mav.assumptions import Assumptions
from dslam_mav.errors import BadInputError
from dslam_mav.legs import FlownLeg, LegCollector
from dslam_mav.records import Medium

PACKAGES = ("dslam-mav", "numpy", "scipy", "numba", "pymavlink", "mcap")


def assumptions_from(
    options: Namespace, *, medium: Medium | None = None, base: Assumptions | None = None
) -> Assumptions:
    """What the options say, over what a scene's medium or a log's configuration says, over the defaults."""
    start = base or Assumptions()
    if medium is not None:
        start = replace(start, diffusivity_m2_s=medium.diffusivity_m2_s, ambient=medium.ambient, static=medium.static)
    given: dict[str, Any] = {}
    for option, name in (
        ("sources", "n_sources"), ("ambient", "ambient"), ("ambient_drift", "ambient_drift_per_s"),
        ("lag", "sensor_lag_s"),
    ):  # fmt: skip
        if (value := getattr(options, option)) is not None:
            given[name] = None if value == "auto" else value
    for option, name in (
        ("diffusivity", "diffusivity_m2_s"), ("activation", "activation_s"), ("spread", "spread_m"),
        ("heading", "heading"), ("distance", "distance"), ("method", "method"), ("seed", "seed"),
        ("noise", "noise"),
    ):  # fmt: skip
        if getattr(options, option, None) is not None:
            given[name] = getattr(options, option)
    if options.heading_sd is not None:
        given["heading_sd_rad"] = math.radians(options.heading_sd)
    if options.closed:
        given["closed"] = True
    if options.evolving:
        given["static"] = False
    elif options.static or options.spread is not None:
        given["static"] = True
    if options.activation is not None and not options.activation < 0.0:
        raise BadInputError(f"--activation {options.activation:g}: expected a time before the flight, below 0")
    if options.evolving and options.spread is None:
        given["spread_m"] = None  # what a log was recorded with holds for a static field only
    if options.spread is not None and options.evolving:
        raise BadInputError(
            "--spread with --evolving: only a static field has one spread; give --diffusivity and --activation"
        )
    return replace(start, **given)


@dataclass(frozen=True, slots=True)
class Recorded:
    """What a log's configuration says: `vehicle_system` flew (None: unknown), its item 0 being home or not."""

    assumptions: Assumptions
    vehicle_system: int | None = None
    home_item: bool = True


def configuration(recorded: Recorded, command: str) -> bytes:
    """The configuration a log carries: assumptions, the vehicle, command and versions."""
    versions = {name: version(name) for name in PACKAGES}
    versions["python"] = platform.python_version()
    body = {**asdict(recorded), "command": command, "versions": versions}
    return json.dumps(body, indent=2).encode()


def recorded_configuration(attachment: bytes, name: str) -> Recorded:
    """What a log was recorded with; BadInputError names what cannot be read."""
    try:
        body = json.loads(attachment)
        given = body["assumptions"]
        known = {field.name for field in fields(Assumptions)}
        unknown = sorted(set(given) - known)
        if unknown:
            raise BadInputError(f"{name}: configuration.json: assumptions.{unknown[0]}: unknown to this version")
        system = body.get("vehicle_system")
        if system is not None and not (type(system) is int and 1 <= system <= 255):
            raise BadInputError(f"{name}: configuration.json: vehicle_system {system!r}: expected 1 to 255")
        return Recorded(Assumptions(**given), system, body.get("home_item") is not False)
    except (ValueError, KeyError, TypeError) as error:
        raise BadInputError(f"{name}: configuration.json: cannot be read: {error}") from None


def in_words(assumptions: Assumptions) -> dict[str, str]:
    """The assumptions as a person reads them, for the report."""

    def known(value: float | None, unit: str) -> str:
        return "estimated" if value is None else f"{value:g}{unit}"

    facts = {
        "sources assumed": "found by BIC" if assumptions.n_sources is None else str(assumptions.n_sources),
        "field": "static" if assumptions.static else "evolving",
        "ambient level": _ambient(assumptions.ambient),
        "headings": {"none": "unknown", "vehicle": "compass", "plan": "as planned"}[assumptions.heading],
        "distance along a leg": assumptions.distance or "the first the vehicle offers",
    }
    if assumptions.spread_m is not None:
        facts["spread √C"] = f"{assumptions.spread_m:g} m, given"
    else:
        facts["diffusivity μ"] = known(assumptions.diffusivity_m2_s, " m²/s")
        facts["activation time τ"] = known(assumptions.activation_s, " s")
    if assumptions.noise == "hover":
        facts["noise"] = "as read standing before leg 1, beside the legs' own"
    if assumptions.ambient_drift_per_s != 0.0:
        facts["ambient drift"] = known(assumptions.ambient_drift_per_s, " a second")
    if assumptions.sensor_lag_s != 0.0:
        facts["sensor lag"] = known(assumptions.sensor_lag_s, " s")
    if assumptions.method == "paper":
        facts["method"] = "the paper's algebra"
    if assumptions.closed:
        facts["path"] = "ends where it began"
    return facts


def stood(collector: LegCollector, legs: tuple[FlownLeg, ...]) -> dict[str, str]:
    """What was read standing before the first leg, as a person reads it; nothing where nothing was."""
    standing = collector.standing(legs)
    if standing is None:
        return {}
    (noise_sd, _), (level, level_sd) = standing.noise(), standing.level()
    read = f"{standing.value.size} readings in {standing.seconds:.3g} s"
    return {"standing before leg 1": f"{read}: noise {noise_sd:.3g}, level {level:.5g} ± {level_sd:.2g}"}


def _ambient(level: float | str | None) -> str:
    if isinstance(level, str):
        return "as read standing before leg 1"
    return "estimated" if level is None else f"{level:g}"
