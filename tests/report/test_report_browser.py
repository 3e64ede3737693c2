"""The page in a browser: right on screen and phone."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess

import pytest
from report_flights import page_of, without_positions

from dslam_mav.records import Verdict

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PROBE = """<!doctype html><body><script>
const pages = %s, found = [];
async function look(page, width) {
  const frame = document.createElement("iframe");
  frame.style.cssText = `width:${width}px;height:900px;border:0`;
  frame.srcdoc = page;
  const ready = new Promise(done => { frame.onload = done; });
  document.body.append(frame);
  await ready;
  const doc = frame.contentDocument, root = doc.documentElement;
  const radios = [...doc.querySelectorAll('input[name="solution"]')];
  if (radios.length) { radios[1].click(); }
  const lit = () => [...doc.querySelectorAll(".solution:not([hidden]) .lit, .leg.lit, .growth .lit")]
    .map(part => [...part.classList].filter(name => name !== "lit")[0] || part.tagName.toLowerCase());
  const at = (selector, event) => { const part = doc.querySelector(selector);
    if (part) { part.dispatchEvent(event); } return lit(); };
  const over = new PointerEvent("pointerover", { bubbles: true });
  const picks = doc.querySelectorAll(".solution:not([hidden]) .pick");
  const light = { pointed: at('.solution:not([hidden]) .leg-line[data-leg="2"]', over),
    said: doc.getElementById("readout") && doc.getElementById("readout").textContent,
    source: at('.solution:not([hidden]) .source-mark[data-source="1"]', over), away: at("h1", over) };
  if (picks.length) { picks[0].focus(); picks[0].click(); }
  light.chosen = at("h1", over);
  light.pressed = [...picks].filter(p => p.getAttribute("aria-pressed") === "true").map(p => p.textContent);
  light.left = at("body", new KeyboardEvent("keydown", { key: "Escape", bubbles: true }));
  found.push({ width, light, room: root.clientWidth, needs: root.scrollWidth,
    inside: frame.contentWindow.innerWidth,
    maps: [...doc.querySelectorAll(".map image")].filter(i => i.getBoundingClientRect().width > 0).length,
    shown: [...doc.querySelectorAll(".solution")].map(s => !s.hidden),
    tiny: [...doc.querySelectorAll("svg text")].filter(t => t.getBoundingClientRect().height > 0 &&
      t.getBoundingClientRect().height < 9).length });
  frame.remove();
}
(async () => {
  for (const page of pages) { for (const width of [1280, 390]) { await look(page, width); } }
  const out = document.createElement("pre"); out.id = "found"; out.textContent = JSON.stringify(found);
  document.body.replaceChildren(out);
})();
</script></body>"""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine to open the page in")
def test_opens_in_a_browser_without_sideways_scrolling(case, tmp_path):
    _, _, estimate = case
    known = page_of(case, title="A_very_long_title_without_any_space_" * 4, facts={"Log": "/a/long/path" * 12})
    unknown = page_of(case, estimate=without_positions(estimate, Verdict.NOT_CONVERGED, "No."))
    probe = tmp_path / "probe.html"
    probe.write_text(PROBE % json.dumps([known, unknown]).replace("</", "<\\/"), encoding="utf-8")
    flags = (
        "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
        "--disable-component-update --disable-sync --virtual-time-budget=8000 --window-size=1400,1000 "
        "--dump-dom"
    )
    assert CHROMIUM is not None
    try:
        done = subprocess.run(
            [CHROMIUM, *flags.split(), f"--user-data-dir={tmp_path / 'profile'}", probe.as_uri()],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
    except subprocess.TimeoutExpired:
        pytest.skip("chromium did not start within 60 s on this machine")
    answer = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.S)
    assert answer, done.stderr[-2000:]
    found = json.loads(html.unescape(answer.group(1)))
    assert [f["width"] for f in found] == [1280, 390, 1280, 390]
    for view in found:
        assert view["inside"] == view["width"]
        assert view["needs"] <= view["room"], view
        assert view["tiny"] == 0, "every label is readable"
    assert found[0]["shown"] == [False, True], "the radio button chooses the solution"
    light = found[0]["light"]
    assert set(light["pointed"]) >= {"leg-line", "leg-mark", "tr", "leg"}, "in the map, the tables and the readings"
    assert light["said"].startswith("Leg 2: 32.02 m, heading 153.75 ± 0.69°")
    assert set(light["source"]) >= {"source-mark", "source-label", "ellipse", "main"}
    assert light["away"] == []
    assert (set(light["chosen"]), light["pressed"]) == (
        {"ellipse", "source-mark", "source-label", "main", "more", "pick"},
        ["S1"],
    )
    assert light["left"] == [], "Escape lets go"
    assert found[0]["maps"] == 1
    assert found[2]["maps"] == 0
