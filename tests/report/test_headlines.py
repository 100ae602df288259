"""The words over a figure are about it: every value that they quote is drawn. Captions are short."""

import re
from dataclasses import replace

import numpy as np
import pytest

from radarsim.api import result_content
from radarsim.api.run import run
from radarsim.config.find_files import SHIPPED
from radarsim.language.current import language_codes, use_language
from radarsim.report import headlines
from radarsim.report.case_selection import swept_cases, swept_keys
from radarsim.report.drawing.model import Axis, Figure, Heat, Line, Panel, Style
from radarsim.report.exact_marks import MARK, without_marks
from radarsim.report.math_text import plain_text
from radarsim.report.page_links import sources_behind_figure
from radarsim.report.quantities import RADIAL
from radarsim.studies.registry import study

CONFIGS = sorted(path.stem for path in (SHIPPED / "configs").glob("*.yaml"))
MAX_CAPTION_WORDS = 40
TABLES = "curves", "gains", "operations", "stages"


def figure_of(label, *values, scale="linear"):
    lines = tuple(Line(np.arange(2.0), np.array([0.1, value]), str(value)) for value in values)
    return Figure("f", "The title", "A caption.", (Panel(Axis("x"), Axis(label, scale), lines),))


def test_lines_that_a_headline_names_are_strong_and_the_others_thin():
    names = ("order 2", "order 2 range only", "expected error = likelihood")
    lines = tuple(Line(np.arange(2.0), np.arange(2.0) + n, name, Style(n, n)) for n, name in enumerate(names))
    figure = Figure("f", "The title", "A caption.", (Panel(Axis("x"), Axis("y"), lines),))

    def widths(headline):
        return [mark.style.width_pt for mark in headlines.emphasised(figure, headline).panels[0].marks]

    assert widths("With ‘expected error’ σ is 3 % lower than with order 2 range only.") == [0.8, 2.0, 2.0]
    assert widths("order 2: σ is 3 m.") == [2.0, 0.8, 0.8]
    plain = [mark.style.width_pt for mark in lines]
    assert widths("σ is 3 m.") == widths(f"{', '.join(names)}: 3 m.") == plain


GAIN, SIGMA, SHARE = (
    figure_of("gain in $\\sigma$ of $r$, %", 18.31, -5.79),
    figure_of("$\\sigma$ of $r$, m", 18.31, 1234.4),
    figure_of("share locked", 0.97, 1.0),
)


@pytest.mark.parametrize(
    ("figure", "sentence", "is_about"),
    [
        (GAIN, f"Range: σ is 18.3 %{MARK} lower than with range alone.", True),
        (GAIN, "Range: σ is 5.8 % [3.0, 7.1] higher than with range alone.", True),
        (GAIN, "Range: σ is 17.3 % [3.0, 27.1] lower than with range alone.", False),
        (GAIN, f"Least σ 18.3 m{MARK}.", False),
        (SIGMA, f"Range: σ is 18.3 %{MARK} lower than with range alone.", False),
        (SIGMA, f"Least σ 18.3 m{MARK}, largest 1234 m [1230, 1240].", True),
        (SIGMA, f"Least σ 18.3 m{MARK}, largest 5678 m [5600, 5700].", False),
        (SHARE, "Locked in 97.00 % [95.1, 98.2] of the bursts.", True),
        (SHARE, "Locked in 3.00 % [1.8, 4.9] of the bursts.", False),
        (SHARE, "Locked in 100 % [99.1, 100] of the bursts.", False),  # of whatever
        (figure_of("share not locked", 0.03, scale="log"), "Locked in 97.00 % [95.1, 98.2] of the bursts.", True),
        (SIGMA, "A sentence without values at 18.3 m.", False),
        (figure_of("σ of $V_r$, m/s", 0.1, 0.97), f"Velocity: σ is 97.0 %{MARK} higher.", False),  # no share
        (GAIN, f"Range: at worst higher by a factor of 18.3{MARK}, at 90 s.", False),  # no gain
    ],
)
def test_a_sentence_is_about_a_figure_that_draws_its_values(figure, sentence, is_about):
    (headline,) = headlines.with_headlines({"f": figure}, [sentence], [()], {"f": ()}).values()
    assert headline.headline == (without_marks(sentence) if is_about else "The title")


def test_a_headline_is_of_the_tables_and_of_all_cases_of_its_figure():
    sentence = f"a = 1 m/s²: σ is 18.3 m{MARK}."
    found = headlines.with_headlines({"f": SIGMA}, [sentence], [("curves",)], {"f": ("curves",)})
    assert found["f"].headline == without_marks(sentence)
    assert headlines.with_headlines({"f": SIGMA}, [sentence], [("folds",)], {"f": ("curves",)})[
        "f"
    ].headline != without_marks(sentence)
    drawn = {"f": ("folds.right",)}
    for column, is_drawn in (("folds.right", True), ("folds.lost", False), ("folds", True)):
        named = headlines.with_headlines({"f": SIGMA}, [sentence], [(column,)], drawn)
        assert (named["f"].headline == without_marks(sentence)) == is_drawn
    other_key = headlines.with_headlines({"f": SIGMA}, [sentence], [()], {"f": ()}, swept_keys={"a": ()})
    assert other_key["f"].headline == "The title"
    panel = replace(SIGMA.panels[0], title="1 m/s², late")
    titled = headlines.with_headlines(
        {"f": replace(SIGMA, panels=(panel,))}, [sentence], [()], {"f": ()}, swept_keys={"a": ()}
    )
    assert titled["f"].headline == without_marks(sentence)
    unswept = headlines.with_headlines({"f": SIGMA}, [sentence], [()], {"f": ()}, swept_keys={"a": {"1 m/s²"}})
    assert unswept["f"].headline == without_marks(sentence)
    one_of_two = headlines.with_headlines({"f": SIGMA}, [sentence], [()], {"f": ()}, ["a = 1 m/s²"])
    assert one_of_two["f"].headline == "The title"


SENTENCES = {
    "en": (
        f"Range: σ is 18.3 %{MARK} lower than with range alone.",
        f"Radial velocity: σ is 18.3 %{MARK} lower than with range alone.",
        f"“range only”: σ of the radial velocity is 18.3 %{MARK} lower.",
        f"Gain over r at 78 s: 18.3 %{MARK}.",
    ),
    "ru": (
        f"Дальность: СКО на 18,3 %{MARK} меньше.",
        f"СКО радиальной скорости на 18,3 %{MARK} меньше, чем по одной дальности.",
        f"«дальность»: СКО радиальной скорости на 18,3 %{MARK} меньше.",
        f"Выигрыш там же: 18,3 %{MARK}.",
    ),
}


@pytest.mark.parametrize("code", SENTENCES)
def test_a_headline_is_of_the_component_of_its_figure(code):
    with use_language(code):
        for sentence, component in zip(SENTENCES[code], ("r", "Vr", "Vr", ""), strict=True):
            figures = {f"gain_{part.name}": GAIN for part in RADIAL}
            sources = dict.fromkeys(figures, ("gains.gain",))
            named = headlines.with_headlines(figures, [sentence], [()], sources, components=RADIAL)
            of_answer = {name for name, figure in named.items() if figure.headline == without_marks(sentence)}
            assert of_answer == ({f"gain_{component}"} if component else set())


def test_a_headline_is_of_the_column_and_of_all_tables_of_its_figure():
    sources = {
        name: sources_behind_figure(name, {"cost": ("stages", "operations")}, TABLES) for name in ("sigma_r", "cost")
    }
    figures = {"sigma_r": SIGMA, "cost": SIGMA}
    sentence = f"Range: 18.3 m{MARK}."

    def headline_figures(*of_sentence):
        named = headlines.with_headlines(figures, [sentence], [of_sentence], sources, components=RADIAL)
        return {name for name, figure in named.items() if figure.headline == without_marks(sentence)}

    assert headline_figures("curves.sigma") == {"sigma_r"}
    assert headline_figures("curves.bias") == headline_figures("stages.sigma") == set()
    assert headline_figures("stages.sigma", "operations") == {"cost"}


def test_a_headline_ends_with_its_first_statement_unless_that_begins_a_list():
    assert headlines.first_statement("Range: 3 m; once settled 2 m.") == "Range: 3 m."
    assert headlines.first_statement("By stage: start: 3 m; after: 2 m.") == "By stage: start: 3 m; after: 2 m."


def test_values_of_maps_are_read_under_their_bar():
    heat = Heat(np.arange(2.0), np.arange(1.0), np.array([[0.25, 0.5]]), "share locked")
    figure = replace(SHARE, panels=(Panel(Axis("x"), Axis("noise"), (heat,)),))
    assert headlines.is_drawn("locked in 25.00 % [20, 30]", headlines.drawn_values(figure))


def check_words_of_figures(result):
    """Headlines are sentences of the answer, or titles; no caption is long, in any language."""
    for code in language_codes():
        with use_language(code):
            tables = result._tables
            figures = result_content.case_figures(result.cases, tables, result.experiment)
            answer = result_content.make_answer(result.cases, tables)
            declared = study(result.experiment.study).drawn_from()
            sources = {name: sources_behind_figure(name, declared, tables) for name in figures}
            keys = swept_cases(result.cases), swept_keys(result.cases)
            components = study(result.experiment.study).user_filter_components() or RADIAL
            named = headlines.with_headlines(figures, answer.marked_texts, answer.sources, sources, *keys, components)
            captions = {name: plain_text(figure.caption) for name, figure in figures.items()}
            long = {name: len(text.split()) for name, text in captions.items()}
            assert {name: count for name, count in long.items() if count > MAX_CAPTION_WORDS} == {}
            sentences = [headlines.first_statement(text) for text in answer.texts]
            component_names = [part.name for part in components]
            for name, figure in named.items():
                assert figure.headline in (*sentences, plain_text(figure.title))
                kind, _, component = name.partition("_")
                has_component = kind in headlines.COMPONENT_KINDS and component in component_names
                if has_component and figure.headline != plain_text(figure.title):
                    assert headlines.first_component(figure.headline, components) == component
                assert not re.search("95 % intervals", figure.caption) or code != "en"


@pytest.mark.parametrize("config", ["rls2", pytest.param("sonar_missed", marks=pytest.mark.slow)])
def test_words_of_figures_are_short_and_about_them(config):
    check_words_of_figures(run(config, realisations=200))


@pytest.mark.slow
@pytest.mark.parametrize("config", CONFIGS)
def test_words_of_all_shipped_figures_are_short_and_about_them(config):
    check_words_of_figures(run(config, realisations=200))


def test_each_gain_of_a_radar_bears_its_own_sentence(tmp_path):
    run("rls2", realisations=200, out=tmp_path)
    captions = (tmp_path / "rls2" / "figures" / "captions.md").read_text(encoding="utf-8")
    head, *parts = captions.split("\n## ")
    assert head.strip().splitlines()[-1] == "Bands and whiskers: 95 % intervals. Crosses: exact values."
    said = {part.split("\n")[0]: part.split("\n")[2] for part in parts}
    assert said["gain_r"].startswith("Range: at 140 s")
    assert said["gain_Vr"].startswith("Radial velocity: at 140 s")
    assert said["gain_ar"].startswith("Radial acceleration: at 140 s")
    assert said["sigma_r"].startswith("**RMS error of the range.**")
