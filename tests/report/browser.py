"""A browser without a window that opens pages and answers questions about them."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine to open the page in")
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --virtual-time-budget=8000 --window-size=1400,1000 "
    "--dump-dom"
)
PROBE = """<!doctype html><body><script>
const pages = PAGES, found = [];
async function look(page, width) {
  const frame = document.createElement("iframe");
  frame.style.cssText = `width:${width}px;height:900px;border:0`;
  frame.srcdoc = page;
  const ready = new Promise(done => { frame.onload = done; });
  document.body.append(frame);
  await ready;
  const doc = frame.contentDocument, root = doc.documentElement;
  const over = new PointerEvent("pointerover", { bubbles: true });
  const answer = { width, room: root.clientWidth, needs: root.scrollWidth, inside: frame.contentWindow.innerWidth,
    tiny: [...doc.querySelectorAll("svg text")].filter(t => t.getBoundingClientRect().height > 0 &&
      t.getBoundingClientRect().height < 9).length,
    cut: [...doc.querySelectorAll("svg[role=img] text")].filter(t => { const own = t.getBoundingClientRect(),
      picture = t.ownerSVGElement, open = frame.contentWindow.getComputedStyle(picture).overflow === "visible",
      room = (open ? root : picture).getBoundingClientRect();
      return own.width > 0 && (own.left < room.left || own.right > room.right + 1); }).map(t => t.textContent) };
  QUESTIONS
  found.push(answer);
  frame.remove();
}
(async () => {
  for (const page of pages) { for (const width of [1280, 390]) { await look(page, width); } }
  const out = document.createElement("pre"); out.id = "found"; out.textContent = JSON.stringify(found);
  document.body.replaceChildren(out);
})();
</script></body>"""


def looked_at(pages: list[str], questions: str, folder: Path) -> list[Any]:
    """Every page at 1280 and 390 pixels: what fits, and what `questions` (JavaScript: doc, over) put in `answer`."""
    probe = folder / "probe.html"
    text = json.dumps(pages).replace("</", "<\\/")
    probe.write_text(PROBE.replace("PAGES", text, 1).replace("QUESTIONS", questions, 1), encoding="utf-8")
    assert CHROMIUM is not None
    try:
        done = subprocess.run(
            [CHROMIUM, *FLAGS.split(), f"--user-data-dir={folder / 'profile'}", probe.as_uri()],
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
    assert [view["width"] for view in found] == [1280, 390] * len(pages)
    for view in found:
        assert view["inside"] == view["width"]
    return list(found)


def fits(view: Any) -> None:
    """No sideways scrolling, and every label can be read, to its end."""
    assert view["needs"] <= view["room"], view
    assert view["tiny"] == 0, view
    assert view["cut"] == [], view
