"""report.html in Chromium: it loads offline without a word in the console; sorting, hovering, switching work."""

import base64
import csv
import math
import re

import numpy as np
import pytest

from radarsim.app import run
from radarsim.report import figures

pytestmark = pytest.mark.slow
LARGEST = 1_500_000  # bytes
SOONEST_S = 1.0
THEMES = [False, True]

# Text against what lies under it, by WCAG 2.2: whatever is below 4.5 : 1, or 3 : 1 where large.
CONTRAST = """
(() => {
  const parse = (c) => (c.match(/[\\d.]+/g) || []).map(Number);
  const light = ([r, g, b]) => [r, g, b].map((v) => v / 255)
    .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((s, v, i) => s + v * [0.2126, 0.7152, 0.0722][i], 0);
  const under = (e) => {
    for (let n = e; n; n = n.parentElement) {
      const c = parse(getComputedStyle(n).backgroundColor);
      if (c.length === 3 || c[3] > 0) return c;
    }
    return parse(getComputedStyle(document.body).backgroundColor);
  };
  const bad = [];
  for (const e of document.querySelectorAll("body *")) {
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || !e.checkVisibility() || ["SCRIPT", "STYLE"].includes(e.tagName)) continue;
    const style = getComputedStyle(e);
    const ink = parse(e.closest("svg") ? style.fill : style.color);
    const [a, b] = [light(ink), light(under(e))].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    const large = parseFloat(style.fontSize) >= 24;
    if (ratio < (large ? 3 : 4.5)) bad.push([e.tagName, e.textContent.slice(0, 30), ratio]);
  }
  return bad;
})()
"""

# Everything that can be used has a name; every picture has words; names are not used twice; headings do not skip.
NAMES = """
(() => {
  const bad = [];
  const name = (e) => (e.getAttribute("aria-label") || e.textContent || "").trim();
  for (const e of document.querySelectorAll("button, a, [tabindex], [role=img], summary")) {
    if (!name(e)) bad.push(e.outerHTML.slice(0, 80));
  }
  for (const e of document.querySelectorAll("svg")) {
    if (e.closest("svg.chart")) continue;
    if (!e.hasAttribute("aria-hidden") && !e.getAttribute("aria-label")) bad.push(e.outerHTML.slice(0, 80));
  }
  const ids = [...document.querySelectorAll("[id]")].map((e) => e.id);
  if (new Set(ids).size !== ids.length) bad.push("ids used twice");
  for (const a of document.querySelectorAll("a[href^='#']")) {
    if (!document.getElementById(a.hash.slice(1))) bad.push(a.hash);
  }
  let last = 1;
  for (const h of document.querySelectorAll("h1, h2, h3, h4")) {
    const level = Number(h.tagName[1]);
    if (level > last + 1) bad.push(`heading ${h.textContent} skips a level`);
    last = level;
  }
  for (const t of document.querySelectorAll("th")) if (!t.scope) bad.push(`th without scope: ${t.textContent}`);
  if (!document.documentElement.lang || !document.title) bad.push("no language or title");
  return bad;
})()
"""


@pytest.mark.parametrize("name", ["rls2", "range_doppler"])
def test_loads_offline_in_under_a_second_without_a_complaint(page, results, name):
    report = results / name / "report.html"
    assert report.stat().st_size < LARGEST
    times = []
    for _ in range(5):
        page.open(report)
        assert page.complaints() == []
        assert page.requested() == [report.resolve().as_uri()]
        times.append(page.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd") / 1000)
    assert min(times) < SOONEST_S, times


SIGMA = "#figure-sigma_r"  # the figure of both filters


def first_panel(page, figure="figure"):
    """Middle of the plot of a figure's first panel, and its width, in the window."""
    x, y = page.place(f"{figure} svg.chart")
    width = page.evaluate(f"document.querySelector('{figure} svg.chart').getBoundingClientRect().width")
    return x, y, width


def test_hovering_shows_the_value_and_its_interval(page, results):
    page.open(results / "rls2" / "report.html")
    x, y, width = first_panel(page, SIGMA)
    page.move(x + 0.05 * width, y)
    tip = page.evaluate(f"document.querySelector('{SIGMA} .tip').innerText")
    assert page.evaluate(f"!document.querySelector('{SIGMA} .tip').hidden")
    assert "time from the first plot, s: " in tip
    at = float(re.search(r"s: ([\d.]+)", tip)[1])
    rows = [row.split(",") for row in (results / "rls2" / "curves.csv").read_text().splitlines()[1:]]
    for row in rows:
        if row[2] == "r" and float(row[5]) == at:
            told = re.search(
                rf"^{re.escape(row[1])}: ([\d.]+) \[([\d.]+), ([\d.]+)\] m, exact ([\d.]+)$", tip, re.MULTILINE
            )
            half = (float(row[9]) - float(row[8])) / 2
            for number, i in zip(told.groups(), (7, 8, 9, 13), strict=True):
                assert float(number) == pytest.approx(float(row[i]), rel=0, abs=shown(float(row[i]), half))
    page.move(5, 5)
    assert page.evaluate(f"document.querySelector('{SIGMA} .tip').hidden")


def shown(value, half):
    """How far from a value its tip may be: two figures of the half-width are shown, of numbers with five digits."""
    return 0.05 * half + 0.5e-4 * abs(value)


READING = """
(() => {
  const svg = document.querySelector('#figure-gain_r svg.chart'), axis = svg.getBoundingClientRect();
  return [axis.x, axis.y, axis.width, axis.height];
})()
"""


def test_every_value_of_a_tip_is_of_the_time_that_it_names(page, results):
    """Radars with scans at other times: what is read beside the pointer's time names its own."""
    page.open(results / "range_doppler" / "report.html", width=1400, height=1200)
    page.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
    page.evaluate("document.querySelector('#figure-gain_r').scrollIntoView()")
    rows = list(csv.DictReader((results / "range_doppler" / "gains.csv").read_text().splitlines()))
    own = [row for row in rows if row["component"] == "r" and " " not in row["case"] and row["gain_percent"]]
    x, y, width, height = page.evaluate(READING)
    apart = 0
    for share in np.linspace(0.2, 0.8, 40):
        page.move(x + share * width, y + height / 2)
        tip = page.evaluate("document.querySelector('#figure-gain_r .tip').innerText")
        at = re.search(r"time from the first plot, s: ([\d.]+)", tip)[1]
        told = re.findall(r"^(RLS \d)(?: \(([\d.]+) s\))?: (−?[\d.]+)", tip, re.MULTILINE)
        assert told
        for name, other, value in told:
            t_s, stem = float(other or at), name.lower().replace(" ", "")
            row = next(one for one in own if one["case"] == stem and float(one["t_s"]) == t_s)
            half = (float(row["gain_hi"]) - float(row["gain_lo"])) / 2
            gain = float(row["gain_percent"])
            assert float(value.replace("−", "-")) == pytest.approx(gain, rel=0, abs=shown(gain, half))
            apart += bool(other)
    assert apart  # else nothing was shown


def test_the_keyboard_reads_values_too(page, results):
    page.open(results / "rls2" / "report.html")
    page.evaluate("document.querySelector('svg.chart').focus()")
    told = []
    for _ in range(3):
        page.key("ArrowRight")
        told.append(page.evaluate("document.querySelector('figure .tip div').innerText"))
    assert [text.split(": ")[1] for text in told] == ["0", "10", "20"]
    page.key("Escape")
    assert page.evaluate("document.querySelector('figure .tip').hidden")


def test_curves_are_switched_off_and_on(page, results):
    page.open(results / "rls2" / "report.html")
    seen = f"[...document.querySelectorAll('{SIGMA} [data-g=\"0\"]')].map((e) => e.style.display)"
    page.click(f"{SIGMA} .end text")
    assert page.evaluate(f"[{seen}].flat().filter((d) => d === 'none').length") == 1
    assert page.evaluate(f"document.querySelector('{SIGMA} .switches button').getAttribute('aria-pressed')") == "false"
    x, y, width = first_panel(page, SIGMA)
    page.move(x + 0.05 * width, y)
    tip = page.evaluate(f"document.querySelector('{SIGMA} .tip').innerText")
    assert "r+Vr: " in tip
    assert not re.search(r"^r: ", tip, re.MULTILINE)
    page.evaluate(f"document.querySelector('{SIGMA} .switches button').focus()")  # the keyboard's way to the same
    assert page.evaluate(f"document.querySelector('{SIGMA} .switches').getBoundingClientRect().height") > 10
    page.evaluate("document.activeElement.click()")
    assert page.evaluate(f"{seen}.every((d) => d === '')")


def test_tables_are_sorted_by_number_and_by_word(page, results):
    page.open(results / "rls2" / "report.html")
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")

    def column(n):
        cells = f"[...document.querySelectorAll('#table-curves tbody tr')].map((r) => r.cells[{n}].textContent)"
        return page.evaluate(cells)

    names = page.evaluate("[...document.querySelectorAll('#table-curves th')].map((h) => h.textContent.trim())")
    sigma = names.index("sigma")
    before = column(sigma)
    page.click(f"#table-curves th:nth-child({sigma + 1}) button")
    rising = [float(text) for text in column(sigma)]
    assert rising == sorted(rising)
    assert page.evaluate("document.querySelectorAll('thead th button sub').length")  # formulas stay such
    assert sorted(before) == sorted(column(sigma))
    page.click(f"#table-curves th:nth-child({sigma + 1}) button")
    assert [float(text) for text in column(sigma)] == rising[::-1]
    assert page.evaluate(f"document.querySelectorAll('#table-curves th')[{sigma}].ariaSort") == "descending"
    page.click(f"#table-curves th:nth-child({names.index('component') + 1}) button")
    words = column(names.index("component"))
    assert words == sorted(words, key=str.lower)


@pytest.mark.parametrize("dark", THEMES)
def test_the_theme_follows_the_system_until_switched(page, results, dark):
    page.open(results / "rls2" / "report.html", dark=dark)
    shade = "getComputedStyle(document.body).backgroundColor"
    colours = ["rgb(255, 255, 255)", "rgb(15, 20, 25)"]
    assert page.evaluate(shade) == colours[dark]
    curve = "getComputedStyle(document.querySelector('svg.chart [data-g]')).color"
    first = page.evaluate(curve)
    page.click("#theme")
    assert page.evaluate(shade) == colours[not dark]
    assert page.evaluate(curve) != first


@pytest.mark.parametrize("dark", THEMES)
@pytest.mark.parametrize("name", ["rls2/report.html", "range_doppler/report.html", "index.html"])
def test_names_and_contrast(page, results, name, dark):
    page.open(results / name, dark=dark)
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert page.evaluate(NAMES) == []
    assert page.evaluate(CONTRAST) == []


@pytest.mark.parametrize("name", ["rls2/report.html", "range_doppler/report.html", "index.html"])
def test_a_phone_reads_it_without_scrolling_sideways(page, results, name):
    page.open(results / name, width=390, height=800)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    widths = page.evaluate("[...document.querySelectorAll('svg.chart')].map((s) => s.getBoundingClientRect().width)")
    assert all(width / 440 * 13.5 >= 10 for width in widths)  # pixels of a chart's letters


@pytest.mark.parametrize("kind", ["#further figure", "#claim-P1\\\\.18", "#table-curves"])
def test_a_link_unfolds_what_it_leads_to(page, results, kind):
    page.open(results / "range_doppler" / "report.html")
    anchor = page.evaluate(f"document.querySelector('{kind}').id")
    seen = f"document.getElementById('{anchor}').checkVisibility()"
    folded = not page.evaluate(seen)
    assert folded == (not anchor.startswith("claim"))
    page.evaluate(f"document.documentElement.style.scrollBehavior = 'auto'; location.hash = '{anchor}'")
    page.evaluate("new Promise(requestAnimationFrame)")
    assert page.evaluate(seen)
    assert -2 < page.evaluate(f"document.getElementById('{anchor}').getBoundingClientRect().top") < 300


STUDIES = (  # a config of each study, and of each part of the sonar's
    *("rls2", "range_doppler", "multimodel_1hz", "sonar_asynchronous", "sonar_manoeuvre", "sonar_clutter"),
    *("discriminator", "pulses", "ambiguous", "multimodel", "rls2_manoeuvres"),
)
LONGEST = ("multimodel_rules", "manoeuvre_variance", "sonar_clutter_ends")  # in print; the last has a warning


@pytest.fixture(scope="session")
def every(tmp_path_factory):
    """A page of each study, of few realisations; no figure is written to a file."""
    out = tmp_path_factory.mktemp("every")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "save", lambda *_, **__: {})
        for name in (*STUDIES, *LONGEST):
            run.run(name, realisations=200, out=out)
    return out


@pytest.mark.parametrize(("width", "height"), [(360, 800), (800, 1000), (1400, 900)])
@pytest.mark.parametrize("name", STUDIES)
def test_the_answer_and_its_figure_are_on_the_first_screen(page, every, name, width, height):
    report = every / name / "report.html"
    assert report.stat().st_size < LARGEST
    page.open(report, width=width, height=height)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate("document.querySelector('.answer').getBoundingClientRect().bottom") < 0.6 * height
    top, bottom = page.evaluate(
        "(({top, bottom}) => [top, bottom])(document.querySelector('svg.chart').getBoundingClientRect())"
    )
    assert height - top > 0.6 * (bottom - top)  # most of its first panel
    assert page.complaints() == []


@pytest.mark.parametrize("dark", THEMES)
@pytest.mark.parametrize("name", STUDIES[2:])
def test_names_and_contrast_of_every_study(page, every, name, dark):
    page.open(every / name / "report.html", dark=dark)
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert page.evaluate(NAMES) == []
    assert page.evaluate(CONTRAST) == []


SMALLEST = """
Math.min(...[...document.querySelectorAll("main *")].filter((e) => e.checkVisibility()
    && e.getBoundingClientRect().width
    && [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim())).map((e) => {
    const chart = e.closest("svg.chart"), size = parseFloat(getComputedStyle(e).fontSize);
    return chart ? size * chart.getBoundingClientRect().width / chart.viewBox.baseVal.width : size;
  }))
"""
FOLDED = """
[...document.querySelectorAll(".answer p, .warning p")].filter((e) => !e.checkVisibility()).map((e) => e.textContent)
"""
PAPER_MM, MARGIN_MM, PX_MM = (210, 297), 10.0, 96 / 25.4  # A4


@pytest.mark.parametrize("name", [*STUDIES, *LONGEST])
def test_every_study_prints_on_two_pages_in_letters_that_are_read(page, every, name):
    """With the whole answer and every warning."""
    wide = PAPER_MM[0] - 2 * MARGIN_MM
    page.open(every / name / "report.html", width=int(wide * PX_MM), media="print")
    assert page.evaluate(FOLDED) == []
    assert name != LONGEST[-1] or page.evaluate("document.querySelectorAll('.warning p').length") > 0
    assert page.evaluate(SMALLEST) * 0.75 >= 5  # points
    paper = dict(zip(("paperWidth", "paperHeight"), (mm / 25.4 for mm in PAPER_MM), strict=True))
    printed = base64.b64decode(page.call("Page.printToPDF", **paper)["data"])
    assert len(printed) > 20_000
    assert len(re.findall(rb"/Type\s*/Page[^s]", printed)) <= 2


def tip(page):
    """What the first figure's reading says; None where it is not shown."""
    return page.evaluate(
        "(() => { const t = document.querySelector('.tip'); return t.hidden ? null : t.innerText; })()"
    )


def test_a_reading_is_kept_by_a_click_and_by_a_touch_and_lies_on_no_curve(page, results):
    page.open(results / "range_doppler" / "report.html")
    page.click("svg.chart")
    kept = tip(page)
    page.move(5, 5)
    assert tip(page) == kept
    over = "[...document.querySelectorAll('.tip, svg.chart')].slice(0, 2).map((e) => e.getBoundingClientRect())"
    apart = f"(([a, b]) => a.bottom <= b.top || b.bottom <= a.top)({over})"
    assert page.evaluate(apart)
    page.click("svg.chart")
    page.move(5, 5)
    assert tip(page) is None
    x, y = page.place("svg.chart")
    page.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
    page.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    assert tip(page) == kept


def test_a_reading_tells_every_curve_the_highest_first(page, results):
    page.open(results / "range_doppler" / "report.html")
    nth = page.evaluate("[...document.querySelectorAll('figure')].findIndex((f) => f.id === 'figure-gain_r')")
    page.evaluate(f"document.querySelectorAll('figure')[{nth}].querySelector('svg.chart').id = 'here'")
    page.click("#here")
    told = page.evaluate(f"document.querySelectorAll('figure')[{nth}].querySelector('.tip').innerText")
    values = [float(v) for v in re.findall(r"^RLS \d(?: \(.+\))?: ([\d.]+)", told, re.MULTILINE)]
    assert len(values) >= 3
    assert values == sorted(values, reverse=True)


TICKS = """
[...document.querySelector('svg.chart').querySelectorAll(':scope > text')]
  .filter((t) => t.style.display !== 'none' && !t.classList.contains('lab'))
  .map((t) => [t.textContent, Number(t.getAttribute('x')), Number(t.getAttribute('y'))])
"""
# Two roundings to a tenth, and of numbers to five digits, on less than 200 units.
REDRAWN = 0.1 + 0.5e-4 * 200
CURVES = "[...document.querySelectorAll('svg.chart')[0].querySelectorAll('path.l')].map((p) => p.getAttribute('d'))"


def ticks(page):
    """Values of the first panel's ticks on x and on y."""
    found = page.evaluate(TICKS)
    lowest = max(y for _, _, y in found)
    numbers = [(float(text.replace("−", "-")), y == lowest) for text, _, y in found]
    return [v for v, on_x in numbers if on_x], [v for v, on_x in numbers if not on_x]


def points(path):
    """The points of a path that a script has drawn, or the page's own."""
    x = y = 0.0
    found = []
    for kind, a, b in re.findall(r"([MLl])(-?[\d.e]+) (-?[\d.e]+)", path):
        x, y = (x + float(a), y + float(b)) if kind == "l" else (float(a), float(b))
        found.append((x, y))
    return found


@pytest.mark.parametrize("touch", [False, True])
def test_a_drag_looks_closer_and_a_double_click_at_all_again(page, results, touch):
    page.open(results / "rls2" / "report.html")
    assert ticks(page)[0] == [0, 20, 40, 60, 80, 100, 120, 140]
    before = page.evaluate(CURVES)
    x, y, width = first_panel(page)
    page.drag((x - 0.1 * width, y), (x + 0.1 * width, y + 2), touch)
    seen, _ = ticks(page)
    assert 5 < seen[0] < seen[-1] < 130
    assert seen[-1] - seen[0] < 35
    assert page.evaluate("getComputedStyle(document.querySelector('button.back')).display") != "none"
    page.click("svg.chart", times=2)
    assert ticks(page)[0] == [0, 20, 40, 60, 80, 100, 120, 140]
    for own, drawn in zip(before, page.evaluate(CURVES), strict=True):
        assert points(drawn) == [pytest.approx(point, rel=0, abs=REDRAWN) for point in points(own)]
    assert page.evaluate("document.querySelector('button.back').hidden")
    assert page.complaints() == []


def test_a_drag_up_and_across_marks_both_axes_and_escape_takes_it_back(page, results):
    page.open(results / "rls2" / "report.html")
    x, y, width = first_panel(page)
    whole = ticks(page)
    page.drag((x - 0.1 * width, y - 40), (x + 0.1 * width, y + 40))
    (low, *_, high), (bottom, *_, top) = ticks(page)
    assert high - low < whole[0][-1] / 3
    assert top - bottom < (whole[1][-1] - whole[1][0]) / 2
    page.evaluate("document.querySelector('svg.chart').focus()")
    page.key("Escape")
    assert ticks(page) == whole


def test_the_keyboard_looks_closer_goes_along_and_back(page, results):
    page.open(results / "rls2" / "report.html")
    page.evaluate("document.querySelector('svg.chart').focus()")
    whole = ticks(page)[0]
    for _ in range(8):
        page.key("ArrowRight")
    assert "s: 70" in tip(page)
    page.key("+")
    page.key("+")
    near = ticks(page)[0]
    assert near[-1] - near[0] < 0.3 * whole[-1]
    assert near[0] < 70 < near[-1]
    page.key("ArrowRight", shift=True)
    assert ticks(page)[0][0] > near[0]
    for _ in range(7):
        page.key("ArrowRight")
    assert "s: 140" in tip(page)
    assert ticks(page)[0][-1] >= 140  # the view goes with the reading
    page.key("Enter")
    page.evaluate("document.querySelector('svg.chart').blur()")
    assert "s: 140" in tip(page)
    page.evaluate("document.querySelector('svg.chart').focus()")
    page.key("0")
    assert ticks(page)[0] == whole


def test_axes_fit_the_curves_that_are_left(page, results):
    page.open(results / "range_doppler" / "report.html")
    before, whole = ticks(page), page.evaluate(CURVES)
    nth = page.evaluate(
        "[...document.querySelectorAll('.switches')[0].querySelectorAll('button')].map((b) => b.textContent)"
    )
    for name in ("RLS 4", "RLS 5"):
        page.click("figure .end text", nth.index(name))
    assert ticks(page)[1][-1] < before[1][-1]
    for name in ("RLS 4", "RLS 5"):
        page.click("figure .end text", nth.index(name))
    assert ticks(page) == before
    for own, drawn in zip(whole, page.evaluate(CURVES), strict=True):
        assert points(drawn) == [pytest.approx(point, rel=0, abs=REDRAWN) for point in points(own)]


def test_axes_are_made_logarithmic_where_that_serves(page, results, tmp_path):
    run.run("rls2", realisations=200, overrides=["figures=[gain_r]"], out=tmp_path)
    page.open(tmp_path / "rls2" / "report.html")
    assert page.evaluate("document.querySelector('#axes').hidden")  # percentages go below zero
    page.open(results / "range_doppler" / "report.html")
    y = (
        "[...document.querySelectorAll('#figure-sigma_Vr svg.chart')[0].querySelectorAll('path.l')]"
        ".map((p) => p.getAttribute('d'))"
    )
    gains = "[...document.querySelectorAll('#figure-gain_r path.l')].map((p) => p.getAttribute('d'))"
    linear, kept = page.evaluate(y), page.evaluate(gains)
    page.click("#axes")
    assert page.evaluate("document.querySelector('#axes').textContent") == "Linear axes"
    assert page.evaluate(gains) == kept
    data = "JSON.parse(document.querySelector('#figure-sigma_Vr script').textContent)[0].lines[0].y"
    values = [value for value in page.evaluate(data) if value is not None]
    places = [at for _, at in points(page.evaluate(y)[0])]
    slope = (places[-1] - places[0]) / (math.log(values[-1]) - math.log(values[0]))
    for value, at in zip(values, places, strict=True):
        # Each place, the first and both that make the slope are at tenths.
        wanted = places[0] + slope * (math.log(value) - math.log(values[0]))
        assert at == pytest.approx(wanted, rel=0, abs=4 * 0.05)
    page.click("#axes")
    for own, drawn in zip(linear, page.evaluate(y), strict=True):
        assert points(drawn) == [pytest.approx(point, rel=0, abs=REDRAWN) for point in points(own)]


@pytest.mark.parametrize("width", [360, 800, 1400])
def test_it_is_whole_at_every_width_and_in_forced_colours(page, results, width):
    page.open(results / "range_doppler" / "report.html", width=width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.call("Emulation.setEmulatedMedia", features=[{"name": "forced-colors", "value": "active"}])
    assert page.evaluate("matchMedia('(forced-colors: active)').matches")
    assert page.complaints() == []


def test_claims_have_an_address_and_lead_to_their_table_and_figure(page, results):
    page.open(results / "range_doppler" / "report.html")
    links = page.evaluate("[...document.querySelectorAll('#claims ~ p a')].map((a) => a.getAttribute('href'))")
    assert links == ["claims.csv"]
    assert page.evaluate("document.querySelectorAll('tr[id^=claim-P1]').length") > 10
    shown = page.evaluate("document.querySelector('#figure-sigma_r .links a').getAttribute('href')")
    assert (results / "range_doppler" / shown).is_file()
    own = "[...document.querySelectorAll('#claim-P1\\\\.4 .links a')].map((a) => a.getAttribute('href'))"
    assert page.evaluate(own) == ["#figure-gain_r", "gains.csv"]
    back = page.evaluate("[...document.querySelectorAll('#figure-gain_r .links a')].map((a) => a.getAttribute('href'))")
    assert {"gains.csv", "#claim-P1.4"} <= set(back)
    assert "#claim-P1.6" not in back  # which is of the velocity


def test_the_index_leads_to_every_run(page, results):
    page.open(results / "index.html")
    assert page.complaints() == []
    names = page.evaluate("[...document.querySelectorAll('#runs td a')].map((a) => a.getAttribute('href'))")
    assert names == ["range_doppler/report.html", "rls2/report.html"]  # newest first
    page.click("#runs td a")
    page.wait("Page.loadEventFired")
    assert page.evaluate("document.title") == "range_doppler – radarsim"
