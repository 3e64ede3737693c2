"use strict";
/* Without scripts the page shows the most likely solution and all the numbers; this adds choosing and highlighting. */
(function () {
  var KINDS = ["leg", "source"], pinned = {}, pointed = {};
  var readout = document.getElementById("readout"), hint = readout ? readout.textContent : "";

  function all(selector, act) { Array.prototype.forEach.call(document.querySelectorAll(selector), act); }

  /* the solution shown: radio buttons, so that the arrow keys choose */
  function showSolution() {
    var chosen = document.querySelector('input[name="solution"]:checked');
    if (!chosen) { return; }
    all(".solution", function (panel) { panel.hidden = panel.id !== "solution-" + chosen.value; });
    light();
  }

  /* legs and sources: what is pointed at or focused, else what was chosen, is lit wherever it appears */
  function light() {
    var said = [];
    KINDS.forEach(function (kind) {
      var which = pointed[kind] || pinned[kind];
      all(".lit[data-" + kind + "]", function (part) { if (part.getAttribute("data-" + kind) !== which) { part.classList.remove("lit"); } });
      document.body.classList.toggle(kind + "-lit", Boolean(which));
      if (!which) { return; }
      all("[data-" + kind + '="' + which + '"]', function (part) { part.classList.add("lit"); });
      var row = document.querySelector(".solution:not([hidden]) .pick[data-" + kind + '="' + which + '"]');
      if (row) { said.push(row.getAttribute("data-say")); }
    });
    all(".pick", function (button) {
      var kind = button.hasAttribute("data-leg") ? "leg" : "source";
      button.setAttribute("aria-pressed", String(pinned[kind] === button.getAttribute("data-" + kind)));
    });
    if (readout) { readout.textContent = said.join(" ") || hint; }
  }
  function under(event) {
    var found = {};
    KINDS.forEach(function (kind) {
      var part = event.target.closest ? event.target.closest("[data-" + kind + "]") : null;
      if (part) { found[kind] = part.getAttribute("data-" + kind); }
    });
    return found;
  }
  function point(event) {
    var found = under(event);
    if (found.leg !== pointed.leg || found.source !== pointed.source) { pointed = found; light(); }
  }
  function pin(event) {
    var found = under(event), any = false;
    KINDS.forEach(function (kind) {
      if (!found[kind]) { return; }
      any = true;
      pinned[kind] = pinned[kind] === found[kind] ? undefined : found[kind];
    });
    if (any) { light(); }
  }
  function clear(event) {
    if (event.key === "Escape") { pinned = {}; pointed = {}; light(); }
  }

  document.documentElement.classList.add("scripted");
  all(".choice, #readout", function (part) { part.hidden = false; });
  all('input[name="solution"]', function (input) { input.addEventListener("change", showSolution); });
  all(".pick", function (button) { button.disabled = false; });
  document.addEventListener("pointerover", point);
  document.addEventListener("focusin", point);
  document.addEventListener("focusout", function () { pointed = {}; light(); });
  document.addEventListener("click", pin);
  document.addEventListener("keydown", clear);
  window.addEventListener("pageshow", showSolution); /* a browser that comes back keeps the choice */
  window.addEventListener("beforeprint", function () { all("details", function (part) { part.open = true; }); });
  showSolution();
})();
