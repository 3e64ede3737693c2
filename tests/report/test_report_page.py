"""The page: self-contained, honest about what is not known, safe, small."""

from __future__ import annotations

import base64
import html
import re
import struct
import zlib
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from report_flights import LEG_M, estimate_near, page_of, star_flight, star_truth, with_alternative, without_positions

from dslam_mav.dslam.field import field
from dslam_mav.dslam.scoring import score
from dslam_mav.records import Flight, Leg, Path, Verdict
from dslam_mav.report import colours
from dslam_mav.report.field_map import field_values
from dslam_mav.report.numbers import significant

VOID = {"meta", "img", "br", "link", "input", "hr"}
MAX_BYTES = 1_500_000


class Outline(HTMLParser):
    """All tags with their attributes, the visible text, and whether every tag is closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "script"):
            self.text += data + " "


def outline(page: str) -> Outline:
    parsed = Outline()
    parsed.feed(page)
    assert parsed.open == []
    return parsed


def test_page_asks_the_network_for_nothing(case):
    parsed = outline(page_of(case))
    for tag, attributes in parsed.tags:
        assert tag not in ("link", "iframe", "base", "object", "embed")
        for name in ("src", "href", "xlink:href", "action", "data", "srcset", "poster"):
            value = attributes.get(name)
            assert value is None or value.startswith(("data:image/png;base64,", "#")), (tag, name)
    page = page_of(case)
    assert "http://" not in page
    assert "https://" not in page
    assert "@import" not in page
    policy = next(a["content"] for t, a in parsed.tags if t == "meta" and "http-equiv" in a)
    assert policy is not None
    assert policy.startswith("default-src 'none'")


def test_page_shows_verdict_numbers_and_facts(case):
    truth, _, estimate = case
    result = score(estimate, truth)
    assert result is not None
    text = outline(page_of(case, facts={"Vehicle": "rover 7", "Log": "logs/x/flight.mcap"})).text
    for expected in (
        estimate.verdict.sentence,
        estimate.reason,
        "448",
        significant(result.source_error_rms_m),
        significant(result.path_error_rms_m),
        *(significant(e, 2) for e in result.source_error_m),
        "rover 7",
        "logs/x/flight.mcap",
        "20.030 ± 0.020",
        "Alternative 1",
        "3.4",
        "E_lines",
    ):
        assert expected in text, expected
    assert text.count("Leg ") >= 14, "a panel and a row for each leg"


def test_without_truth_there_is_no_word_of_error(case):
    text = outline(page_of(case, truth=None)).text
    assert "Errors against truth" not in text
    assert "true path" not in text
    assert "S3" in text


@pytest.mark.parametrize("known", [True, False])
def test_what_was_fitted_stands_once_with_or_without_truth(case, known):
    text = outline(page_of(case, **({} if known else {"truth": None}))).text
    assert text.count("Medium and fit") == 1
    assert text.count("Residuals, rms") == 1


def test_what_is_left_of_rounding_is_no_error(case):
    _, _, estimate = case
    vertices = estimate.path.vertices_m.copy()
    vertices[1] = [LEG_M + 9.4e-7, 0.0]  # as a length that went over the wire
    page = page_of(case, estimate=replace(estimate, path=Path(vertices, estimate.path.heading_rad)))
    assert "10⁻⁷" not in page
    assert "&lt;\u00a00.001" in page


def test_only_the_best_solution_shows_without_scripts(case):
    parsed = outline(page_of(case))
    panels = [a for t, a in parsed.tags if t == "div" and a.get("class") == "solution"]
    assert ["hidden" in a for a in panels] == [False, True]
    assert "hidden" in next(a for t, a in parsed.tags if t == "fieldset")
    radios = [a for t, a in parsed.tags if t == "input"]
    assert [(a["type"], a["name"]) for a in radios] == [("radio", "solution")] * 2
    assert ["checked" in a for a in radios] == [True, False]
    assert all("disabled" in a for t, a in parsed.tags if t == "button"), "what needs the script waits for it"


HOSTILE = "</title><script>alert(1)</script><img src=x onerror=alert(2)> \"' & {{ 7*7 }}"


def test_hostile_texts_are_shown_and_not_obeyed(case):
    _, _, estimate = case
    nasty = replace(estimate, reason=HOSTILE, unseen_directions=(HOSTILE,))
    page = page_of(case, estimate=nasty, title=HOSTILE, facts={HOSTILE: HOSTILE}, warnings=[HOSTILE])
    parsed = outline(page)
    assert [t for t, _ in parsed.tags].count("script") == 1
    assert not any(name.startswith("on") for _, a in parsed.tags for name in a)
    assert parsed.text.count("{{ 7*7 }}") >= 6
    assert html.escape(HOSTILE, quote=False).split()[0] in page


@pytest.mark.parametrize("verdict", [Verdict.NOT_IDENTIFIABLE, Verdict.NOT_CONVERGED, Verdict.TOO_FEW_DATA])
def test_unknown_positions_draw_no_map_but_readings_and_an_explanation(case, verdict):
    _, _, estimate = case
    unknown = without_positions(estimate, verdict, "Two directions change no reading.")
    page = page_of(case, estimate=unknown)
    parsed = outline(page)
    assert not re.search(r"(?<![a-z])nan(?![a-z])", page.split("<body>")[1], re.IGNORECASE)
    assert "map" not in [a.get("class") for t, a in parsed.tags if t == "figure"]
    assert "Two directions change no reading." in parsed.text
    assert "so none is" in parsed.text or "no position is shown" in parsed.text
    assert "Leg 7" in parsed.text
    assert "There is no model to compare them with." in parsed.text


def test_a_flight_of_nothing_still_makes_a_page(case):
    _, _, estimate = case
    nothing = replace(
        without_positions(estimate, Verdict.TOO_FEW_DATA, "No leg was flown."),
        path=Path(np.full((1, 2), np.nan), np.empty(0)),
        residual=np.empty(0),
    )
    assert "No readings were recorded." in page_of(case, flight=Flight(()), estimate=nothing)


@pytest.mark.parametrize("readings", [64, 65_536])
def test_page_stays_small_and_marks_every_outlier(readings):
    truth = star_truth(3)
    flight, clean = star_flight(truth, readings)
    estimate = with_alternative(estimate_near(truth, flight, clean))
    estimate = replace(estimate, alternatives=estimate.alternatives[:1] * 8)
    spiked = estimate.residual.copy()
    spiked[10] = 50.0
    page = page_of((truth, flight, replace(estimate, residual=spiked)))
    assert len(page.encode()) < MAX_BYTES
    assert page.count('class="beyond"') >= 1, "a wild residual is marked at the panel's edge"


def test_many_legs_stay_small_too():
    rng = np.random.default_rng(2)
    legs = tuple(
        Leg(1.0, np.linspace(0.0, 1.0, 900), 2.0 * j + np.linspace(0.0, 1.0, 900), rng.normal(size=900))
        for j in range(90)
    )
    truth = star_truth(2)
    flight, clean = star_flight(truth)
    near = estimate_near(truth, flight, clean)
    turn = np.arange(90) * 0.7
    steps = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    vertices = np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)])
    estimate = replace(near, path=Path(vertices, turn), residual=rng.normal(size=90 * 900))
    page = page_of((truth, Flight(legs), estimate), truth=None)
    assert len(page.encode()) < MAX_BYTES
    assert "30 further legs are in the log" in page


def test_map_values_are_the_field_of_the_sources(case):
    _, _, estimate = case
    x, y = np.linspace(-5.0, 40.0, 7), np.linspace(-9.0, 20.0, 5)
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    sources = estimate.sources
    expected = field(grid, estimate.spread_m**2, sources.position_m, sources.amplitude).reshape(5, 7)
    assert field_values(estimate, x, y) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_image_is_a_png_that_decodes_to_the_levels():
    level = np.linspace(0.0, 1.0, 12).reshape(3, 4)
    data = base64.b64decode(colours.image_uri(level).split(",")[1])
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, chunks = 8, {}
    while at < len(data):
        (size,), kind = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + size]
        assert struct.unpack(">I", data[at + 8 + size : at + 12 + size])[0] == zlib.crc32(kind + body)
        chunks[kind] = body
        at += 12 + size
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), dtype=np.uint8).reshape(3, 5)
    index = np.cumsum(rows[:, 1:], axis=0, dtype=np.uint8)
    assert index.ravel().tolist() == np.round(255.0 * level).ravel().tolist()


def test_colours_darken_evenly_so_that_order_survives_without_hue():
    rgb = colours.palette() / 255.0
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    lightness = 116.0 * np.cbrt(linear @ [0.2126, 0.7152, 0.0722]) - 16.0
    steps = lightness[::5][1:] - lightness[::5][:-1]
    assert (steps < 0.0).all()


def test_odd_shapes_are_drawn(case):
    truth, flight, estimate = case
    huge = replace(estimate, position_covariance_m2=np.full((3, 2, 2), np.nan), gauge="anchored", verdict=Verdict(3))
    assert "north of home" in page_of((truth, flight, huge))
    vague = replace(estimate, position_covariance_m2=np.stack([np.eye(2) * 1e6] * 3))
    page_of((truth, flight, vague))
