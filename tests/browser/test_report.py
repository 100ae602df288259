"""report.html in Chromium: it loads offline without a word in the console; sorting, titles of markers, themes work."""

import base64
import csv
import re

import pytest

from radarsim.api import run

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
    if (e.closest("svg.figure")) continue; // its colours: tests/report/test_colours.py
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


TITLES = """
[...document.querySelectorAll('#figure-sigma_r .values > *')].filter((e) => e.checkVisibility())
  .map((e) => e.querySelector('title').textContent)
"""


def test_a_marker_under_the_pointer_has_the_time_value_and_interval_of_the_table(page, results):
    page.open(results / "rls2" / "report.html")
    rows = list(csv.DictReader((results / "rls2" / "curves.csv").read_text().splitlines()))
    expected = {(row["filter"], float(row["t_s"])): row for row in rows if row["component"] == "r"}
    read = 0
    for text in page.evaluate(TITLES):
        name, time, sigma = text.split("\n")
        if name == "floor":
            continue
        row = expected[name, float(re.fullmatch(r"time from the first plot, s: ([\d.]+)", time)[1])]
        numbers = re.fullmatch(r"σ of r, m: ([\d.]+) \[([\d.]+), ([\d.]+)\], exact ([\d.]+)", sigma).groups()
        for number, column in zip(numbers, ("sigma", "sigma_lo", "sigma_hi", "exact_sigma"), strict=True):
            assert float(number) == pytest.approx(float(row[column]), rel=0.5e-3)  # four digits
        read += 1
    assert read == 2 * 15
    x, y = page.place("#figure-sigma_r .values > *", 3)
    under = f"document.elementFromPoint({x}, {y}).querySelector('title').textContent"
    assert page.evaluate(under) == page.evaluate(TITLES)[3]


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
    figure = "getComputedStyle(document.querySelector('svg.figure')).filter"
    assert (page.evaluate(figure) != "none") == dark
    page.click("#theme")
    assert page.evaluate(shade) == colours[not dark]
    assert (page.evaluate(figure) == "none") == dark


@pytest.mark.parametrize("dark", THEMES)
@pytest.mark.parametrize("name", ["rls2/report.html", "range_doppler/report.html", "index.html"])
def test_names_and_contrast(page, results, name, dark):
    page.open(results / name, dark=dark)
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert page.evaluate(NAMES) == []
    assert page.evaluate(CONTRAST) == []


SCALES = """
[...document.querySelectorAll('svg.figure')].map((s) => s.getBoundingClientRect().width / s.viewBox.baseVal.width)
"""


@pytest.mark.parametrize("name", ["rls2/report.html", "range_doppler/report.html", "index.html"])
def test_a_phone_reads_it_without_scrolling_sideways(page, results, name):
    page.open(results / name, width=390, height=800)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    scales = page.evaluate(SCALES)
    assert all(7 * scale >= 9 for scale in scales)  # pixels of a figure's smallest letters but for indices


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
    """A page of each study, of few realisations."""
    out = tmp_path_factory.mktemp("every")
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
        "(({top, bottom}) => [top, bottom])(document.querySelector('svg.figure').getBoundingClientRect())"
    )
    assert height - top > min(0.6 * (bottom - top), 0.3 * height)  # most of it, or of its first panels
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
    const figure = e.closest("svg.figure"), size = parseFloat(getComputedStyle(e).fontSize);
    return figure ? size * figure.getBoundingClientRect().width / figure.viewBox.baseVal.width : size;
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
