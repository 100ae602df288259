"""The chart: closed forms against the recursion on random radars, the map, its figures, sentences and files."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from radarsim.api.doppler_chart import chart
from radarsim.errors import ConfigError
from radarsim.report.drawing.model import Note
from radarsim.studies.range_doppler import closed_form, doppler_gain_figures, steady_state
from tests.program import command
from tests.studies.range_doppler import impulse, naive
from tests.tolerances import assert_rounded


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The chart of a radar of one's own, with the paper's five beside it."""
    out = tmp_path_factory.mktemp("chart")
    return chart("rls2", out=out, overrides=["radar.sigma_velocity_mps=5"], figures="svg")


def random_radars(count, most, seed, decades=2):
    """Shares Δt/τ₁ and Δt/τ₂ (count,) up to `most`, over some decades."""
    return 10 ** np.random.default_rng(seed).uniform(np.log10(most) - decades, np.log10(most), (2, count))


def recursion(shares):
    """Exact steady gains (3, n) of radars with these shares (2, n)."""
    return steady_state.exact_gains(shares[0] ** -2, shares[1] ** 3)


def test_a_thousand_random_radars_lie_on_the_chart():
    """Where Δt/τ₁ and Δt/τ₂ are at most 0.05 the closed form is within half a point, up to c of 50 000."""
    shares = random_radars(1200, closed_form.MAX_STEP, 1, decades=3)
    c = (shares[1] / shares[0]) ** 2
    shares, c = shares[:, c <= closed_form.MAX_C][:, :1000], c[c <= closed_form.MAX_C][:1000]
    assert shares.shape == (2, 1000)
    assert c.max() > 1e4
    gains = recursion(shares)
    away = np.abs(closed_form.steady_gains(c, shares[1]) - gains)
    assert away.max() < closed_form.ERROR_POINTS <= 0.5
    assert away[:, c <= closed_form.MODERATE_C].max() < closed_form.MODERATE_POINTS
    # Without the correction: half a point is just exceeded in the range, where Δt/τ₂ is 0.05.
    limit = np.abs(closed_form.steady_gains(c) - gains)
    assert limit.max() < closed_form.LIMIT_POINTS
    assert limit[:, shares[1] < 0.045].max() < 0.5


@pytest.mark.parametrize(
    ("most", "points"),
    [(closed_form.MAX_C, closed_form.ERROR_POINTS), (closed_form.MODERATE_C, closed_form.MODERATE_POINTS)],
)
def test_where_the_closed_form_is_worst_it_is_within_the_stated_points(most, points):
    """Along the edge: the larger of both shares is 0.05. No bound has much to spare."""
    c = np.geomspace(1e-3, most, 600)
    shares = closed_form.MAX_STEP * np.array([np.minimum(c**-0.5, 1.0), np.minimum(c**0.5, 1.0)])
    gains = recursion(shares)
    corrected = np.abs(closed_form.steady_gains(c, shares[1]) - gains)
    limit = np.abs(closed_form.steady_gains(c) - gains)
    assert 0.85 * points < corrected.max() < points
    assert corrected[:2].max() < 0.06  # range and velocity, at any c
    assert 0.9 * closed_form.LIMIT_POINTS < limit.max() < closed_form.LIMIT_POINTS


def test_the_correction_is_of_the_first_order():
    """Halving the period takes the error of the limit down by two, that with the correction by four."""
    c, steps = np.full(2, 9.6), np.array([0.04, 0.02])
    gains = recursion(np.array([steps * c**-0.5, steps]))
    without = closed_form.steady_gains(c) - gains
    corrected = closed_form.steady_gains(c, steps) - gains
    # Of errors of one order and the next, which is smaller by a factor of the step.
    assert without[:2, 0] / without[:2, 1] == pytest.approx([2, 2], rel=steps[0])
    assert corrected[:2, 0] / corrected[:2, 1] == pytest.approx([4, 4], rel=steps[0])


def test_many_radars_at_once_are_as_one_by_one():
    shares = random_radars(40, 3.0, 2)
    gains = recursion(shares)
    for i in range(40):
        sigma, variance = np.array([1.0, shares[0, i]]), shares[1, i] ** 6
        states = np.array([steady_state.steady_state(n, variance, sigma, 1.0) for n in (1, 2)])
        both = np.sqrt(np.diagonal(states[:, 1], axis1=1, axis2=2))
        allowed = 100 * naive.precision(states, 1 + 1 / shares[1, i])  # of the scans of a memory
        assert gains[:, i] == pytest.approx(100 * (1 - both[1] / both[0]), abs=allowed)


@pytest.mark.slow_cases("30.0")
@pytest.mark.parametrize("c", [0.3, 3.0, 30.0])
def test_the_lines_over_time_are_those_of_the_textbook_and_end_in_the_closed_form(c):
    t, gain = doppler_gain_figures.limit_course(c)
    tau_2 = c**-0.5
    dt = min(1.0, tau_2) / doppler_gain_figures.SCANS_PER_TIME
    for i in (0, len(t) // 4):
        scans = round(t[i] / dt) + 1
        P = naive.kalman(np.zeros((scans, 2)), 1, 3, tau_2**-6, (1.0, 1.0), dt)[1][2:]  # worse than with the velocity
        wanted = impulse.gains(scans, tau_2**-6, (1.0, 1.0), dt)
        assert gain[i] == pytest.approx(wanted, abs=100 * naive.precision(P))
    # The limit errs by the first order of the period, and by LIMIT_POINTS where it is SMALL.
    assert gain[-1] == pytest.approx(
        closed_form.steady_gains(c),
        abs=closed_form.LIMIT_POINTS / doppler_gain_figures.SCANS_PER_TIME / closed_form.MAX_STEP,
    )


@pytest.mark.slow
def test_the_papers_radars_lie_where_the_paper_has_them(tmp_path):
    five = chart(out=tmp_path, figures=False)
    rows = pd.read_csv(tmp_path / "chart" / "chart.csv").set_index(["case", "component"])
    assert rows["C_theta"].groupby("case", sort=False).first().round(2).tolist() == [0.25, 2.78, 11.11, 25.0, 100.0]
    assert_rounded(rows.loc["rls2", "r"]["c"], rows.loc["rls3", "r"]["c"], operations=10)  # powers of the same numbers
    assert rows.loc["rls4", "r"]["steady_gain_percent"] == pytest.approx(52.4, abs=0.05)  # as printed
    assert [line.split(":")[0] for line in five.sentences] == ["rls1", "rls2", "rls3", "rls4", "rls5"]
    assert "the acceleration error rises by 5.8 %" in five.sentences[0]
    assert (rows["c"] == rows["c"]).all()


def test_ones_own_radar_is_named_and_marked(made):
    (sentence,) = made.sentences
    assert sentence.startswith("rls2, as set: in the long run Doppler reduces the range error by 45.4 %")
    figures = {"gain_against_time.svg", "map.svg", "steady_gain.svg"}
    assert {"chart.csv", "chart.html", "captions.md", *figures} == set(made.files)
    rows = pd.read_csv(made.folder / "chart.csv")
    assert rows["case"].unique().tolist() == ["rls2, as set", "rls1", "rls2", "rls3", "rls4", "rls5"]
    own = rows.iloc[0]
    states = np.array([steady_state.steady_state(n, 1e-3, np.array([250.0, 5.0]), 10.0) for n in (1, 2)])
    base, twin = states[:, 1, 0, 0]
    allowed = 100 * naive.precision(states, 3)  # a memory is of two scans
    assert own["steady_gain_percent"] == pytest.approx(100 * (1 - np.sqrt(twin / base)), abs=allowed)


def test_the_lines_of_the_map_are_crossed_where_they_say():
    """The number of each line of equal gain stands at a place that has this gain by the solver."""
    found = doppler_gain_figures.gain_map_figure([], [])
    levels = []
    for component, panel in enumerate(found.panels):
        notes = [mark for mark in panel.marks if isinstance(mark, Note)]
        # Chords between places of the map are an eighth of a second difference off, in each number.
        rows = doppler_gain_figures.map_gains()[component]
        chord = sum(np.abs(np.diff(rows, 2, axis=axis)).max() / 8 for axis in (0, 1))
        levels.append([note.text for note in notes])
        for note in notes:
            at = steady_state.exact_gains(np.array([note.x]), np.array([note.y]))
            assert at[component, 0] == pytest.approx(float(note.text.removesuffix(" %")), abs=chord)
    assert levels == [["20 %", "40 %", "60 %", "80 %"]] * 2 + [["0 %", "20 %", "40 %", "60 %", "80 %"]]


def test_the_page_is_whole_and_fetches_nothing(made):
    text = (made.folder / "chart.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    assert not re.search(r"(src|href)=[\"']?(https?:)?//", text)
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])
    assert data[0] == {"name": "rls2, as set", "r": 250.0, "v": 5.0, "dt": 10.0, "dm": 1e-3}


def test_a_name_cannot_break_out_of_the_page():
    from radarsim.report import render_page

    text = render_page.live_page("t", ("<main></main>", "", ""), json.dumps([{"name": "</script><script>alert(1)"}]))
    assert "</script><script>alert" not in text
    assert "\\u003c/script\\u003e" in text


def test_what_has_no_place_on_it(tmp_path):
    with pytest.raises(ConfigError, match="has no chart"):
        chart("sonar_missed", out=tmp_path)
    with pytest.raises(ConfigError, match="one study per chart"):
        chart("rls2", "sonar_missed", out=tmp_path)
    alone = chart(
        "rls2",
        out=tmp_path,
        overrides=["filters=[{name: r, observes: [range], manoeuvre_variance: 1e-3}]"],
        figures=False,
    )
    assert "not on the chart" in alone.sentences[0]


@pytest.mark.parametrize(
    ("setting", "words"),
    [("radar.detection_probability=0.9", "missed plots and biases"), ("target=turn", "the target's manoeuvre")],
)
def test_what_the_chart_leaves_out_of_account_is_named(tmp_path, setting, words):
    (sentence,) = chart("rls2", out=tmp_path, overrides=[setting], figures=False).sentences
    assert sentence.endswith(f"Not included in the long-run values: {words}.")


def test_the_table_on_the_wall_is_the_closed_form():
    text = (Path(__file__).parents[3] / "docs" / "chart.md").read_text(encoding="utf-8").replace("−", "-")
    rows = re.findall(r"^\| ([\d.]+) \| ([-\d.]+) \| ([-\d.]+) \| ([-\d.]+) \|$", text, re.MULTILINE)
    assert len(rows) == 8
    for c, *gains in rows:
        assert [float(one) for one in gains] == pytest.approx(closed_form.steady_gains(float(c)), abs=0.05)


def test_the_command(tmp_path):
    document = json.loads(command("chart", "rls4", "--out", tmp_path, "--no-figures", "--json").stdout)
    assert document["sentences"][0].startswith("rls4: in the long run Doppler reduces the range error by 52.4 %")
    assert document["cases"][0]["component"] == "r"
    assert sorted(p.name for p in (tmp_path / "chart").iterdir()) == ["chart.csv", "chart.html"]
    assert "page     " in command("chart", "rls4", "--out", tmp_path, "--no-figures").stdout


def test_two_configs_of_one_name_could_not_be_told_apart(tmp_path):
    text = (Path(__file__).parents[3] / "configs" / "rls2.yaml").read_text(encoding="utf-8")
    for folder in ("one", "other"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mine.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match="rename one, or run them apart"):
        chart(tmp_path / "one" / "mine.yaml", tmp_path / "other" / "mine.yaml", out=tmp_path, figures=False)


def test_a_file_in_the_place_of_the_folder_is_named_and_not_what_is_written_beside_it(tmp_path):
    (tmp_path / "file").write_text("mine")
    ended = command("chart", "rls4", "--no-figures", "--out", tmp_path / "file", code=4)
    assert ended.stderr == f"{tmp_path / 'file' / 'chart' / 'chart.csv'}: cannot be written: Not a directory\n"
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.slow
def test_a_config_given_twice_counts_once_and_figures_are_told(tmp_path):
    said = []
    drawn = chart("rls4", "rls4", out=tmp_path, figures="svg", progress=lambda *done: said.append(done))
    assert len(drawn.sentences) == 1
    assert said == [(1, 3, 0), (2, 3, 0), (3, 3, 0)]


@pytest.mark.parametrize(
    ("sigma_velocity_mps", "period", "said"),
    [(5, 10, ""), (0.05, 10, "here it has no value"), (0.05, 0.5, "here it is")],
)
def test_a_radar_beyond_the_closed_forms_promise_is_told(sigma_velocity_mps, period, said, tmp_path):
    settings = [f"radar.sigma_velocity_mps={sigma_velocity_mps}", f"radar.scan_period_s={period}"]
    found = chart("rls2", out=tmp_path, overrides=settings, figures=False)
    assert (closed_form.dimensionless_groups(250, sigma_velocity_mps, period, 1e-3).c > closed_form.MAX_C) == bool(said)
    assert ("may be inaccurate" in found.sentences[0]) == bool(said)
    assert said in found.sentences[0]
    if said == "here it is":
        own = found.table[:3]
        away = (own["steady_gain_percent"] - own["corrected_percent"]).abs().max()
        assert f"here it is {away:.2g} points off" in found.sentences[0]
