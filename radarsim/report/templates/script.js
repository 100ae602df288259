"use strict";
// What a reader does with the page: switch curves, read values off them, look closer, sort tables, light and
// dark. Panels of lines are drawn again here with other limits, as report/chart.py draws them.
const REACH = 14; // units of a panel within which a point belongs to the pointer's place
const MANY = 8; // curves told from which they stand in two columns
const DIGITS = 4; // of a number that has no interval
const DRAGGED = 6; // units that a pointer has to go before it marks a range; less is a click
const FLAT = 14; // units of height or width under which a range is of the other axis alone
const CLOSEST = 500; // times that a panel can be magnified: its numbers have five digits
const MARKED = 16; // at most about so many markers or crosses of a line are seen
const SEEN = 0.7; // units from the line from which its band is drawn
const WIDE = 1000, LONG = 600; // pixels of a window that has room for all of an answer, letters that are not too many
const SIZE = 12, LETTER = 0.62 * SIZE, ROW = 1.15 * SIZE; // of a panel, as in report/chart.py
const LEAD = 12; // units from a line's end to its name
const MARGIN = { x: 0.02, y: 0.06 };
const NUMERAL = /^−?[\d.,]+(·10[⁰¹²³⁴-⁹⁻]+)?$|^−?10[⁰¹²³⁴-⁹⁻]+$/; // of a tick
const COMMA = document.documentElement.lang !== "en"; // in place of the point

function local(text) {
  const true_minus = text.replace("-", "−");
  return COMMA ? true_minus.replace(".", ",") : true_minus;
}

function words(value) {
  if (value === null || value === undefined) return "";
  return typeof value === "string" ? value : local(String(Number(value.toPrecision(DIGITS))));
}

// A number to two figures of the half-width of its interval, as claims and answers have it.
function rounded(value, half) {
  const place = Math.floor(Math.log10(half)) - 1;
  if (!Number.isFinite(place)) return words(value);
  return place < 0 && place > -12 ? local(Number(value).toFixed(-place)) : words(value);
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

// The value at a place of an axis.
function valueAt([log, low, high, start, end], at) {
  const f = log ? Math.log10 : (v) => v;
  const inner = f(low) + ((f(high) - f(low)) * (at - start)) / (end - start);
  return log ? 10 ** inner : inner;
}

// A number of a tick: at most six digits, powers of ten raised.
function tickText(value) {
  const [mantissa, power] = value.toExponential(5).split("e").map(Number);
  if (value === 0 || (power >= -4 && power < 6)) return local(String(Number(value.toPrecision(6))));
  const raised = `10${power < 0 ? "⁻" : ""}${[...String(Math.abs(power))].map((one) => RAISED[one]).join("")}`;
  return mantissa === 1 ? raised : mantissa === -1 ? `−${raised}` : `${local(String(mantissa))}·${raised}`;
}

// About so many round values between two ends, with their text.
function roundTicks(log, low, high, wanted) {
  if (log && high / low >= 10) return decades(low, high, wanted);
  const rough = (high - low) / wanted, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].find((one) => one * power >= rough * (1 - 1e-9)) * power;
  const made = [];
  for (let n = Math.ceil(low / step - 1e-9); n <= Math.floor(high / step + 1e-9); n++) made.push(n * step);
  return made.map((value) => [value, tickText(value)]);
}

function decades(low, high, wanted) {
  const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
  const stride = Math.max(1, Math.ceil((last - first + 1) / 7));
  const made = [], fine = [];
  for (let n = first; n <= last; n += stride) made.push([10 ** n, tickText(10 ** n)]);
  for (let n = first - 1; n <= last; n++) for (const m of [2, 5]) fine.push([m * 10 ** n, tickText(m * 10 ** n)]);
  const inside = fine.filter(([value]) => low <= value && value <= high);
  return stride > 1 || made.length + inside.length > wanted + 3 ? made : [...made, ...inside];
}

// The ends of an axis for some values: limits where given, else the values with a margin.
function ends(log, values, given, margin) {
  const good = values.filter((v) => v !== null && Number.isFinite(v) && (!log || v > 0));
  let low = Infinity, high = -Infinity;
  for (const v of good) { low = Math.min(low, v); high = Math.max(high, v); }
  if (!good.length) [low, high] = log ? [1, 10] : [0, 1];
  let [a, b] = log ? [Math.log10(low), Math.log10(high)] : [low, high];
  const pad = margin * (b - a) || (log ? 0.5 : 0.5 * Math.abs(a) || 0.5);
  [low, high] = log ? [10 ** (a - pad), 10 ** (b + pad)] : [a - pad, b + pad];
  if (given[0] !== null && (!log || given[0] > 0)) low = given[0];
  if (given[1] !== null && (!log || given[1] > 0)) high = given[1];
  return low < high ? [low, high] : [low, log ? 10 * low : low + 1];
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
    if (!panel.inside({ x, y: at.y })) continue;
    if (line.p && Math.hypot(y - at.y, x - at.x) > 3 * REACH) continue;
    found.push({ line, i: best, x, y, value: xs[best], away: Math.abs(y - at.y) });
  }
  const whole = found.filter((f) => Number.isFinite(f.y));
  return whole.sort((a, b) => a.away - b.away);
}

function told(point, unit) {
  const { line, i } = point;
  const part = (key) => (line[key] ? line[key][i] : null);
  const half = (part("h") - part("l")) / 2, y = line.y[i];
  const put = line.l && line.h && part("l") !== null && part("h") !== null && half > 0 ? (v) => rounded(v, half) : words;
  let text = put(y);
  if (line.l && line.h && (part("l") !== null || part("h") !== null)) {
    text += ` [${part("l") === null ? "−∞" : put(part("l"))}, ${part("h") === null ? "∞" : put(part("h"))}]`;
  }
  if (unit) text += ` ${unit}`;
  if (part("e") !== null) text += `, ${said("exact")} ${put(part("e"))}`;
  return text;
}

// The unit at the end of an axis' label.
function unitOf(label) {
  return label.includes(", ") ? label.split(", ").pop() : "";
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
    this.from = null; // where the pointer went down
    if (this.draw) this.prepare();
    svg.addEventListener("pointermove", (event) => this.moved(event));
    svg.addEventListener("pointerdown", (event) => this.down(event));
    svg.addEventListener("pointerup", (event) => this.up(event));
    svg.addEventListener("pointercancel", () => { this.from = null; this.leave(); });
    svg.addEventListener("pointerleave", () => { if (!figure.pinned && !this.from) this.leave(); });
    svg.addEventListener("blur", () => { if (!figure.pinned) this.leave(); });
    svg.addEventListener("dblclick", () => this.look(null));
    svg.addEventListener("keydown", (event) => this.key(event));
  }

  at(event) {
    const box = this.svg.getBoundingClientRect(), view = this.svg.viewBox.baseVal;
    const scale = view.width / box.width;
    return { x: (event.clientX - box.left) * scale, y: (event.clientY - box.top) * scale };
  }

  inside({ x, y }) {
    const within = (v, [, , , a, b]) => v >= Math.min(a, b) - 1 && v <= Math.max(a, b) + 1;
    return within(x, this.x) && within(y, this.y);
  }

  moved(event) {
    const at = this.at(event);
    if (!this.from) {
      if (!this.figure.pinned) this.point(at);
      return;
    }
    if (!this.dragging && Math.hypot(at.x - this.from.x, at.y - this.from.y) < DRAGGED) return;
    if (!this.dragging) this.leave();
    this.dragging = true;
    this.frame(this.marked(at, event.pointerType !== "mouse"));
  }

  down(event) {
    if (event.button !== 0 || event.target.closest(".end")) return;
    this.from = this.at(event);
    this.dragging = false;
    this.svg.setPointerCapture(event.pointerId);
  }

  // A click or a touch keeps the interpretation until the next one, on whatever panel, or Escape; a drag looks closer.
  up(event) {
    if (!this.from) return;
    const at = this.at(event), marked = this.dragging && this.draw ? this.marked(at, event.pointerType !== "mouse") : null;
    const dragged = this.dragging;
    this.dragging = false;
    if (dragged) {
      this.leave();
      this.from = null;
      if (marked) this.look({ x: marked.across && this.values(this.x, marked.x), y: marked.up && this.values(this.y, marked.y) });
      return;
    }
    this.from = null;
    const was = this.figure.pinned;
    if (was) was.leave();
    if (was === this && event.pointerType === "mouse") return;
    this.point(at);
    this.pin();
  }

  pin() {
    if (this.figure.tip.hidden) return;
    this.figure.pinned = this;
    this.figure.tip.classList.add("pinned");
  }

  // The range between where the pointer went down and where it is: of a touch, which cannot go up or down without
  // moving the page, of x alone.
  marked(at, flat) {
    const clamped = (v, [, , , a, b]) => Math.min(Math.max(v, Math.min(a, b)), Math.max(a, b));
    const [x, y] = ["x", "y"].map((axis) => [this.from[axis], at[axis]].map((v) => clamped(v, this[axis])).sort((a, b) => a - b));
    const wide = x[1] - x[0] >= FLAT, deep = !flat && y[1] - y[0] >= FLAT;
    return { x, y, across: wide, up: deep };
  }

  frame({ x, y, across, up }) {
    const box = document.createElementNS(this.svg.namespaceURI, "rect");
    const [left, right] = across ? x : [this.x[3], this.x[4]], [top, bottom] = up ? y : [this.y[4], this.y[3]];
    if (!this.draw || (!across && !up)) return this.cursor.replaceChildren();
    for (const [name, value] of Object.entries({ x: left, y: top, width: right - left, height: bottom - top })) box.setAttribute(name, value);
    this.cursor.replaceChildren(box);
  }

  values(axis, places) {
    return places.map((at) => valueAt(axis, at)).sort((a, b) => a - b);
  }

  key(event) {
    const way = { ArrowRight: 1, ArrowLeft: -1, Home: -1e9, End: 1e9 }[event.key];
    const factor = { "+": 0.5, "=": 0.5, "-": 2, "−": 2 }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Escape") {
      if (this.figure.tip.hidden) this.look(null);
      this.leave();
    } else if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      if (this.figure.pinned) this.leave(); else this.pin();
    } else if (factor && this.draw) {
      event.preventDefault();
      this.magnify(factor);
    } else if (event.key === "0") this.look(null);
    else if (way && event.shiftKey) { event.preventDefault(); this.shift(Math.sign(way) / 4); } else if (way) this.go(event, way);
  }

  // The interpretation one point further, the view with it.
  go(event, way) {
    const line = this.lines.find((one) => !this.off.has(one.g));
    if (!line) return;
    event.preventDefault();
    const xs = this.xs[line.x];
    this.step = Math.min(Math.max(this.step + way, 0), xs.length - 1);
    if (this.zoom && this.zoom.x) {
      const [low, high] = [this.x[1], this.x[2]];
      if (xs[this.step] < low || xs[this.step] > high) this.shift((place(this.x, xs[this.step]) - (this.x[3] + this.x[4]) / 2) / (this.x[4] - this.x[3]));
    }
    this.figure.pinned = null;
    this.figure.tip.classList.remove("pinned");
    this.point({ x: place(this.x, xs[this.step]), y: place(this.y, line.y[this.step]) });
  }

  // Closer by a factor about the interpretation, or about the middle.
  magnify(factor) {
    const line = this.lines.find((one) => !this.off.has(one.g));
    const read = line && this.step >= 0 ? place(this.x, this.xs[line.x][this.step]) : NaN;
    const middle = read >= this.x[3] && read <= this.x[4] ? read : (this.x[3] + this.x[4]) / 2;
    const half = (factor * (this.x[4] - this.x[3])) / 2;
    const home = this.whole("x");
    if (2 * half >= this.x[4] - this.x[3] && valueAt(this.x, middle - half) <= home[0] && valueAt(this.x, middle + half) >= home[1]) return this.look(null);
    this.look({ x: this.values(this.x, [middle - half, middle + half]), y: null });
    if (Number.isFinite(read)) this.go(new Event("keydown"), 0);
  }

  shift(share) {
    if (!this.zoom || !this.zoom.x) return;
    const by = share * (this.x[4] - this.x[3]);
    this.look({ x: this.values(this.x, [this.x[3] + by, this.x[4] + by]), y: null });
  }

  leave() {
    this.cursor.replaceChildren();
    this.figure.tip.hidden = true;
    this.figure.pinned = null;
    this.figure.tip.classList.remove("pinned");
  }

  // What the panel is made of, and what has to be known to draw it with other limits.
  prepare() {
    const { svg } = this;
    this.home = { x: this.x, y: this.y };
    this.log = { x: this.x[0], y: this.y[0] };
    this.zoom = null;
    this.inner = svg.querySelector("svg");
    this.curves = [...this.inner.querySelectorAll(":scope > g[data-g]")];
    this.fixed = [...this.inner.querySelectorAll(":scope > g:not([data-g])")];
    this.axisPath = svg.querySelector(":scope > .axis");
    this.gridPath = svg.querySelector(":scope > .grid");
    this.texts = [...svg.querySelectorAll(":scope > text[data-x], :scope > text[data-y]")];
    this.shapes = this.curves.map((curve) => {
      const one = curve.querySelector(".m, .f"), cross = curve.querySelector(".x");
      const shape = (path) => (path ? (path.getAttribute("d").split("M")[1] || "").replace(/^-?[\d.]+ -?[\d.]+/, "") : "");
      return { marker: shape(one), cross: shape(cross) };
    });
    svg.classList.add("closer");
    this.ends = [...svg.querySelectorAll(".end")];
    this.named();
  }

  // Whether a logarithm of y serves: all is above zero, over a decade or more, on an axis that is none yet.
  decades() {
    if (this.log.y || this.draw.equal || this.draw.ticks[1]) return false;
    const values = this.lines.flatMap((line) => line.y).filter((v) => v !== null);
    const least = values.reduce((a, b) => Math.min(a, b), Infinity), most = values.reduce((a, b) => Math.max(a, b), 0);
    return least > 0 && most / least >= 10;
  }

  // All values along an axis that are to be seen; of y within a range of x.
  seen(axis, range) {
    const values = [];
    for (const line of this.lines) {
      if (this.off.has(line.g)) continue;
      const xs = this.xs[line.x];
      if (axis === "x") values.push(...xs.filter((_, i) => line.y[i] !== null && (!this.log.y || line.y[i] > 0)));
      else {
        for (let i = 0; i < xs.length; i++) {
          if (range && (xs[i] < range[0] || xs[i] > range[1])) continue;
          for (const key of ["y", "l", "h"]) if (line[key]) values.push(line[key][i]);
        }
      }
    }
    const across = axis === "x" ? "data-x" : "data-y", other = axis === "x" ? "data-y" : "data-x";
    for (const one of this.fixed) if (!range && one.hasAttribute(across) && !one.hasAttribute(other)) values.push(Number(one.getAttribute(across)));
    return values;
  }

  // The ends of an axis when nothing is magnified.
  whole(axis, range = null) {
    const own = this.home[axis], given = this.draw.lim[axis === "x" ? 0 : 1];
    if (!this.off.size && this.log[axis] === own[0] && !range) return [own[1], own[2]];
    return ends(this.log[axis], this.seen(axis, range), given, MARGIN[axis]);
  }

  // Look at a range {x: [low, high], y: …}, either null: all of x, or what y is there; null: at everything.
  look(range) {
    if (!this.draw || (!range && !this.zoom)) return;
    const closest = (axis, wanted) => {
      if (!wanted) return null;
      const f = this.log[axis] ? Math.log10 : (v) => v, own = this.whole(axis).map(f), inner = wanted.map(f);
      return inner[1] - inner[0] < (own[1] - own[0]) / CLOSEST ? (this.zoom ? this.zoom[axis] : null) : wanted;
    };
    const kept = range && this.zoom ? this.zoom : { x: null, y: null };
    const next = range ? { x: closest("x", range.x) || kept.x, y: closest("y", range.y) } : null;
    this.zoom = next && (next.x || next.y) ? next : null;
    this.redraw();
    this.figure.changed();
  }

  redraw() {
    const x = (this.zoom && this.zoom.x) || this.whole("x");
    const y = (this.zoom && this.zoom.y) || this.whole("y", this.zoom && this.zoom.x);
    this.x = [this.log.x, ...x, this.home.x[3], this.home.x[4]];
    this.y = [this.log.y, ...y, this.home.y[3], this.home.y[4]];
    if (this.draw.equal) this.evened();
    const own = this.ticks("x", 6), up = this.ticks("y", 5);
    const widest = Math.max(1, ...up.map(([, text]) => text.length));
    const left = up.given ? this.home.x[3] : Math.max(30, 16 + LETTER * widest);
    this.x[3] = left;
    const [right, bottom, top] = [this.x[4], this.y[3], this.y[4]];
    const xs = own.map(([v]) => place(this.x, v)), ys = up.map(([v]) => place(this.y, v));
    this.gridPath.setAttribute("d", [...xs.map((v) => `M${v} ${top}V${bottom}`), ...ys.map((v) => `M${left} ${v}H${right}`)].join(""));
    this.axisPath.setAttribute("d", `M${left} ${top}V${bottom}H${right}`);
    this.label("x", own, xs, (at) => ({ x: at, y: bottom + 1.25 * SIZE, "text-anchor": "middle" }));
    this.label("y", up, ys, (at) => ({ x: left - 5, y: at + 0.35 * SIZE, "text-anchor": "end" }));
    const box = [left - 4, top - 4, right - left + 8, bottom - top + 8];
    for (const [n, name] of ["x", "y", "width", "height"].entries()) this.inner.setAttribute(name, box[n]);
    this.inner.setAttribute("viewBox", box.join(" "));
    for (const one of this.fixed) {
      const moved = ["x", "y"].map((axis) => (one.hasAttribute(`data-${axis}`) ? this.away(axis, Number(one.getAttribute(`data-${axis}`))) : 0));
      one.style.display = moved.every(Number.isFinite) ? "" : "none";
      if (moved.every(Number.isFinite)) one.setAttribute("transform", `translate(${moved.join(" ")})`);
    }
    this.lines.forEach((line, n) => this.curve(line, this.curves[n], this.shapes[n]));
    this.named();
  }

  // The names at the ends of the lines, as far as these are seen, apart from each other.
  named() {
    const [right, bottom, top] = [this.x[4], this.y[3], this.y[4]];
    const found = [];
    for (const node of this.ends) {
      const line = this.lines[Number(node.dataset.n)], xs = this.xs[line.x];
      const i = xs.findLastIndex((v, n) => line.y[n] !== null && place(this.x, v) <= right + 1);
      const from = i < 0 ? NaN : place(this.y, line.y[i]);
      node.style.display = Number.isFinite(from) ? "inline" : "none";
      if (Number.isFinite(from)) found.push({ node, x: place(this.x, xs[i]), from: Math.min(Math.max(from, top), bottom) });
    }
    found.sort((a, b) => a.from - b.from);
    let last = top - ROW;
    for (const one of found) one.y = last = Math.max(one.from, last + ROW);
    last = bottom + ROW;
    for (const one of found.reverse()) one.y = last = Math.min(one.y, last - ROW);
    for (const { node, x, from, y } of found) {
      node.firstChild.setAttribute("d", `M${x + 3} ${from}L${Math.max(x, right) + LEAD - 3} ${y}`);
      node.lastChild.setAttribute("x", Math.max(x, right) + LEAD);
      node.lastChild.setAttribute("y", y + 0.35 * SIZE);
    }
  }

  away(axis, value) {
    return place(this[axis], value) - place(this.home[axis], value);
  }

  // As many units of both axes to a place: the one that shows less sees more, to both sides.
  evened() {
    const per = (axis) => (axis[2] - axis[1]) / Math.abs(axis[4] - axis[3]);
    const most = Math.max(per(this.x), per(this.y));
    for (const axis of [this.x, this.y]) {
      const more = (most * Math.abs(axis[4] - axis[3]) - (axis[2] - axis[1])) / 2;
      axis[1] -= more;
      axis[2] += more;
    }
  }

  // The ticks of an axis: those given while two of them are seen, else round numbers.
  ticks(which, wanted) {
    const axis = this[which], given = new Map();
    if (this.draw.ticks[which === "x" ? 0 : 1]) {
      for (const one of this.texts) {
        const value = Number(one.getAttribute(`data-${which}`));
        if (one.hasAttribute(`data-${which}`) && value >= axis[1] && value <= axis[2]) given.set(value, "");
      }
      if (given.size > 1 || !this.zoom) return Object.assign([...given], { given: true });
    }
    return roundTicks(axis[0], axis[1], axis[2], wanted).filter(([v]) => v >= axis[1] && v <= axis[2]);
  }

  label(which, ticks, places, attributes) {
    const own = this.texts.filter((one) => one.hasAttribute(`data-${which}`));
    const where = new Map(ticks.map(([value], n) => [value, places[n]]));
    for (const one of own) {
      const at = where.get(Number(one.getAttribute(`data-${which}`)));
      one.style.display = ticks.given && at !== undefined ? "" : "none";
      if (ticks.given && at !== undefined) one.setAttribute(which, which === "x" ? at : at + 0.35 * SIZE);
    }
    for (const one of this.svg.querySelectorAll(`:scope > text.t${which}`)) one.remove();
    if (ticks.given) return;
    ticks.forEach(([, text], n) => {
      const made = document.createElementNS(this.svg.namespaceURI, "text");
      made.setAttribute("class", `t${which}`);
      for (const [name, value] of Object.entries(attributes(places[n]))) made.setAttribute(name, value);
      made.textContent = text;
      this.svg.insertBefore(made, this.inner);
    });
  }

  curve(line, node, shape) {
    const xs = this.xs[line.x].map((v) => (v === null ? NaN : place(this.x, v)));
    const at = (key) => line[key].map((v) => (v === null ? NaN : Math.min(Math.max(place(this.y, v), -1e4), 1e4)));
    const ys = at("y"), good = xs.map((x, i) => Number.isFinite(x) && Number.isFinite(ys[i]));
    const visible = xs.filter((x, i) => good[i] && x >= this.x[3] - 1 && x <= this.x[4] + 1).length;
    const step = line.p ? 1 : Math.max(1, Math.ceil(visible / MARKED));
    const put = (css, d) => {
      let path = node.querySelector(`.${css}`);
      if (!path && d) {
        path = document.createElementNS(this.svg.namespaceURI, "path");
        path.setAttribute("class", css);
        node.prepend(path);
      }
      if (path) path.setAttribute("d", d);
    };
    const round = (v) => v.toFixed(1);
    const alone = (i) => good[i] && !good[i - 1] && !good[i + 1];
    const sprinkled = (values, first, kind) => {
      let d = "";
      for (let i = 0; i < xs.length; i++) {
        if ((i % step === first || alone(i)) && Number.isFinite(xs[i]) && Number.isFinite(values[i])) d += `M${round(xs[i])} ${round(values[i])}${kind}`;
      }
      return d;
    };
    if (node.querySelector(".l")) {
      let d = "";
      good.forEach((there, i) => { if (there) d += `${i && good[i - 1] ? "L" : "M"}${round(xs[i])} ${round(ys[i])}`; });
      put("l", d);
    }
    for (const css of ["m", "f"]) if (node.querySelector(`.${css}`)) put(css, sprinkled(ys, 0, shape.marker));
    if (node.querySelector(".x")) put("x", sprinkled(at("e"), step > 1 ? step >> 1 : 0, shape.cross));
    if (!line.l || !line.h) return;
    const edge = (key, end) => at(key).map((v) => (Number.isFinite(v) ? v : end));
    const low = edge("l", 1e4), high = edge("h", -1e4), known = (i) => line.l[i] !== null || line.h[i] !== null;
    const there = xs.map((_, i) => i).filter((i) => good[i] && known(i));
    put("w", there.filter((i) => line.p || alone(i)).map((i) => `M${round(xs[i])} ${round(low[i])}V${round(high[i])}`).join(""));
    if (!line.p) {
      const broad = there.some((i) => low[i] - high[i] >= 2 * SEEN);
      const runs = [];
      there.forEach((i, n) => { if (n && there[n - 1] === i - 1) runs.at(-1).push(i); else runs.push([i]); });
      const rings = runs.filter((run) => run.length > 1).map((run) => [...run.map((i) => [xs[i], high[i]]), ...run.reverse().map((i) => [xs[i], low[i]])]);
      put("b", broad ? rings.map((ring) => `M${ring.map(([a, b]) => `${round(a)} ${round(b)}`).join("L")}z`).join("") : "");
    }
  }

  // The axis by the logarithm, or not; what is magnified stays so where it can.
  logarithmic(axis, on) {
    if (this.log[axis] === on) return;
    this.log[axis] = on;
    this.redraw();
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
    const unit = unitOf(this.yl), here = this.across(points[0].value);
    tip.replaceChildren();
    tip.classList.toggle("many", points.length > MANY);
    make("div", [this.xl, here].filter(Boolean).join(": "), tip, "soft");
    for (const one of [...points].sort((a, b) => a.y - b.y)) { // as they stand, the highest first
      const row = make("div", null, tip), there = this.across(one.value);
      make("i", "", row).style.background = one.line.c[dark() ? 1 : 0];
      const own = there === here ? "" : `(${[there, unitOf(this.xl)].filter(Boolean).join(" ")})`; // of other scans
      const name = [one.line.n, own].filter(Boolean).join(" ");
      make(one === points[0] ? "b" : "span", `${name ? name + ": " : ""}${told(one, unit)}`, row);
    }
    this.mark(points);
    this.show(points[0]);
  }

  // A place of the axis of x in words: a number, or what stands at the tick where that is a word.
  across(value) {
    const near = (one) => Math.abs(Number(one.getAttribute("data-x")) - value) < 0.45 && !NUMERAL.test(one.textContent.trim());
    const ticks = [...this.svg.querySelectorAll(":scope > text[data-x]")].filter(near);
    return ticks.length ? ticks.map((one) => one.textContent.trim()).join(" ") : words(value); // a long one has two lines
  }

  mark(points) {
    this.cursor.replaceChildren();
    const line = document.createElementNS(this.svg.namespaceURI, "line");
    const ends = { x1: points[0].x, x2: points[0].x, y1: this.y[4], y2: this.y[3] };
    for (const [name, value] of Object.entries(ends)) line.setAttribute(name, value);
    this.cursor.append(line);
    for (const one of points) {
      if (!this.inside(one)) continue;
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
  const whole = { node, tip, pinned: null, changed() {} };
  const panels = [...node.querySelectorAll("svg.chart")].map((svg, i) => new Panel(whole, svg, data[i]));
  for (const name of node.querySelectorAll(".switches button, .end")) {
    const group = Number(name.dataset.group), alike = node.querySelectorAll(`[data-group="${group}"]`);
    name.disabled = false;
    name.addEventListener("click", () => {
      const on = name.getAttribute("aria-pressed") === "false";
      for (const one of alike) one.setAttribute("aria-pressed", String(on));
      for (const panel of panels) {
        panel.off[on ? "delete" : "add"](group);
        for (const drawn of panel.svg.querySelectorAll(`[data-g="${group}"]`)) drawn.style.display = on ? "" : "none";
        if (panel.draw && panel.lines.some((line) => line.g === group)) panel.redraw();
      }
    });
  }
  const back = make("button", said("Show all"), null, "back");
  back.type = "button";
  node.querySelector(".panels").after(back);
  whole.changed = () => { back.hidden = !panels.some((panel) => panel.zoom); };
  back.addEventListener("click", () => { for (const panel of panels) if (panel.zoom) panel.look(null); });
  whole.changed();
  return panels;
}

// One button of the page: the axes of y by the logarithm, where that serves, or as they were.
function scales(button, panels) {
  const able = panels.filter((panel) => panel.draw && panel.decades());
  const told = () => { button.textContent = said(button.value ? "Linear axes" : "Logarithmic axes"); };
  button.hidden = !able.length;
  button.addEventListener("click", () => {
    button.value = button.value ? "" : "on";
    for (const panel of able) panel.logarithmic("y", Boolean(button.value));
    told();
  });
  told();
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
    const button = make("button", "", null);
    button.type = "button";
    button.append(...head.childNodes); // with its formulas
    head.append(button);
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

const drawn = [...document.querySelectorAll("figure")].flatMap(figure);
const axes = document.getElementById("axes");
if (axes) scales(axes, drawn);
for (const more of document.querySelectorAll(".answer details, details.warning")) {
  more.open = innerWidth >= WIDE && more.textContent.length < LONG;
}
for (const table of document.querySelectorAll("table.sortable")) sortable(table);
const switcher = document.getElementById("theme");
if (switcher) theme(switcher);
