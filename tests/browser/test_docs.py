"""The built pages in Chromium: nothing cut from 360 px on, formulas and pictures drawn, a search for users first."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow
PAGES = (
    *("README", "docs/README", "docs/tutorial", "docs/range_doppler", "docs/multimodel", "docs/discriminator"),
    *("docs/claims", "docs/chart", "docs/pulses_to_tracks", "docs/reference/yaml", "docs/reference/commands"),
)
# What sticks out of the window on the right and is not inside something that scrolls by itself.
CUT = """[...document.querySelectorAll('article *')].filter(e => {
  const right = e.getBoundingClientRect().right;
  if (right <= innerWidth + 1 || !e.getClientRects().length) return false;
  for (let p = e; p && p.tagName !== 'ARTICLE'; p = p.parentElement)
    if (['auto', 'scroll', 'hidden'].includes(getComputedStyle(p).overflowX)) return false;
  return true;
}).map(e => `${e.tagName} ${e.textContent.slice(0, 60)}`)"""


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The documentation as `make docs` builds it."""
    if find_spec("sphinx") is None:
        pytest.skip("no Sphinx here: pip install 'radarsim[docs]'")
    out = tmp_path_factory.mktemp("docs")
    command = [sys.executable, "-m", "sphinx", "-q", "-c", "docs", "-d", str(out / "trees"), ".", str(out / "html")]
    subprocess.run(command, cwd=ROOT, check=True)
    return out / "html"


@pytest.mark.parametrize("width", [360, 800, 1400])
@pytest.mark.parametrize("name", PAGES)
def test_nothing_is_cut(page, built, name, width):
    page.open(built / f"{name}.html", width=width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(CUT) == []


def test_formulas_and_pictures_are_drawn_offline(page, built):
    page.open(built / "docs/range_doppler.html")
    assert page.evaluate("document.querySelectorAll('math').length") > 15
    tall = "Math.max(...[...document.querySelectorAll('div.formula math')].map(e => e.getBoundingClientRect().height))"
    assert page.evaluate(tall) > 25  # fractions stand one above the other
    broken = "[...document.images].filter(i => !i.complete || !i.naturalWidth).map(i => i.src)"
    assert page.evaluate(broken) == []
    assert page.evaluate("document.querySelectorAll('article img').length") >= 7
    assert not [address for address in page.requested() if not address.startswith("file:")]


@pytest.mark.parametrize("words", ["own radar", "sigma", "track", "figures"])
def test_a_search_lists_pages_for_users_first(page, built, words):
    page.open(built / "search.html")
    page.evaluate(f"location.search = '?q=' + encodeURIComponent({words!r})")
    page.wait("Page.loadEventFired")
    found = page.evaluate(
        "new Promise(done => { let left = 200; (function look() {"
        " const links = [...document.querySelectorAll('ul.search li a')].map(a => a.getAttribute('href'));"
        " const over = document.querySelector('.search-summary')?.textContent.includes('found');"
        " if ((links.length > 5 && over) || !left--)"
        "   done(links); else setTimeout(look, 50); })(); })"
    )
    behind = [("reference/modules" in link or "reference/python" in link) for link in found]
    assert len(found) > 5
    assert not any(behind[:5])
    assert behind == sorted(behind)  # and all of them behind all others
