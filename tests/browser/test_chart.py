"""The live page of the chart in Chromium: its recursion against Python's, keyboard, touch, address, themes, phone."""

import json

import numpy as np
import pytest

from radarsim.api.doppler_chart import chart
from radarsim.studies.range_doppler import closed_form, error_recursion, filter_design
from radarsim.studies.range_doppler.error_recursion import Plots
from tests.browser.test_report import CONTRAST, NAMES
from tests.tolerances import assert_rounded

pytestmark = pytest.mark.slow
KEYS = ("r", "v", "dt", "dm")
STATED = 1e-9  # to which the page of the chart says that σ agree


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """The page's file: the paper's five radars to begin from."""
    return chart(out=tmp_path_factory.mktemp("chart"), figures=False).folder / "chart.html"


def sigmas(observes, start, r, v, dt, dm, k):
    """σ (k, 3) by the package, not-a-number where there is no estimate."""
    sigma = np.array([r, v])
    design = filter_design.design(observes, start, dm, sigma, dt, k)
    _, S = error_recursion.error_recursion(design, Plots(sigma), np.zeros((k, 3)), dt)
    return np.where(design.available, np.sqrt(np.diagonal(S, axis1=1, axis2=2)), np.nan)


def field(page, name, text):
    """Write into a field of numbers as a user does."""
    page.evaluate(f"document.getElementById('{name}').focus(); document.getElementById('{name}').select()")
    page.call("Input.insertText", text=text)


def setting(page):
    return page.evaluate("radar.setting")


def test_two_hundred_random_radars_are_those_of_python(page, live):
    """σ of both filters at every scan to 1e-9, as its page states, and with them the gains; the closed form."""
    page.open(live)
    rng = np.random.default_rng(3)
    for _ in range(200):
        r, v, dt, dm = 10 ** rng.uniform([0, -1, -1, -5], [3, 2, 1.5, 1])
        asked = {"r": r, "v": v, "dt": dt, "dm": dm, "k": 40}
        found = page.evaluate(f"radar.sigmas({json.dumps(asked)})")
        one, two, gain = (np.array(found[name], dtype=float) for name in ("one", "two", "gain"))
        expected = [sigmas(1, 3, **asked), sigmas(2, 2, **asked)]
        np.testing.assert_allclose(one, expected[0], rtol=STATED)
        np.testing.assert_allclose(two, expected[1], rtol=STATED)
        np.testing.assert_allclose(1 - gain / 100, expected[1] / expected[0], rtol=2 * STATED)
        numbers = page.evaluate(f"radar.numbers({json.dumps(asked)})")
        assert_rounded(numbers["c"], closed_form.dimensionless_groups(r, v, dt, dm).c, operations=12)
        assert_rounded(numbers["limit"], closed_form.steady_gains(numbers["c"]), size=100, operations=60)


def test_it_loads_offline_without_a_word_in_the_console(page, live):
    page.open(live)
    assert page.complaints() == []
    assert page.requested() == [live.resolve().as_uri()]
    assert live.stat().st_size < 100_000
    assert setting(page) == {"r": 25, "v": 5, "dt": 10, "dm": 1e-3, "k": 30}
    assert page.evaluate("document.querySelectorAll('svg.live path.l').length") == 12


def test_ticks_are_where_the_curves_are_and_at_the_last_scan(page, live):
    page.open(live)
    texts = page.evaluate("[...document.querySelectorAll('#sigma-2 text.soft')].map((text) => text.textContent)")
    assert "290" in texts
    lowest = sigmas(2, 2, 25, 5, 10, 1e-3, 30)[1:, 2].min()
    assert min(float(text) for text in texts[texts.index("290") + 1 :]) < 2 * lowest


def test_a_slider_by_keyboard_moves_number_curve_and_address(page, live):
    page.open(live)
    before = page.evaluate("document.querySelector('#sigma-0 path.two').getAttribute('d')")
    page.evaluate("document.getElementById('v-slider').focus()")
    for _ in range(40):
        page.key("ArrowLeft")
    now = setting(page)
    assert now["v"] < 5
    assert page.evaluate("document.getElementById('v').value") == page.evaluate("String(radar.setting.v)")
    assert page.evaluate("document.querySelector('#sigma-0 path.two').getAttribute('d')") != before
    assert f"v={page.evaluate('String(radar.setting.v)')}" in page.evaluate("location.hash")
    assert page.evaluate("document.getElementById('v-slider').getAttribute('aria-valuetext')") == page.evaluate(
        "String(radar.setting.v)"
    )


def test_a_number_of_ones_own_and_one_that_is_refused(page, live):
    page.open(live)
    field(page, "r", "60,5")
    assert setting(page)["r"] == 60.5
    assert page.evaluate("location.hash").startswith("#r=60.5&")
    for bad in ("-3", "abc", "1e9", "0"):
        field(page, "r", bad)
        assert setting(page)["r"] == 60.5
        assert page.evaluate("document.getElementById('r').getAttribute('aria-invalid')") == "true"
    field(page, "k", "7.5")
    assert setting(page)["k"] == 30


def test_a_link_opens_the_setting_and_bad_ones_are_left_aside(page, live):
    page.open(live)
    page.evaluate("location.hash = '#r=60&v=2&dt=12&dm=0.01&k=20'")
    page.evaluate("new Promise((done) => setTimeout(done, 100))")
    assert setting(page) == {"r": 60, "v": 2, "dt": 12, "dm": 0.01, "k": 20}
    expected = sigmas(2, 2, 60, 2, 12, 0.01, 20)[-1, 0]
    base = sigmas(1, 3, 60, 2, 12, 0.01, 20)[-1, 0]
    gain = round(100 * (1 - expected / base), 1)
    assert f"reduces the range error by {gain:g} %" in page.evaluate("document.getElementById('sentence').textContent")
    page.evaluate("location.hash = '#r=-1&v=x&dt=1e99&constructor=3&k=2'")
    page.evaluate("new Promise((done) => setTimeout(done, 100))")
    assert setting(page) == {"r": 60, "v": 2, "dt": 12, "dm": 0.01, "k": 20}
    assert page.complaints() == []


def test_touch_moves_a_slider_and_reads_a_value(page, live):
    page.open(live, width=390, height=800)
    page.call("Emulation.setTouchEmulationEnabled", enabled=True)

    def touch(x, y):
        for kind, points in (("touchStart", [{"x": x, "y": y}]), ("touchEnd", [])):
            page.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    x, y = page.place("#r-slider")
    touch(x + 40, y)
    page.evaluate("new Promise((done) => setTimeout(done, 400))")
    assert setting(page)["r"] > 25
    x, y = page.place("#sigma-1")
    touch(x, y)
    assert page.evaluate("document.getElementById('read').textContent").startswith("Scan 1")


def test_the_keyboard_reads_values(page, live):
    page.open(live)
    page.click("#radars button", 1)
    page.evaluate("document.getElementById('gain').focus()")
    page.key("End")
    for _ in range(23):
        page.key("ArrowLeft")
    told = page.evaluate("document.getElementById('read').textContent")
    assert told.startswith("Scan 7, 60 s: range 218.2 → 157.3 (27.92 %)")


@pytest.mark.parametrize("dark", [False, True])
def test_names_contrast_and_themes(page, live, dark):
    page.open(live, dark=dark)
    assert page.evaluate(NAMES) == []
    assert page.evaluate(CONTRAST) == []
    first = page.evaluate("getComputedStyle(document.querySelector('svg.live path.one')).color")
    page.click("#theme")
    assert page.evaluate("getComputedStyle(document.querySelector('svg.live path.one')).color") != first


def test_a_phone_reads_it_without_scrolling_sideways(page, live):
    page.open(live, width=360, height=740)
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
