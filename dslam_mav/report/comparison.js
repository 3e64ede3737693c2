"use strict";
/* Sorting by a column, and a flight pointed at lit in table and pictures. Without scripts all is there, unsorted. */
(function () {
  var body = document.querySelector(".flights tbody"), heads = document.querySelectorAll(".flights thead th");
  function all(selector, act) { Array.prototype.forEach.call(document.querySelectorAll(selector), act); }

  function orderOf(row, column) {
    var cell = row.children[column];
    return row.classList.contains("unread") && column ? "" : cell ? cell.getAttribute("data-order") || "" : "";
  }
  function compare(a, b) {
    var x = Number(a), y = Number(b);
    return isNaN(x) || isNaN(y) ? a.localeCompare(b, "en", { numeric: true }) : x === y ? 0 : x < y ? -1 : 1;
  }
  function sort(column) {
    var head = heads[column], up = head.getAttribute("aria-sort") !== "ascending";
    var rows = Array.prototype.map.call(body.rows, function (row, i) { return { row: row, order: orderOf(row, column), i: i }; });
    rows.sort(function (a, b) {
      if (!a.order || !b.order) { return (a.order ? 0 : 1) - (b.order ? 0 : 1) || a.i - b.i; } /* what is not known stays last */
      return (up ? 1 : -1) * compare(a.order, b.order) || a.i - b.i;
    });
    rows.forEach(function (one) { body.appendChild(one.row); });
    Array.prototype.forEach.call(heads, function (other) { other.removeAttribute("aria-sort"); });
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
  }
  function light(event) {
    var part = event.target.closest ? event.target.closest("[data-flight]") : null;
    var which = part ? part.getAttribute("data-flight") : null;
    all("[data-flight]", function (other) { other.classList.toggle("lit", other.getAttribute("data-flight") === which); });
  }

  document.documentElement.classList.add("scripted");
  all("#hint", function (part) { part.hidden = false; });
  all(".sorter", function (button, column) {
    button.disabled = false;
    button.addEventListener("click", function () { sort(column); });
  });
  document.addEventListener("pointerover", light);
  document.addEventListener("focusin", light);
})();
