"""Figures and report of tracks over recorded plots."""

import csv
import re

import numpy as np
import pytest

from radarsim.api.load_experiments import load_all
from radarsim.language.current import use_language
from radarsim.recordings import simulate_plots, study_part
from radarsim.recordings.positions import MAX_FIGURE_ROWS, PlotPositions, plane_positions
from radarsim.recordings.report import figures, page, sentences
from radarsim.report import page as report_page
from radarsim.report.drawing.model import Line, Note
from tests.program import command
from tests.recordings import plot_files
from tests.tolerances import assert_rounded, share_error


def loaded(config, *overrides):
    (one,) = load_all([config], overrides)
    return one


def written(path, columns, **more):
    table = columns | more
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows([list(table), *zip(*(np.asarray(one).tolist() for one in table.values()))])  # noqa: B905
    return path


@pytest.mark.slow_cases("sonar_smoothing")
@pytest.mark.parametrize("config", ["rls2", "sonar_smoothing", "multimodel_1hz", "ambiguous_rls4"])
def test_residuals_lie_between_their_bounds(tmp_path, config):
    """Over realisations of what the filter is made for: 95.4 % within two σ, by Z standard errors."""
    calm = "filters=[{name: k, family: kalman, models: [{motion: accelerated, sigma_acceleration_mps2: 1}]}]"
    more = {
        "rls2": ("scans=60",),
        "ambiguous_rls4": ("filters=[{name: m, doppler: folded, manoeuvre_variance: 0.0}]", "scans=25"),
        "multimodel_1hz": ("scans=60", calm),
    }
    more = more.get(config, ())
    one, inside, count = loaded(config, *more), 0, 0
    for i in range(12):
        _, track = plot_files.track(one, written(tmp_path / "plots.csv", simulate_plots.simulate_realisation(one, i)))
        share = np.abs(track.residual[:, 10:]) / track.residual_sigma[:, 10:]
        share = share[np.isfinite(share)]
        inside, count = inside + int((share < 2).sum()), count + share.size
    # Filters of one case share their plots, and neighbouring residuals are not independent: a tenth counts.
    assert abs(inside / count - 0.954) < share_error(0.954, count / 10)


def test_plan_view_has_equal_units_and_shows_radar_start_and_end():
    t, angle = np.arange(40) * 10.0, np.linspace(0, 3, 40)
    places = np.stack([5e4 * np.cos(angle), 5e4 * np.sin(angle), np.full(40, 5e4)], axis=1)
    one = loaded("rls2", "scans=40")
    track = (
        study_part.recording_interface(one.cases[0])
        .tracker(one.cases[0])
        .feed(simulate_plots.simulate_realisation(one))
    )
    view, over_time = figures.plan_figure(track, {"": PlotPositions(t, places)}).panels
    assert (view.equal, view.x.label, view.y.label) == (True, "east, km", "north, km")
    lines = {mark.name: mark for mark in view.marks if isinstance(mark, Line)}
    np.testing.assert_array_equal(lines["plots"].x, places[:, 1] / 1e3)
    np.testing.assert_array_equal(lines["plots"].y, places[:, 0] / 1e3)
    assert (lines["radar"].x.tolist(), lines["radar"].y.tolist()) == ([0], [0])
    assert [mark.text for mark in view.marks if isinstance(mark, Note)] == ["start, 0 s", "end, 390 s"]
    np.testing.assert_array_equal(over_time.marks[0].y, 50)


def test_places_of_plots():
    x, y, z = np.array([3.0]), np.array([12.0]), np.array([4.0])
    np.testing.assert_array_equal(plane_positions({"x_m": x, "y_m": y, "z_m": z}), [[3, 4, 13]])
    r = np.array([10.0])
    # The angle's cosine is its rounding.
    assert_rounded(plane_positions({"range_m": r, "bearing_rad": np.array([np.pi / 2])}), [[0, 10, 10]], r)
    assert np.isnan(plane_positions({"range_m": r})[0, :2]).all()
    assert plane_positions({"bearing_rad": r}) is None


def test_places_are_thinned():
    path = PlotPositions()
    for k in range(0, 10 * MAX_FIGURE_ROWS, 500):
        t = np.arange(k, k + 500.0)
        path.add(t, {"range_m": t, "bearing_rad": t * 0})
    assert MAX_FIGURE_ROWS // 2 < len(path.t_s) <= MAX_FIGURE_ROWS
    assert len(set(np.diff(path.t_s))) == 1


@pytest.mark.slow
def test_the_report_shows_what_the_terminal_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    one = loaded("sonar_smoothing")
    source = written(tmp_path / "plots <b>.csv", simulate_plots.simulate_realisation(one), track=["7"] * 40)
    result = command("track", "sonar_smoothing", source, "-o", tmp_path / "track.csv", "--report", tmp_path / "out")
    text = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    assert "What do the filters of sonar_smoothing make of plots &lt;b&gt;.csv?" in text
    assert "Best: growing and kalman" in text  # the same filter twice, of which neither is the better
    assert "1.0 times" not in text
    assert "radarsim track sonar_smoothing plots" in text  # not where the shipped config lies
    assert text.index('id="figure-track"') < text.index('id="figure-plan"')
    assert "residual of bearing, °" in text
    assert re.search(r"Advice: the stated values of \S+.* agree with 40 rows\.", text)
    for name in ("plan", "track", "residuals", "nis"):
        assert f'id="figure-{name}"' in text
        assert (tmp_path / f"out/figures/{name}.svg").stat().st_size > 1000
    assert "Errors against the truth" in text
    assert f"report   {tmp_path / 'out/report.html'}" in result.stdout


def test_among_false_plots_no_track_is_marked_and_no_filter_called_untried_for_want_of_plots(tmp_path):
    config = "sweep.sensor.false_plots_per_km2=[0.03]"
    source = written(tmp_path / "plots.csv", simulate_plots.simulate_realisation(loaded("sonar_clutter", config)))
    said = command(
        *("track", "sonar_clutter", source, "--set", config, "-o", tmp_path / "t.csv", "--report", tmp_path / "out")
    ).stdout
    assert "untested  “nearest”, PDA and “nearest, 4 of 6”: no innovation" in said
    text = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    assert "The plots do not tell which filter is best: the filters give no innovation with a covariance." in text
    assert "Triangle: the radar. Where a file has no heights" in text
    assert "longest track" not in text


def test_a_ratio_beyond_doubt_is_no_number_and_a_line_without_label_goes_on():
    assert [sentences.likelihood_ratio_text(gain * np.log(10)) for gain in (0.3, 1.5, 5.2, 6.1, 3336)] == [
        *("2.0", "32", "10⁵", "over 10⁶", "over 10⁶")
    ]
    lines = [
        sentences.Statement("no rows", "a: no estimate"),
        sentences.Statement("advice", "--set a=1"),
        sentences.Statement("", "from 5 rows"),
    ]
    assert page._sentences(lines) == ["No rows: a: no estimate.", "Advice: --set a=1, from 5 rows."]
    assert page._sentences([sentences.Statement("", "MMA: consistent")]) == ["MMA: consistent."]


def test_the_page_is_in_one_language():
    with use_language("ru"):
        page_text = report_page.track_page("rls2", "plots.csv", [], [], [], {}, "", "")
    assert "Что дают фильтры конфигурации rls2 по отметкам plots.csv?" in page_text
    assert not {"Plots", "Figures", "Config", "Contents", "Answer"} & set(re.findall(r'[>"](\w+)[<"]', page_text))


@pytest.mark.slow
def test_nothing_is_drawn_over_the_plots(tmp_path):
    one = loaded("rls2")
    (tmp_path / "figures").mkdir()
    source = written(tmp_path / "figures/track.svg", simulate_plots.simulate_realisation(one))
    before = source.read_bytes()
    result = command("track", "rls2", source, "-o", tmp_path / "t.csv", "-q", "--report", tmp_path, code=2)
    assert "would be overwritten; choose another folder" in result.stderr
    assert source.read_bytes() == before


@pytest.mark.parametrize("config", ["rls2", "multimodel_1hz"])
def test_the_bytes_are_those_of_any_number_of_threads(tmp_path, config):
    one, rows = loaded(config, "scans=20"), []
    for i in range(4):
        columns = simulate_plots.simulate_realisation(one, i)
        rows += [(f"{i}", *row) for row in zip(*(column.tolist() for column in columns.values()), strict=True)]
    rows.sort(key=lambda row: row[1])
    with open(tmp_path / "plots.csv", "w", newline="") as file:
        csv.writer(file).writerows([("track", *columns), *rows])
    made = []
    for threads in (1, 2, 5):
        command("track", config, tmp_path / "plots.csv", "-o", tmp_path / "t.csv", "-q", "--threads", threads)
        made.append((tmp_path / "t.csv").read_bytes())
    assert made[0] == made[1] == made[2]
