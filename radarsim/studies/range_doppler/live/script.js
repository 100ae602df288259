"use strict";
// σ(k) and gains of both filters, exactly, and how they are drawn. No server: the recursion runs here.
const radar = (() => {
  // ---- the recursion (radarsim/studies/range_doppler/error_recursion.py and exact.py are the same in Python) ----
  const at = (M, f) => M.map((row, i) => row.map((_, j) => f(i, j)));
  const times = (A, B) => at(A, (i, j) => A[i].reduce((sum, a, n) => sum + a * B[n][j], 0));
  const turned = (A) => at(A, (i, j) => A[j][i]);
  const plus = (A, B) => at(A, (i, j) => A[i][j] + B[i][j]);

  // One plot of component i with a variance: by the gain of the believed covariance P both P and the true S change.
  function seen(P, S, i, variance) {
    const gain = P.map((row) => row[i] / (P[i][i] + variance));
    const kept = at(P, (m, n) => (m === n) - (n === i ? gain[m] : 0));
    const joseph = (C) => plus(times(times(kept, C), turned(kept)), at(C, (m, n) => gain[m] * gain[n] * variance));
    return [joseph(P), joseph(S)];
  }

  // Least squares on the first plots: three ranges; or range and velocity twice, of which the oldest range comes last.
  function start(observes, r, v, dt) {
    if (observes === 1) {
      const [d, q] = [1 / dt, r * r];
      return [[q, 1.5 * d * q, d * d * q], [1.5 * d * q, 6.5 * d * d * q, 6 * d ** 3 * q], [d * d * q, 6 * d ** 3 * q, 6 * d ** 4 * q]];
    }
    const w = v * v, P = [[r * r, 0, 0], [0, w, w / dt], [0, w / dt, (2 * w) / (dt * dt)]];
    const h = [1, -dt, (dt * dt) / 2], Ph = P.map((row) => row.reduce((sum, p, n) => sum + p * h[n], 0));
    const s = h.reduce((sum, x, n) => sum + x * Ph[n], r * r), kept = at(P, (m, n) => (m === n) - (Ph[m] * h[n]) / s);
    return plus(times(times(kept, P), turned(kept)), at(P, (m, n) => (Ph[m] * Ph[n] * r * r) / (s * s)));
  }

  // σ of r, V, a at scans 1 … k, null where the filter has no estimate yet.
  function course(observes, { r, v, dt, dm, k }) {
    const first = observes === 1 ? 3 : 2, found = [];
    const F = [[1, dt, (dt * dt) / 2], [0, 1, dt], [0, 0, 1]], g = [dt ** 3 / 6, (dt * dt) / 2, dt];
    let P = start(observes, r, v, dt), S = P;
    for (let n = 1; n <= k; n++) {
      if (n > first) {
        P = plus(times(times(F, P), turned(F)), at(P, (i, j) => dm * g[i] * g[j]));
        S = times(times(F, S), turned(F));
        for (let i = 0; i < observes; i++) [P, S] = seen(P, S, i, (i ? v : r) ** 2);
      }
      found.push(n < first ? [r, observes === 2 ? v : null, null] : S.map((row, i) => Math.sqrt(row[i])));
    }
    return found;
  }

  function sigmas(setting) {
    const one = course(1, setting), two = course(2, setting);
    const gain = one.map((row, n) => row.map((s, i) => (s === null || two[n][i] === null ? null : 100 * (1 - two[n][i] / s))));
    return { one, two, gain };
  }

  // ---- the closed form (radarsim/studies/range_doppler/closed_form.py) ----
  function variances(c) {
    let A = 2 + Math.SQRT2 * c ** 0.25;
    for (let n = 0; n < 60; n++) A -= (A ** 4 - 8 * A - 4 * c) / (4 * A ** 3 - 8);
    const X = A ** 3, W = X * X - 8 * X + 8, d = X - 2, e = (A * (X - 8)) / 4;
    const [p, q, u, w] = [(2 * A * (X - 4)) / W, (4 * A * A) / W, 8 / W, (4 * (X - 2)) / W];
    const b = (A * A) / 2 - e * p;
    return [p - (u * u * A) / d, w - (1 + p * p * A) / d, q * u + e * w * p - (1.5 * A * A - 2 * b + b * b * A) / d];
  }

  function numbers({ r, v, dm }) {
    const one = r / v, two = (r * r / dm) ** (1 / 6), c = (one / two) ** 2, base = variances(0);
    return { one, two, c, limit: variances(c).map((s, i) => 100 * (1 - Math.sqrt(s / base[i]))) };
  }

  // ---- the setting: what is allowed, and how it stands in the address ----
  const ALLOWED = { r: [0.1, 1e4], v: [1e-3, 1e3], dt: [1e-2, 1e3], dm: [1e-10, 1e4], k: [4, 400] };
  const setting = { r: 250, v: 15, dt: 10, dm: 1e-3, k: 30 };

  function parsed(name, text) {
    const value = Number(String(text).trim().replace(",", ".").replace("−", "-")), [low, high] = ALLOWED[name];
    const good = String(text).trim() !== "" && value >= low && value <= high && (name !== "k" || Number.isInteger(value));
    return good ? value : null;
  }

  function fromAddress() {
    for (const [name, text] of new URLSearchParams(location.hash.slice(1))) {
      if (Object.hasOwn(ALLOWED, name) && parsed(name, text) !== null) setting[name] = parsed(name, text);
    }
  }

  const address = () => "#" + Object.entries(setting).map(([name, value]) => `${name}=${value}`).join("&");

  return { sigmas, numbers, variances, setting, parsed, fromAddress, address, ALLOWED };
})();

(() => {
  const { setting, ALLOWED } = radar, NAMES = ["range", "velocity", "acceleration"].map(translated), STEPS = 1000;
  const [LEFT, RIGHT, TOP, BOTTOM] = [48, 412, 8, 226];
  const node = (id) => document.getElementById(id);
  const short = (x, digits = 4) => localNumeral(String(Number(x.toPrecision(digits))));
  const filled = (text, values) => translated(text).replace(/\{(\w+)\}/g, (_, name) => values[name]);

  function put(svg, tag, attributes, text) {
    const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (text !== undefined) made.textContent = text;
    svg.append(made);
    return made;
  }

  function ticks(low, high, log) {
    if (log) {
      const powers = [], decades = Math.log10(high / low), step = Math.max(1, Math.ceil(decades / 6));
      for (let n = Math.ceil(Math.log10(low) - 1e-9); 10 ** n <= high * (1 + 1e-9); n += step) powers.push(10 ** n);
      const multiples = [];
      for (let n = Math.floor(Math.log10(low)); 10 ** n <= high; n++) multiples.push(2 * 10 ** n, 5 * 10 ** n);
      const inside = multiples.filter((v) => v >= low && v <= high && step === 1);
      const some = decades <= 2.5 ? inside : [inside[0], inside[inside.length - 1]].filter((v) => v < powers[0] || v > powers[powers.length - 1]);
      const all = [...powers, ...some].sort((a, b) => a - b);
      if (all.length >= 3) return all;
    }
    const raw = (high - low) / 5, unit = 10 ** Math.floor(Math.log10(raw));
    const step = unit * [1, 2, 5, 10].find((m) => m * unit >= raw * 0.999), found = [];
    for (let n = Math.ceil(low / step - 1e-9); n * step <= high * (1 + 1e-9); n++) found.push(n * step);
    return found;
  }

  // A panel: axes, lines [[css, [[x, y], …]], …], and dots; gives the places of values.
  function draw(svg, x, y, lines, dots = []) {
    svg.replaceChildren();
    const scale = ([low, high, log], a, b) => {
      const f = log ? Math.log : (v) => v;
      return (v) => a + ((b - a) * (f(v) - f(low))) / (f(high) - f(low));
    };
    const px = scale(x, LEFT, RIGHT), py = scale(y, BOTTOM, TOP);
    const across = ticks(...x);
    if (!x[2]) across.splice(0, across.length, ...across.filter((v) => px(x[1]) - px(v) > 30), x[1]);  // the last scan is named
    for (const v of across) {
      put(svg, "line", { class: "grid", x1: px(v), x2: px(v), y1: TOP, y2: BOTTOM });
      const anchor = px(v) > RIGHT - 12 ? "end" : "middle";
      put(svg, "text", { class: "soft", x: anchor === "end" ? RIGHT : px(v), y: BOTTOM + 15, "text-anchor": anchor }, short(v, 3));
    }
    for (const v of ticks(...y)) {
      put(svg, "line", { class: "grid", x1: LEFT, x2: RIGHT, y1: py(v), y2: py(v) });
      put(svg, "text", { class: "soft", x: LEFT - 5, y: py(v) + 4, "text-anchor": "end" }, short(v, 3));
    }
    put(svg, "text", { class: "lab", x: RIGHT, y: 256, "text-anchor": "end" }, x[3]);
    if (!y[2] && y[0] < 0) put(svg, "line", { class: "ref", x1: LEFT, x2: RIGHT, y1: py(0), y2: py(0) });
    put(svg, "path", { class: "axis", d: `M${LEFT} ${TOP}V${BOTTOM}H${RIGHT}` });
    for (const [css, points] of lines) {
      const inside = points.filter(([, v]) => v !== null);
      const d = inside.map(([a, b], i) => `${i ? "L" : "M"}${px(a).toFixed(2)} ${Math.min(Math.max(py(b), TOP), BOTTOM).toFixed(2)}`).join("");
      if (d) put(svg, "path", { class: `l ${css}`, d });
      if (inside.length <= 40) for (const [a, b] of inside) if (py(b) >= TOP && py(b) <= BOTTOM) put(svg, "circle", { class: `m ${css}`, cx: px(a), cy: py(b), r: 2.4 });
    }
    for (const [css, a, b] of dots) put(svg, "circle", { class: `f ${css}`, cx: px(a), cy: Math.min(Math.max(py(b), TOP), BOTTOM), r: 5 });
    put(svg, "g", { class: "cursor" });
    return px;
  }

  let shown = null, scan = -1;

  function sentence() {
    const last = shown.gain[setting.k - 1];
    const [r, V, a] = last.map((g) => Math.round(10 * g) / 10 + 0);
    const part = (g, less, more) => filled(g >= 0 ? less : more, { size: short(Math.abs(g)) });
    const told = {
      k: setting.k, t: short((setting.k - 1) * setting.dt),
      range: part(r, "reduces the range error by {size} %", "raises the range error by {size} %"),
      velocity: (r >= 0) === (V >= 0)
        ? part(V, "the velocity error by {size} %", "the velocity error by {size} %")
        : part(V, "reduces the velocity error by {size} %", "raises the velocity error by {size} %"),
      acceleration: part(a, "the acceleration error falls by {size} %", "the acceleration error rises by {size} %"),
    };
    node("sentence").textContent = filled("At scan {k}, {t} s, Doppler {range} and {velocity}; {acceleration}.", told);
  }

  function redraw() {
    shown = radar.sigmas(setting);
    const t = (n) => n * setting.dt, time = [0, t(setting.k - 1), false, translated("time, s")];
    const places = [];
    for (let i = 0; i < 3; i++) {
      const of = (rows) => rows.map((row, n) => [t(n), row[i]]), all = [...shown.one, ...shown.two].map((row) => row[i]).filter((s) => s !== null);
      const low = Math.min(...all), high = Math.max(...all), log = high > 20 * low;
      const y = log ? [low / 1.3, high * 1.3, true] : [0, high * 1.08, false];
      places.push(draw(node(`sigma-${i}`), time, y, [["one", of(shown.one)], ["two", of(shown.two)]]));
    }
    const gains = [0, 1, 2].map((i) => shown.gain.map((row, n) => [t(n), row[i]]));
    const least = Math.min(0, ...shown.gain.flat().filter((g) => g !== null));
    const floor = least < 0 ? Math.max(-60, least * 1.1) : 0, css = ["gr", "gv", "ga"];
    places.push(draw(node("gain"), time, [floor, 100, false], gains.map((points, i) => [css[i], points])));
    const { c } = radar.numbers(setting), cs = Array.from({ length: 121 }, (_, n) => 0.01 * 10 ** (n / 24));
    const base = radar.variances(0), lines = css.map((name, i) => [name, cs.map((x) => [x, 100 * (1 - Math.sqrt(radar.variances(x)[i] / base[i]))])]);
    const mine = shown.gain[setting.k - 1].map((g, i) => [css[i], Math.min(Math.max(c, 0.01), 1000), g]);
    draw(node("steady"), [0.01, 1000, true, "c = (τ₁/τ₂)²"], [-15, 100, false], lines, mine);
    node("steady").querySelectorAll("circle.m").forEach((dot) => dot.remove());
    ["sigma-0", "sigma-1", "sigma-2", "gain"].forEach((id, n) => { node(id).place = places[n]; });
    sentence();
    point(Math.min(scan, setting.k - 1));
  }

  // ---- reading values ----
  function point(n) {
    scan = n;
    if (n < 0) return;
    for (const id of ["sigma-0", "sigma-1", "sigma-2", "gain"]) {
      const svg = node(id), cursor = svg.querySelector(".cursor"), x = svg.place(n * setting.dt);
      cursor.replaceChildren();
      put(cursor, "line", { x1: x, x2: x, y1: TOP, y2: BOTTOM });
    }
    const told = NAMES.map((name, i) => {
      const [a, b, g] = [shown.one[n][i], shown.two[n][i], shown.gain[n][i]].map((s) => (s === null ? "–" : short(s)));
      return `${name} ${a} → ${b} (${g} %)`;
    });
    node("read").textContent = filled("Scan {k}, {t} s: {values}", { k: n + 1, t: short(n * setting.dt), values: told.join(HAS_DECIMAL_COMMA ? "; " : ", ") });
  }

  function readable(svg) {
    const under = (event) => {
      const box = svg.getBoundingClientRect(), x = ((event.clientX - box.left) * 420) / box.width;
      const n = Math.round(((x - LEFT) / (RIGHT - LEFT)) * (setting.k - 1));
      point(Math.min(Math.max(n, 0), setting.k - 1));
    };
    svg.addEventListener("pointermove", under);
    svg.addEventListener("pointerdown", under);
    svg.addEventListener("keydown", (event) => {
      const to = { ArrowRight: scan + 1, ArrowLeft: scan - 1, Home: 0, End: setting.k - 1 }[event.key];
      if (to === undefined) return;
      event.preventDefault();
      point(Math.min(Math.max(to, 0), setting.k - 1));
    });
  }

  // ---- the inputs ----
  const whole = (name) => name === "k";
  const toSlider = (name) => (STEPS * Math.log(setting[name] / ALLOWED[name][0])) / Math.log(ALLOWED[name][1] / ALLOWED[name][0]);
  function fromSlider(name, place) {
    const value = ALLOWED[name][0] * (ALLOWED[name][1] / ALLOWED[name][0]) ** (place / STEPS);
    return whole(name) ? Math.round(value) : Number(value.toPrecision(3));
  }

  function fill(except) {
    for (const name of Object.keys(ALLOWED)) {
      if (except !== node(name)) node(name).value = String(setting[name]);
      if (except !== node(`${name}-slider`)) node(`${name}-slider`).value = toSlider(name);
      node(`${name}-slider`).setAttribute("aria-valuetext", String(setting[name]));
      node(name).setAttribute("aria-invalid", "false");
    }
  }

  function changed(except) {
    fill(except);
    redraw();
    history.replaceState(null, "", radar.address());
  }

  for (const name of Object.keys(ALLOWED)) {
    const slider = node(`${name}-slider`), field = node(name);
    Object.assign(slider, { min: 0, max: STEPS, step: 1 });
    slider.addEventListener("input", () => { setting[name] = fromSlider(name, Number(slider.value)); changed(slider); });
    field.addEventListener("input", () => {
      const value = radar.parsed(name, field.value);
      if (value !== null) { setting[name] = value; changed(field); }
      field.setAttribute("aria-invalid", String(value === null));
    });
    field.title = filled("from {low} to {high}", { low: localNumeral(String(ALLOWED[name][0])), high: localNumeral(String(ALLOWED[name][1])) });
  }
  for (const one of JSON.parse(node("data").textContent)) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = one.name;
    button.addEventListener("click", () => {
      for (const name of ["r", "v", "dt", "dm"]) setting[name] = Math.min(Math.max(one[name], ALLOWED[name][0]), ALLOWED[name][1]);
      changed(null);
    });
    node("radars").append(button);
  }
  for (const id of ["sigma-0", "sigma-1", "sigma-2", "gain"]) readable(node(id));
  const first = JSON.parse(node("data").textContent)[0];
  if (first) for (const name of ["r", "v", "dt", "dm"]) setting[name] = radar.parsed(name, first[name]) ?? setting[name];
  addEventListener("hashchange", () => { radar.fromAddress(); changed(null); });
  radar.fromAddress();
  changed(null);
})();
