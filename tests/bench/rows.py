"""What is measured: missions, media, numbers of sources and noise; seeds nobody tuned on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from random_scenes import Case, random_case

from dslam_mav import Medium
from missions.patterns import from_turns, star

Array = NDArray[np.float64]

FIRST_SEED = 20_000
STAR, PENTAGRAM, NINE = star(7, 3, 3.2), star(5, 2, 4.5), star(9, 4, 3.2)
FLIGHT_S = 22.4
KNOWN = Medium(spread_m=1.0, static=True)
FREE = Medium(static=True, ambient=None)
OWN_AGES = Medium(diffusivity_m2_s=0.25e-9, static=True)
KEPT = "star {7/3}, √C known"  # with 2 or 3 sources, its rows must keep to limits


@dataclass(frozen=True, eq=False)
class Row:
    """One line of the table; `vertices` None: a random mission each. `older`: the field's age over the flight's time.

    `log_ages`: sources of ages of their own.
    """

    name: str
    k_sources: int
    snr_db: float
    vertices: Array | None = None
    medium: Medium = KNOWN
    older: float | None = None
    log_ages: float = 0.0


def _evolving(older: float) -> list[tuple[str, Medium]]:
    age = older * FLIGHT_S
    mu = 0.25 / age
    return [
        ("μ and τ known", Medium(diffusivity_m2_s=mu, activation_s=-age)),
        ("τ unknown", Medium(diffusivity_m2_s=mu, activation_s="shared")),
        ("μ unknown", Medium(activation_s=-age)),
        ("ambient unknown", Medium(diffusivity_m2_s=mu, activation_s=-age, ambient=None)),
    ]


ROWS = [
    *(Row(KEPT, k, snr, STAR) for k in (2, 3, 4) for snr in (20.0, 40.0)),
    *(Row("star {9/4}, √C known", 5, snr, NINE) for snr in (20.0, 40.0)),
    *(Row("pentagram {5/2}, √C known", k, 20.0, PENTAGRAM) for k in (2, 3, 4)),
    *(Row("random mission, √C known", k, 40.0) for k in (3, 4)),
    *(Row("star {7/3}, √C and ambient unknown", k, snr, STAR, FREE) for k in (2, 3, 4) for snr in (20.0, 40.0)),
    *(
        Row(f"star {{7/3}}, flight {1.0 / older:g} of the age, {words}", k, 20.0, STAR, medium, older)
        for older in (10.0, 2.0)
        for words, medium in _evolving(older)
        for k in (2, 3)
    ),
    *(Row("star {7/3}, one activation each, static", k, 30.0, STAR, OWN_AGES, log_ages=0.5) for k in (2, 3)),
]  # fmt: skip


def cases(row: Row, scenes: int, first_seed: int = FIRST_SEED) -> Iterator[Case]:
    """The row's random scenes, of seeds from `first_seed` on."""
    ambient = 20.0 if row.medium.ambient is None else 0.0
    for i in range(scenes):
        seed = (first_seed + i, row.k_sources, int(row.snr_db))
        path = row.vertices if row.vertices is not None else random_mission(seed)
        yield random_case(
            seed, row.k_sources, row.snr_db, vertices=path, medium=row.medium, ambient=ambient,
            age_over_flight=row.older, log_ages=row.log_ages,
        )  # fmt: skip


def random_mission(seed: tuple[int, ...]) -> Array:
    """Seven legs of 3.2 √C, turns uniform in 30–150° either way."""
    rng = np.random.default_rng((*seed, 7))
    turns = np.deg2rad(rng.uniform(30.0, 150.0, 6)) * rng.choice([-1.0, 1.0], 6)
    return from_turns(np.full(7, 3.2), turns)
