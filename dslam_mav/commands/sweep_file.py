"""The file of a sweep (TOML); unknown keys are refused by name."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import msgspec

from dslam_mav.commands.sweep_checks import SEED, each, is_seed
from dslam_mav.commands.sweep_parts import Estimate, Logs, Mission, Noise, Part, Sampling, Scenes
from dslam_mav.errors import BadInputError, unreadable
from sim_bridge.fields.complaint import complaint


class Sweep(Part, frozen=True):
    """The whole file."""

    scenes: Scenes | None = None
    missions: list[Mission] | None = None
    noise: Noise | None = None
    sampling: Sampling | None = None
    estimate: Estimate = Estimate()
    seeds: tuple[int, ...] = (0,)
    logs: Logs | None = None
    assume: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        if (self.scenes is None) == (self.logs is None):
            raise ValueError("scenes: expected exactly one of scenes and logs")
        flown, simulated = {"logs", "assume"}, {"scenes", "missions", "noise", "sampling", "estimate", "seeds"}
        kind, others = ("scenes", flown) if self.logs is None else ("logs", simulated)
        if odd := sorted(self.given() & others):
            raise ValueError(f"{odd[0]}: expected without {kind}")
        if self.scenes is not None and self.scenes.random is not None:
            for name in ("missions", "noise"):
                if not getattr(self, name):
                    raise ValueError(f"{name}: missing, random scenes have none of their own")
        each("seeds", self.seeds, is_seed, SEED)


def read_sweep(path: Path) -> Sweep:
    """The sweep in a file; BadInputError names the file, the key and the value."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as problem:
        raise unreadable(path, problem) from None
    except UnicodeDecodeError:
        raise BadInputError(f"{path}: expected TOML, got something else: it is no UTF-8 text") from None
    try:
        document = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as problem:
        raise BadInputError(f"{path}: expected TOML, got something else: {problem}") from None
    try:
        return msgspec.convert(document, Sweep)
    except msgspec.ValidationError as problem:
        raise BadInputError(f"{path}: {complaint(str(problem), document, KEYS)}") from None


KEYS: dict[str, tuple[str, ...]] = {
    "": Sweep.__struct_fields__,
    "scenes": Scenes.__struct_fields__,
    "missions": Mission.__struct_fields__,
    "noise": Noise.__struct_fields__,
    "sampling": Sampling.__struct_fields__,
    "estimate": Estimate.__struct_fields__,
    "logs": Logs.__struct_fields__,
}
