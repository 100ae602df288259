"use strict";
// What a reader does with the page: switch curves, read values off them, sort and copy tables, light and dark.
const REACH = 14; // units of a panel within which a point belongs to the pointer's place
const MANY = 8; // curves told from which they stand in two columns
const COMMA = document.documentElement.lang !== "en"; // in place of the point

function words(value) {
  if (value === null || value === undefined) return "";
  if (typeof value === "string") return value;
  const text = String(Number(value.toPrecision(5))).replace("-", "−");
  return COMMA ? text.replace(".", ",") : text;
}

const SAID = JSON.parse(document.getElementById("words").textContent);

// A word of this script in the page's language.
function said(word) {
  return SAID[word] || word;
}

function make(tag, text, parent, css) {
  const made = document.createElement(tag);
  if (text !== null) made.textContent = text;
  if (css) made.className = css;
  if (parent) parent.append(made);
  return made;
}

function dark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
}

function remembered(value) {
  try {
    if (value) localStorage.setItem("radarsim-theme", value);
    return localStorage.getItem("radarsim-theme");
  } catch {
    return null; // a browser may keep nothing for a page from a disk
  }
}

function theme(button) {
  const kept = remembered();
  if (kept === "dark" || kept === "light") document.documentElement.dataset.theme = kept;
  const told = () => { button.textContent = said(dark() ? "Light page" : "Dark page"); };
  button.hidden = false;
  button.addEventListener("click", () => {
    document.documentElement.dataset.theme = remembered(dark() ? "light" : "dark") || (dark() ? "light" : "dark");
    told();
  });
  told();
}

// From a value to a place on an axis [logarithmic, low, high, start, end].
function place([log, low, high, start, end], value) {
  const f = log ? Math.log10 : (v) => v;
  return start + ((end - start) * (f(value) - f(low))) / (f(high) - f(low));
}

function nearest(panel, at) {
  const found = [];
  for (const line of panel.lines) {
    if (panel.off.has(line.g)) continue;
    const xs = panel.xs[line.x];
    let best = -1, gap = REACH;
    for (let i = 0; i < xs.length; i++) {
      if (line.y[i] === null || xs[i] === null) continue;
      const away = Math.abs(place(panel.x, xs[i]) - at.x);
      if (away < gap) { gap = away; best = i; }
    }
    if (best < 0) continue;
    const y = place(panel.y, line.y[best]), x = place(panel.x, xs[best]);
    if (line.p && Math.hypot(y - at.y, x - at.x) > 3 * REACH) continue;
    found.push({ line, i: best, x, y, value: xs[best], away: Math.abs(y - at.y) });
  }
  const whole = found.filter((f) => Number.isFinite(f.y));
  return whole.sort((a, b) => a.away - b.away);
}

function told(point) {
  const { line, i } = point;
  const part = (key) => (line[key] ? line[key][i] : null);
  let text = words(line.y[i]);
  if (line.l && line.h && (part("l") !== null || part("h") !== null)) text += ` [${words(part("l")) || "−∞"}, ${words(part("h")) || "∞"}]`;
  if (part("e") !== null) text += `, ${said("exact")} ${words(part("e"))}`;
  return text;
}

function cell(panel, at) {
  const heat = panel.heat;
  const n = (axis, v) => Math.round(axis[1] + ((axis[2] - axis[1]) * (v - axis[3])) / (axis[4] - axis[3]));
  const row = n(panel.y, at.y), column = n(panel.x, at.x);
  const value = heat.v[row] && heat.v[row][column];
  if (value === null || value === undefined) return null;
  return { value, x: heat.x[column], y: heat.y[row] };
}

class Panel {
  constructor(figure, svg, data) {
    Object.assign(this, data);
    this.off = new Set();
    this.svg = svg;
    this.figure = figure;
    this.cursor = svg.querySelector(".cursor");
    this.step = -1;
    svg.addEventListener("pointermove", (event) => { if (!figure.pinned) this.point(this.at(event)); });
    svg.addEventListener("pointerdown", (event) => this.pin(event));
    svg.addEventListener("pointerleave", () => { if (!figure.pinned) this.leave(); });
    svg.addEventListener("blur", () => { if (!figure.pinned) this.leave(); });
    svg.addEventListener("keydown", (event) => this.key(event));
  }

  at(event) {
    const box = this.svg.getBoundingClientRect(), view = this.svg.viewBox.baseVal;
    const scale = view.width / box.width;
    return { x: (event.clientX - box.left) * scale, y: (event.clientY - box.top) * scale };
  }

  key(event) {
    if (event.key === "Escape") return this.leave();
    const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const line = this.lines.find((one) => !this.off.has(one.g));
    if (!way || !line) return;
    event.preventDefault();
    const xs = this.xs[line.x];
    this.step = Math.min(Math.max(this.step + way, 0), xs.length - 1);
    this.point({ x: place(this.x, xs[this.step]), y: place(this.y, line.y[this.step]) });
  }

  // A click or a touch keeps the reading until the next one, on whatever panel, or Escape.
  pin(event) {
    const was = this.figure.pinned;
    if (was) was.leave();
    if (was === this && event.pointerType === "mouse") return;
    this.point(this.at(event));
    if (this.figure.tip.hidden) return;
    this.figure.pinned = this;
    this.figure.tip.classList.add("pinned");
  }

  leave() {
    this.cursor.replaceChildren();
    this.figure.tip.hidden = true;
    this.figure.pinned = null;
    this.figure.tip.classList.remove("pinned");
  }

  point(at) {
    const tip = this.figure.tip;
    if (this.heat) {
      const found = cell(this, at);
      if (!found) return this.leave();
      tip.replaceChildren();
      make("div", `${this.xl}: ${found.x.replace("\n", " ")}`, tip);
      make("div", `${this.yl}: ${found.y.replace("\n", " ")}`, tip);
      make("b", `${this.heat.l}: ${words(found.value)}`, make("div", null, tip));
      return this.show(at);
    }
    const points = nearest(this, at);
    if (!points.length) return this.leave();
    tip.replaceChildren();
    tip.classList.toggle("many", points.length > MANY);
    make("div", `${this.xl}: ${words(points[0].value)}`, tip, "soft");
    for (const one of [...points].sort((a, b) => a.y - b.y)) { // as they stand, the highest first
      const row = make("div", null, tip);
      make("i", "", row).style.background = one.line.c[dark() ? 1 : 0];
      make(one === points[0] ? "b" : "span", `${one.line.n ? one.line.n + ": " : ""}${told(one)}`, row);
    }
    this.mark(points);
    this.show(points[0]);
  }

  mark(points) {
    this.cursor.replaceChildren();
    const line = document.createElementNS(this.svg.namespaceURI, "line");
    const ends = { x1: points[0].x, x2: points[0].x, y1: this.y[4], y2: this.y[3] };
    for (const [name, value] of Object.entries(ends)) line.setAttribute(name, value);
    this.cursor.append(line);
    for (const one of points) {
      const ring = document.createElementNS(this.svg.namespaceURI, "circle");
      for (const [name, value] of Object.entries({ cx: one.x, cy: one.y, r: 4 })) ring.setAttribute(name, value);
      this.cursor.append(ring);
    }
  }

  show(at) {
    const tip = this.figure.tip;
    const box = this.svg.getBoundingClientRect(), whole = this.figure.node.getBoundingClientRect();
    const scale = box.width / this.svg.viewBox.baseVal.width;
    tip.hidden = false;
    // Below the panel, or above it where the window ends: on no curve of the panel that is read.
    const x = box.left - whole.left + at.x * scale - tip.offsetWidth / 2;
    tip.style.left = `${Math.max(0, Math.min(x, whole.width - tip.offsetWidth))}px`;
    const below = box.bottom + tip.offsetHeight + 4 <= innerHeight || box.top < tip.offsetHeight + 4;
    tip.style.top = `${(below ? box.bottom + 2 : box.top - tip.offsetHeight - 2) - whole.top}px`;
  }
}

function figure(node) {
  const data = JSON.parse(node.querySelector("script[type='application/json']").textContent);
  const tip = make("div", null, node, "tip");
  tip.hidden = true;
  tip.setAttribute("role", "status");
  const whole = { node, tip, pinned: null };
  const panels = [...node.querySelectorAll("svg.chart")].map((svg, i) => new Panel(whole, svg, data[i]));
  for (const button of node.querySelectorAll(".switches button")) {
    button.disabled = false;
    button.addEventListener("click", () => {
      const on = button.getAttribute("aria-pressed") !== "true", group = Number(button.dataset.group);
      button.setAttribute("aria-pressed", String(on));
      for (const panel of panels) {
        panel.off[on ? "delete" : "add"](group);
        for (const drawn of panel.svg.querySelectorAll(`[data-g="${group}"]`)) {
          drawn.style.display = on ? "" : "none";
        }
      }
    });
  }
}

const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";

// The number that a cell's text says: 1,234.5, or 1 234,5 where the page says so, and 1.2·10⁻⁷.
function number(text) {
  let plain = text.replaceAll("−", "-").replace("∞", "Infinity").replace(/[\u00a0\u202f]/g, "");
  plain = COMMA ? plain.replaceAll(",", ".") : plain.replaceAll(",", "");
  const power = (all, before, sign, digits) =>
    `${before ? "" : "1"}e${sign ? "-" : ""}${[...digits].map((one) => RAISED.indexOf(one)).join("")}`;
  plain = plain.replace(/(·)?10(⁻)?([⁰¹²³⁴⁵⁶⁷⁸⁹]+)$/, power);
  return plain.trim() === "" ? NaN : Number(plain);
}

function sortable(table) {
  const body = table.tBodies[0];
  const groups = [...table.tBodies];
  for (const [column, head] of [...table.tHead.rows[0].cells].entries()) {
    const button = make("button", head.textContent, null);
    button.type = "button";
    head.replaceChildren(button);
    head.setAttribute("aria-sort", "none");
    button.addEventListener("click", () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      for (const other of table.tHead.rows[0].cells) other.setAttribute("aria-sort", "none");
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const text = (row) => (row.cells[column] ? row.cells[column].textContent.trim() : "");
      const compare = (a, b) => {
        const x = text(a), y = text(b), m = number(x), n = number(y);
        if (!x || !y) return Number(!x) - Number(!y); // what is empty stays below
        const order = Number.isNaN(m) || Number.isNaN(n) ? x.localeCompare(y, "en", { numeric: true }) : m - n;
        return up ? order : -order;
      };
      if (groups.length > 1) table.append(...groups.sort((a, b) => compare(a.rows[0], b.rows[0])));
      else body.append(...[...body.rows].sort(compare));
    });
  }
}

function copied(table) {
  const cells = (row) => [...row.cells].map((one) => one.textContent.trim().replace(/\s+/g, " ")).join("\t");
  return [...table.rows].map(cells).join("\n");
}

async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const area = make("textarea", text, document.body);
    area.select();
    const done = document.execCommand("copy");
    area.remove();
    return done;
  }
}

for (const node of document.querySelectorAll("figure")) figure(node);
for (const table of document.querySelectorAll("table.sortable")) sortable(table);
for (const button of document.querySelectorAll("button.copy")) {
  button.hidden = false;
  button.addEventListener("click", async () => {
    const from = document.getElementById(button.dataset.of);
    const done = await copy(from.tagName === "TABLE" ? copied(from) : from.textContent);
    const before = button.textContent;
    button.textContent = said(done ? "Copied" : "Not allowed here");
    setTimeout(() => { button.textContent = before; }, 1500);
  });
}
const switcher = document.getElementById("theme");
if (switcher) theme(switcher);
