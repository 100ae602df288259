"use strict";
// What a reader does with the page: sort tables, unfold an answer, choose a light or a dark page.
const MIN_OPEN_WIDTH = 1000, MAX_OPEN_LETTERS = 600; // of a window and of a folded answer, to show it at once
const HAS_DECIMAL_COMMA = document.documentElement.lang !== "en";
const TRANSLATIONS = JSON.parse(document.getElementById("words").textContent);
const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

// A text of this script in the page's language.
function translated(text) {
  return TRANSLATIONS[text] || text;
}

// The text of a number as the page's language writes it.
function localNumeral(text) {
  const withMinus = text.replace("-", "−");
  return HAS_DECIMAL_COMMA ? withMinus.replace(".", ",") : withMinus;
}

function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
}

// The theme that the browser keeps for these pages, after storing one if it is given.
function storedTheme(theme) {
  try {
    if (theme) localStorage.setItem("radarsim-theme", theme);
    return localStorage.getItem("radarsim-theme");
  } catch {
    return null; // a browser may keep nothing for a page from a disk
  }
}

function switchThemes(button) {
  const stored = storedTheme();
  if (stored === "dark" || stored === "light") document.documentElement.dataset.theme = stored;
  const label = () => { button.textContent = translated(isDark() ? "Light page" : "Dark page"); };
  button.hidden = false;
  button.addEventListener("click", () => {
    const theme = isDark() ? "light" : "dark";
    document.documentElement.dataset.theme = storedTheme(theme) || theme;
    label();
  });
  label();
}

// The number in a cell's text: 1,234.5, or 1 234,5 where the language writes so, and 1.2·10⁻⁷.
function parsedNumber(text) {
  let plain = text.replaceAll("−", "-").replace("∞", "Infinity").replace(/[\u00a0\u202f]/g, "");
  plain = HAS_DECIMAL_COMMA ? plain.replaceAll(",", ".") : plain.replaceAll(",", "");
  const exponent = (all, times, sign, digits) =>
    `${times ? "" : "1"}e${sign ? "-" : ""}${[...digits].map((digit) => SUPERSCRIPTS.indexOf(digit)).join("")}`;
  plain = plain.replace(/(·)?10(⁻)?([⁰¹²³⁴⁵⁶⁷⁸⁹]+)$/, exponent);
  return plain.trim() === "" ? NaN : Number(plain);
}

function makeSortable(table) {
  const body = table.tBodies[0], groups = [...table.tBodies];
  for (const [column, head] of [...table.tHead.rows[0].cells].entries()) {
    const button = document.createElement("button");
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
        const x = text(a), y = text(b), m = parsedNumber(x), n = parsedNumber(y);
        if (!x || !y) return Number(!x) - Number(!y); // empty cells stay below
        const order = Number.isNaN(m) || Number.isNaN(n) ? x.localeCompare(y, "en", { numeric: true }) : m - n;
        return up ? order : -order;
      };
      if (groups.length > 1) table.append(...groups.sort((a, b) => compare(a.rows[0], b.rows[0])));
      else body.append(...[...body.rows].sort(compare));
    });
  }
}

for (const details of document.querySelectorAll(".answer details, details.warning")) {
  details.open = innerWidth >= MIN_OPEN_WIDTH && details.textContent.length < MAX_OPEN_LETTERS;
}
for (const table of document.querySelectorAll("table.sortable")) makeSortable(table);
const themeButton = document.getElementById("theme");
if (themeButton) switchThemes(themeButton);
