"""`--set KEY=VALUE`: assumptions changed one by one over those a log was recorded with. KEY is an option's name."""

from __future__ import annotations

import math
from argparse import ArgumentTypeError
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.options import ANY, N_SOURCES, NOT_NEGATIVE, POSITIVE, SEED
from dslam_mav.errors import BadInputError

_Parse = Callable[[str], Any]


def _auto(parse: _Parse) -> _Parse:
    """What `parse` takes, or the word auto: find it out."""
    return lambda text: None if text == "auto" else parse(text)


def _one_of(*words: str) -> _Parse:
    def parse(text: str) -> str:
        if text not in words:
            raise ArgumentTypeError(f"{text!r}: expected {' or '.join(words)}")
        return text

    return parse


def _whether(text: str) -> bool:
    return bool(_one_of("yes", "no", "true", "false")(text) in ("yes", "true"))


KEYS: dict[str, tuple[str, _Parse]] = {
    "sources": ("n_sources", _auto(N_SOURCES)),
    "spread": ("spread_m", _auto(POSITIVE)),
    "diffusivity": ("diffusivity_m2_s", _auto(POSITIVE)),
    "activation": ("activation_s", _auto(ANY)),
    "ambient": ("ambient", lambda text: "hover" if text == "hover" else _auto(ANY)(text)),
    "noise": ("noise", _one_of("legs", "hover")),
    "ambient-drift": ("ambient_drift_per_s", _auto(ANY)),
    "lag": ("sensor_lag_s", _auto(NOT_NEGATIVE)),
    "static": ("static", _whether),
    "evolving": ("static", lambda text: not _whether(text)),
    "closed": ("closed", _whether),
    "heading": ("heading", _one_of("none", "vehicle", "plan")),
    "heading-sd": ("heading_sd_rad", lambda text: math.radians(NOT_NEGATIVE(text))),
    "distance": ("distance", _auto(_one_of("odometry", "speed", "plan", "auto"))),
    "method": ("method", _one_of("joint", "paper")),
    "seed": ("seed", SEED),
}


def with_settings(assumptions: Assumptions, settings: Sequence[str]) -> Assumptions:
    """The assumptions with each "KEY=VALUE" in its place; BadInputError names the setting and what would be right."""
    given: dict[str, Any] = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        key = key.strip().replace("_", "-")
        if not equals or key not in KEYS:
            raise BadInputError(f"--set {setting}: expected KEY=VALUE with KEY of {', '.join(KEYS)}")
        name, parse = KEYS[key]
        if name in given:
            raise BadInputError(f"--set {setting}: expected each assumption once, it was set before")
        try:
            given[name] = parse(text.strip())
        except ArgumentTypeError as problem:
            raise BadInputError(f"--set {setting}: {problem}") from None
    if given.get("activation_s") is not None and not given["activation_s"] < 0.0:
        raise BadInputError(f"--set activation={given['activation_s']:g}: expected a time before the flight, below 0")
    if given.get("spread_m") is not None:  # as --spread does: only a static field has one
        if given.setdefault("static", True) is False:
            raise BadInputError(
                f"--set spread={given['spread_m']:g}: expected with a static field, got an evolving one"
            )
    elif given.get("static") is False:
        given["spread_m"] = None
    return replace(assumptions, **given)


def changed(before: Assumptions, after: Assumptions) -> list[str]:
    """The settings "KEY=VALUE" that make one of the other, in the order of their options."""
    settings = {}
    for key, (name, _) in KEYS.items():
        value = getattr(after, name)
        if value != getattr(before, name) and name not in settings:
            settings[name] = f"{key}={_text(key, value)}"
    return list(settings.values())


def _text(key: str, value: object) -> str:
    """As `with_settings` takes it."""
    if value is None or isinstance(value, bool):
        return "auto" if value is None else "yes" if value else "no"
    if isinstance(value, float):
        return f"{math.degrees(value) if key == 'heading-sd' else value:.10g}"
    return str(value)
