"""What Python and a notebook show: short texts, the first figure, two results on one pair of axes."""

import matplotlib
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure as Canvas

import radarsim
from radarsim.api.display import MAX_LETTERS, first_lines
from radarsim.report.drawing.colours import COLOURS
from radarsim.report.drawing.style import MARKERS


@pytest.fixture(scope="module")
def results():
    return {name: radarsim.run(name, realisations=200) for name in ("rls2", "rls4")}


@pytest.mark.slow_cases_except("sonar_clutter-20")
@pytest.mark.parametrize(("config", "n"), [("range_doppler", 20), ("multimodel", 2), ("sonar_clutter", 20)])
def test_everything_a_user_meets_has_a_short_text(config, n):
    result = radarsim.run(config, realisations=n, threads=1)
    for one in (
        result,
        result.cases,
        result.cases[0],
        result.cases[0].axes,
        result.experiment,
        *result.experiment.cases,
    ):
        text = repr(one)
        assert len(text.splitlines()) <= 3
        assert len(text) <= 610
    assert result.experiment.stem in repr(result)
    assert result.answer[0][:100] in repr(result)


def test_a_notebook_shows_the_answer_and_the_first_figure(results):
    shown = results["rls2"]._repr_html_()
    assert shown.index("lower than with range alone") < shown.index("data:image/png;base64,") < shown.index("<table")


def drawn(axes, name):
    (line,) = [line for line in axes.lines if line.get_label() == name]
    return line


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(("figure", "first"), [("gain_r", ["r+Vr"]), ("sigma_r", ["r", "r+Vr"])])
def test_two_results_on_one_pair_of_axes_are_told_apart(results, figure, first, order):
    results = dict(list(results.items())[::order])
    canvas = Canvas()
    axes = canvas.subplots()
    for result in results.values():
        assert result.figure(figure, ax=axes) is canvas
    names = [f"{config}, {name}" for config in results for name in first]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [*names, "exact"]
    lines = [drawn(axes, name) for name in names]
    assert len({to_hex(line.get_color()) for line in lines}) == len({line.get_marker() for line in lines}) == len(names)
    for config, result in results.items():
        part, component = figure.split("_")
        table, column = (result.gains, "gain_percent") if part == "gain" else (result.curves, "sigma")
        for name in first:
            own = table[table["filter"].eq(name) & table["component"].eq(component)]
            line = drawn(axes, f"{config}, {name}")
            assert line.get_ydata().tolist() == own[column].tolist()
            low, high = axes.get_ylim()
            assert low <= min(line.get_ydata()) <= max(line.get_ydata()) <= high


def test_names_on_axes_begin_with_what_is_asked_for(results):
    axes = Canvas().subplots()
    results["rls2"].figure("gain_r", ax=axes, label="before")
    results["rls2"].figure("gain_r", ax=axes, label="")
    assert drawn(axes, "before, r+Vr").get_color() != drawn(axes, "r+Vr").get_color()
    assert drawn(axes, "before, r+Vr").get_color() in COLOURS
    assert drawn(axes, "r+Vr").get_marker() in MARKERS


def test_a_figure_on_too_few_axes_is_refused(results):
    with pytest.raises(radarsim.ConfigError, match=r"ax: figure 'gain_r' takes 1 Matplotlib axes, got 2"):
        results["rls2"].figure("gain_r", ax=Canvas().subplots(1, 2))
    with pytest.raises(radarsim.ConfigError, match="got 0"):
        results["rls2"].figure("gain_r", ax="here")
    with pytest.raises(radarsim.ConfigError, match="takes plane rectangular Matplotlib axes, got 3d"):
        results["rls2"].figure("gain_r", ax=Canvas().add_subplot(projection="3d"))
    with pytest.raises(KeyError, match="there are: gain_r, sigma_r"):
        results["rls2"].figure(["gain_r"])


def test_a_figure_without_axes_is_drawn_as_before(results):
    with matplotlib.rc_context():
        alone = results["rls2"].figure("gain_r")
    assert alone.axes[0].get_legend() is None or len(alone.axes[0].get_legend().get_texts()) <= 1
    assert (
        results["rls2"].figure().axes[0].get_ylabel()
        == results["rls2"].figure(results["rls2"].figures[0]).axes[0].get_ylabel()
    )


@pytest.mark.parametrize(
    ("line", "end"),
    [
        ("a" * 200, "a" * 5),
        (f"{'word ' * 45}end", "word …"),
        (f"{'word ' * 30}(no estimate: its RMS error is not a number, because none of its rows has one)", "word …"),
        (f"gain 12 % [10, 14], {'(one) ' * 28}[95 % interval of the mean over all the scans]", "(one) …"),
        (f"({'b' * 300}", "b …"),
    ],
)
def test_a_long_line_is_cut_between_words_and_outside_brackets(line, end):
    shown = first_lines([line])
    assert len(shown) <= MAX_LETTERS
    assert shown.endswith(end)
    assert line.startswith(shown.removesuffix(" …"))
