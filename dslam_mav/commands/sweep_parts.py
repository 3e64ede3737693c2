"""The tables of a sweep's file, each checked by itself: ValueError "key: expected …, got …"."""

from __future__ import annotations

import math

import msgspec

from dslam_mav.commands.options import MAX_SOURCES
from dslam_mav.commands.sweep_checks import SEED, each, finite, is_seed, listed, not_negative, positive

METHODS = ("joint", "paper")
KNOWABLE = ("spread", "diffusivity", "activation", "ambient")
TRUE, AUTO, OWN_PATH = "true", "auto", "scene"
Pair = tuple[float, float]


class Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """What all tables share."""

    def given(self) -> set[str]:
        """Keys that say something else than their default."""
        return set(msgspec.to_builtins(self))


class Scenes(Part, frozen=True):
    """Scene files, or scenes drawn at random."""

    files: list[str] | None = None
    random: int | None = None
    sources: int | list[int] = 2
    area_m: Pair | None = None
    spread_m: float | Pair = 10.0
    min_separation_m: float | None = None
    amplitude_ratio: float = 4.0
    peak: float = 1.0
    ambient: float = 0.0
    diffusivity_m2_s: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if (self.files is None) == (self.random is None):
            raise ValueError("files: expected exactly one of files and random")
        if self.files is not None:
            each("files", self.files, bool, "names of scene files")
        if self.files is not None and (drawn := sorted(self.given() - {"files"})):
            raise ValueError(f"{drawn[0]}: is of random scenes; expected without files")
        if self.random is not None and self.random < 1:
            raise ValueError(f"random: expected a whole number, 1 or more, got {self.random}")
        each("sources", self.k_sources, lambda k: 1 <= k <= MAX_SOURCES, f"a whole number from 1 to {MAX_SOURCES}")
        low, high = self.spreads_m
        if not 0.0 < low <= high < math.inf:
            raise ValueError(f"spread_m: expected a positive number or [least, most], got {self.spread_m}")
        for name in ("min_separation_m", "peak", "diffusivity_m2_s"):
            positive(name, getattr(self, name))
        for side in self.area_m or ():
            positive("area_m", side)
        if not 1.0 <= self.amplitude_ratio < math.inf:
            raise ValueError(f"amplitude_ratio: expected 1 or more, got {self.amplitude_ratio:g}")
        finite("ambient", self.ambient)
        each("seed", [self.seed], is_seed, SEED)

    @property
    def k_sources(self) -> list[int]:
        """Numbers of sources, `random` scenes of each."""
        return listed(self.sources)

    @property
    def spreads_m(self) -> Pair:
        """√C at the first reading: least, most."""
        return self.spread_m if isinstance(self.spread_m, tuple) else (self.spread_m, self.spread_m)


class Mission(Part, frozen=True):
    """One mission, or a pattern in several sizes."""

    pattern: str | None = None
    leg_m: float | list[float] | None = None
    legs: int | None = None
    heading_deg: float = 0.0
    centre_m: Pair = (0.0, 0.0)
    plan: str | None = None
    path: str | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        kinds = [kind for kind in ("pattern", "plan", "path") if getattr(self, kind) is not None]
        if len(kinds) != 1:
            raise ValueError(
                f"pattern: expected exactly one of pattern, plan and path, got {', '.join(kinds) or 'none'}"
            )
        if self.pattern is None and (odd := sorted(self.given() & {"leg_m", "legs", "heading_deg", "centre_m"})):
            raise ValueError(f"{odd[0]}: is of a pattern; expected without {kinds[0]}")
        if self.pattern is not None and self.leg_m is None:
            raise ValueError("leg_m: missing, expected the length of a leg or a list of lengths")
        if self.path is not None and self.path != OWN_PATH:
            raise ValueError(f'path: expected "{OWN_PATH}", got "{self.path}"')
        if self.name is not None and len(self.legs_m) > 1:
            raise ValueError(f'name: expected none with several lengths, got "{self.name}"')
        if self.leg_m is not None:
            each("leg_m", self.legs_m, lambda m: 0.0 < m < math.inf, "a positive number")
        finite("heading_deg", self.heading_deg)

    @property
    def legs_m(self) -> list[float]:
        """Lengths of a pattern's legs, one mission each."""
        return listed(self.leg_m)


class Noise(Part, frozen=True):
    """Levels of the noise."""

    snr_db: float | list[float] | None = None
    sd: float | list[float] | None = None

    def __post_init__(self) -> None:
        if (self.snr_db is None) == (self.sd is None):
            raise ValueError("snr_db: expected exactly one of snr_db and sd")
        if self.snr_db is not None:
            each("snr_db", listed(self.snr_db), math.isfinite, "a finite number")
        else:
            each("sd", listed(self.sd), not_negative, "0 or more")

    @property
    def levels(self) -> list[tuple[str, float]]:
        """("snr_db" or "sd", value) of each."""
        return [("snr_db", x) for x in listed(self.snr_db)] + [("sd", x) for x in listed(self.sd)]


class Sampling(Part, frozen=True):
    """How a leg is read."""

    speed_m_s: float | None = None
    spacing_m: float | None = None
    interval_s: float | None = None

    def __post_init__(self) -> None:
        for name in ("speed_m_s", "spacing_m", "interval_s"):
            positive(name, getattr(self, name))
        if self.spacing_m is not None and self.interval_s is not None:
            raise ValueError("interval_s: expected one of spacing_m and interval_s")


class Estimate(Part, frozen=True):
    """What the estimator is told; names follow `dslam_mav.estimate`."""

    methods: tuple[str, ...] = ("joint",)
    n_sources: int | str = TRUE
    max_sources: int = 5
    known: list[str] | None = None
    closed: bool = False
    heading_sd_deg: float | None = None

    def __post_init__(self) -> None:
        each("methods", self.methods, METHODS.__contains__, " or ".join(METHODS))
        named = (TRUE, AUTO) if isinstance(self.n_sources, str) else range(1, MAX_SOURCES + 1)
        if self.n_sources not in named:
            raise ValueError(f'n_sources: expected "{TRUE}", "{AUTO}" or 1 to {MAX_SOURCES}, got {self.n_sources!r}')
        if not 1 <= self.max_sources <= MAX_SOURCES:
            raise ValueError(f"max_sources: expected 1 to {MAX_SOURCES}, got {self.max_sources}")
        if self.known:
            each("known", self.known, KNOWABLE.__contains__, f"one of {', '.join(KNOWABLE)}")
        positive("heading_sd_deg", self.heading_sd_deg)
        if self.heading_sd_deg is not None and "paper" in self.methods:
            raise ValueError("heading_sd_deg: expected without the method paper, whose algebra has no compass")


class Logs(Part, frozen=True):
    """Flights that were flown."""

    folder: str
    methods: tuple[str, ...] = ("joint",)

    def __post_init__(self) -> None:
        each("methods", self.methods, METHODS.__contains__, " or ".join(METHODS))
