"""The pages in a browser: right on screen and phone, and what answers to pointer and keys."""

from __future__ import annotations

from browser import fits, looked_at, needs_chromium
from report_flights import known_before, page_of, without_positions
from test_comparison_page import flights

from dslam_mav.records import Verdict
from dslam_mav.report.beside import with_and_without
from dslam_mav.report.page import render_comparison

REPORT = """
  const radios = [...doc.querySelectorAll('input[name="solution"]')];
  if (radios.length) { radios[1].click(); }
  const lit = () => [...doc.querySelectorAll(".solution:not([hidden]) .lit, .leg.lit, .growth .lit")]
    .map(part => [...part.classList].filter(name => name !== "lit")[0] || part.tagName.toLowerCase());
  const at = (selector, event) => { const part = doc.querySelector(selector);
    if (part) { part.dispatchEvent(event); } return lit(); };
  const picks = doc.querySelectorAll(".solution:not([hidden]) .pick");
  answer.pointed = at('.solution:not([hidden]) .leg-line[data-leg="3"]', over);
  answer.said = doc.getElementById("readout") && doc.getElementById("readout").textContent;
  answer.source = at('.solution:not([hidden]) .source-mark[data-source="1"]', over);
  answer.away = at("h1", over);
  if (picks.length) { picks[0].focus(); picks[0].click(); }
  answer.chosen = at("h1", over);
  answer.pressed = [...picks].filter(p => p.getAttribute("aria-pressed") === "true").map(p => p.textContent);
  answer.left = at("body", new KeyboardEvent("keydown", { key: "Escape", bubbles: true }));
  answer.maps = [...doc.querySelectorAll(".map image")].filter(i => i.getBoundingClientRect().width > 0).length;
  answer.shown = [...doc.querySelectorAll(".solution")].map(s => !s.hidden);
  answer.stops = [...doc.querySelectorAll("a, button, input, summary")].filter(p => !p.disabled &&
    p.getClientRects().length).map(p => p.value || p.textContent.trim());
"""
COMPARISON = """
  const rows = () => [...doc.querySelectorAll(".flights tbody th")].map(cell => cell.textContent.trim());
  const heads = [...doc.querySelectorAll(".sorter")];
  const sorted = name => { heads.find(head => head.textContent.startsWith(name)).click(); return rows(); };
  answer.given = rows();
  answer.error = sorted("Error");
  answer.error_down = sorted("Error");
  answer.sort = heads.map(head => head.parentElement.getAttribute("aria-sort")).filter(Boolean);
  answer.log = sorted("Log");
  doc.querySelector('.flights tr[data-flight="1"]').dispatchEvent(over);
  answer.lit = [...doc.querySelectorAll(".lit")].map(part => part.tagName.toLowerCase());
"""


@needs_chromium
def test_a_report_answers_to_pointer_and_keys_on_screen_and_phone(case, tmp_path):
    _, _, estimate = case
    known = page_of(
        case,
        title="A_very_long_title_without_any_space_" * 4,
        facts={"Log": "/a/long/path" * 12},
        background=known_before(case),
        compass=with_and_without(
            estimate, without_positions(estimate, Verdict.AMBIGUOUS, "Too long to fit. " * 9), None
        ),
    )
    unknown = page_of(case, estimate=without_positions(estimate, Verdict.NOT_CONVERGED, "No."))
    found = looked_at([known, unknown], REPORT, tmp_path)
    for view in found:
        fits(view)
    for view in found[:2]:
        assert view["shown"] == [False, True], "the radio button chooses the solution"
        wanted = {"leg-line", "leg-mark", "tr", "leg", "column"}
        assert set(view["pointed"]) >= wanted, "in the map, the tables, the readings and the growth"
        assert view["said"].startswith("Leg 3: ")
        assert "residual rms" in view["said"]
        assert set(view["source"]) >= {"source-mark", "source-label", "ellipse", "main", "series"}
        assert view["away"] == []
        assert set(view["chosen"]) == {"ellipse", "source-mark", "source-label", "main", "more", "pick", "series"}
        assert view["pressed"] == ["S1"]
        assert view["left"] == [], "Escape lets go"
        assert view["maps"] == 1
        assert view["stops"] == ["0", "1", "S1", "S2", "S3", *"1234567", "The same as a table"], "in reading order"
    assert found[2]["maps"] == 0


@needs_chromium
def test_a_comparison_sorts_and_lights_up(tmp_path):
    views = looked_at([render_comparison(flights(), "4 logs compared")], COMPARISON, tmp_path)
    for view in views:
        fits(view)
        assert view["given"] == ["a", "b", "c", "broken"]
        assert view["error"] == ["b", "a", "c", "broken"]
        assert view["error_down"] == ["a", "b", "c", "broken"], "what is not known stays last"
        assert view["sort"] == ["descending"]
        assert view["log"] == ["a", "b", "broken", "c"]
        assert view["lit"].count("g") >= 3, "in the scatter and the trends"
        assert "tr" in view["lit"]
