"""From options to `Assumptions`, and to and from the configuration a log carries."""

from __future__ import annotations

import json
import math
import platform
from argparse import Namespace
from dataclasses import asdict, fields, replace
from importlib.metadata import version
from typing import Any

from dslam_mav.assumptions import Assumptions
from dslam_mav.errors import BadInputError
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
    if options.sources is not None:
        given["n_sources"] = None if options.sources == "auto" else options.sources
    if options.ambient is not None:
        given["ambient"] = None if options.ambient == "auto" else options.ambient
    for option, name in (
        ("diffusivity", "diffusivity_m2_s"), ("activation", "activation_s"), ("spread", "spread_m"),
        ("heading", "heading"), ("distance", "distance"), ("seed", "seed"),
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


def configuration(assumptions: Assumptions, command: str) -> bytes:
    """The configuration a log carries: assumptions, command and versions."""
    versions = {name: version(name) for name in PACKAGES}
    versions["python"] = platform.python_version()
    body = {"assumptions": asdict(assumptions), "command": command, "versions": versions}
    return json.dumps(body, indent=2).encode()


def recorded_assumptions(attachment: bytes, name: str) -> Assumptions:
    """The assumptions a log was recorded with."""
    try:
        given = json.loads(attachment)["assumptions"]
        known = {field.name for field in fields(Assumptions)}
        unknown = sorted(set(given) - known)
        if unknown:
            raise BadInputError(f"{name}: configuration.json: assumptions.{unknown[0]}: unknown to this version")
        return Assumptions(**given)
    except (ValueError, KeyError, TypeError) as error:
        raise BadInputError(f"{name}: configuration.json: cannot be read: {error}") from None


def in_words(assumptions: Assumptions) -> dict[str, str]:
    """The assumptions as a person reads them, for the report."""

    def known(value: float | None, unit: str) -> str:
        return "estimated" if value is None else f"{value:g}{unit}"

    facts = {
        "sources assumed": "found by BIC" if assumptions.n_sources is None else str(assumptions.n_sources),
        "field": "static" if assumptions.static else "evolving",
        "ambient level": known(assumptions.ambient, ""),
        "headings": {"none": "unknown", "vehicle": "compass", "plan": "as planned"}[assumptions.heading],
        "distance along a leg": assumptions.distance or "the first the vehicle offers",
    }
    if assumptions.spread_m is not None:
        facts["spread √C"] = f"{assumptions.spread_m:g} m, given"
    else:
        facts["diffusivity μ"] = known(assumptions.diffusivity_m2_s, " m²/s")
        facts["activation time τ"] = known(assumptions.activation_s, " s")
    if assumptions.closed:
        facts["path"] = "ends where it began"
    return facts
