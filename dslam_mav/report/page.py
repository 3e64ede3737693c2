"""Rendering: self-contained HTML pages. Everything is inline, and a page forbids itself the network."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from dslam_mav.report import colours, leg_plots
from dslam_mav.report.compare import Flown, comparison
from dslam_mav.report.data import ReportData, page_of

if TYPE_CHECKING:
    from jinja2 import Environment

_HERE = Path(__file__).parent


def render(data: ReportData) -> str:
    """The report of one flight as HTML: no file, no network, no clock; works without scripts, prints well."""
    return _rendered(
        "report",
        _asset("report.css"),
        page=page_of(data),
        colour_bar=colours.colour_bar_uri(),
        panel_width=leg_plots.WIDTH,
    )


def render_comparison(flights: Sequence[Flown], title: str) -> str:
    """The page of many flights, as self-contained."""
    return _rendered("comparison", _asset("report.css") + _asset("comparison.css"), page=comparison(flights, title))


def _rendered(name: str, style: str, **shown: object) -> str:
    script = _asset(f"{name}.js")
    # Only this very script may run, should a hostile text ever get past the escaping.
    script_hash = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    template = _environment().get_template(f"{name}.html.jinja")
    return template.render(style=style, script=script, script_hash=script_hash, **shown)


@lru_cache(maxsize=1)
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(_HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _asset(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")
