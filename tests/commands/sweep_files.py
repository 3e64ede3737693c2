"""Small sweeps, and their tables."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pyarrow import parquet

SMALL = """
seeds = [3, 4]
[scenes]
random = 2
sources = 2
spread_m = [9.0, 11.0]
[[missions]]
pattern = "star5"
leg_m = [40.0, 45.0]
[noise]
snr_db = [25, 35]
"""
POINTS = 16


def written(folder: Path, text: str = SMALL) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "small.toml"
    path.write_text(text)
    return path


def rows_in(folder: Path) -> list[dict[str, Any]]:
    """The table but for the one column that is a measured time."""
    return parquet.read_table(folder / "results.parquet").drop_columns(["seconds"]).to_pylist()
