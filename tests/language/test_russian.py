"""Nothing untranslated in figures and reports of the shipped configs; the tables' bytes are the same."""

import html
import re

import pytest
from making import messages

from radarsim.api import result_content, write_result
from radarsim.api.configs import load
from radarsim.api.run import run
from radarsim.config.find_files import SHIPPED
from radarsim.extensions import extensions
from radarsim.language import current, translate
from radarsim.language.current import use_language
from radarsim.language.translate import tr, translate_names
from radarsim.papers.claim_rows import class_count, class_text
from radarsim.report.csv_text import to_csv
from radarsim.report.drawing.model import Figure
from radarsim.studies import planar, planar_tables, registry

# A config of each study, and what of each other kind is quick.
QUICK = ["rls2", "multimodel_1hz", "sonar_asynchronous", "sonar_manoeuvre", "discriminator_noise", "ambiguous_rls2"]
ALL = sorted(path.stem for path in (SHIPPED / "configs").glob("*.yaml"))
# Names, symbols, file formats and what a user types: the same in every language.
NAMES = {
    *("r", "Vr", "ar", "CSV", "YAML", "SI", "sha", "run", "json", "csv", "report", "html", "curves", "config"),
    *("radarsim", "figures", "NEES", "NIS", "IMM", "imm", "MMA", "GPB", "PDA", "Tab", "exp", "var", "cov"),
    *("max", "min"),
    *("RLS", "IEEE", "Std", "asin", "combined", "modified", "moment", "best", "samples", "sinc"),
    *("python", "numpy", "numba", "llvmlite", "scipy", "pandas", "matplotlib", "pydantic", "pyyaml"),
}

SYMBOLS = {
    "Vr",
    "ar",
    "PDA",
    "NEES",
    "NIS",
    "IMM",
    "exp",
    "var",
    "cov",
    *("P1", "P2", "P3", "P4"),
}  # in sentences: of papers and of formulas


def shown(figure: Figure):
    """All texts of a figure."""
    yield from (figure.title, figure.caption)
    for panel in figure.panels:
        yield from (panel.x.label, panel.y.label, panel.title, panel.key_title, panel.remark, panel.crosses)
        yield from (name for name, _ in panel.keys)
        yield from (name for axis in (panel.x, panel.y) for _, name in axis.ticks)
        for mark in panel.marks:
            yield from (getattr(mark, "label", ""), getattr(mark, "name", ""), getattr(mark, "text", ""))


def told(page: str):
    """All texts of a report but what is typed, counted or quoted as it is: code, keys, tables that are files."""
    page = re.sub(r"(?s)<(style|script|pre|code|svg|i)\b.*?</\1>", "", page)
    page = re.sub(r"(?s)<table class=\"sortable\" id=\"table-asked.*?</table>", meanings, page)
    page = re.sub(r"(?s)<details id=\"tables\">.*?<details id=", "<details id=", page)
    page = re.sub(r"(?s)<dd>.*?</dd>", "", page)
    yield from (html.unescape(words) for words in re.findall(r'aria-label="([^"]*)"', page))
    yield from (html.unescape(words) for words in re.findall(r">([^<]+)<", page))


def meanings(table: re.Match) -> str:
    """Of a table of keys what they mean: the last column; where cases differ, keys and values are all there is."""
    heads = re.findall(r"<th[^>]*>(.*?)</th>", table[0])
    cells = re.findall(r"(?s)<td[^>]*>.*?</td>", table[0])
    return " ".join(cells[len(heads) - 1 :: len(heads)]) if len(heads) == 3 and heads[0] == "ключ" else ""


def untranslated(words: str, names: set[str]) -> list[str]:
    """English words in a text: Latin ones that are no names, symbols, keys or formulas."""
    bare = re.sub(r"--(?:set|out) \S+|\$[^$]*\$|`[^`]*`|\w+[._]\w[\w.]*|«[^»]*»|\b[a-z]+:", " ", words)
    return [word for word in re.findall(r"[A-Za-z]{3,}", bare) if word not in names]


def latin(words: str, stems: set[str]) -> list[str]:
    """Latin words in a sentence that are no symbols, formulas, keys or names of config files."""
    bare = re.sub(r"\$[^$]*\$|`[^`]*`|--(?:set|out) \S+|\w+[._]\w[\w.]*", " ", words)
    return [word for word in re.findall(r"[A-Za-z][A-Za-z\d]+", bare) if word not in SYMBOLS | stems]


LONG = re.compile("[A-Za-z]{3,}")
UNPARTED = re.compile(r"\[[^];]*\d,\d[^];]*, ")  # an interval of decimal commas that only commas part


def check(stem: str, realisations: int, folder) -> None:
    result = run(stem, realisations=realisations, out=folder, figures=False)
    names = NAMES | {part for text in own_names(result) for part in re.findall("[A-Za-z]+", text)}
    config = (SHIPPED / "configs" / f"{stem}.yaml").read_text(encoding="utf-8")
    names |= {path.stem for path in (SHIPPED / "scenarios").glob("*.yaml") if f"target: {path.stem}" in config}
    before = {name: to_csv(table) for name, table in result_content.case_tables(result.cases, stem=stem).items()}
    with use_language("ru"):
        made = result_content.case_tables(result.cases, stem=stem)
        assert {name: to_csv(table) for name, table in made.items()} == before
        figures = result_content.case_figures(result.cases, made, result.experiment)
        written = write_result.write_files(
            result.experiment, result.cases, folder / "ru", {}, draw=False, tables_by_name=made
        )
        page = (written.folder / "report.html").read_text(encoding="utf-8")
        texts = [words for figure in figures.values() for words in shown(figure)]
        claims = [line for extension in extensions() for _, line in extension.result_lines(result)]
        said = [result.question, *type(result).answer.func(result), *claims, *texts]
    stems = {stem, *(case.name.partition(" ")[0] for case in result.cases)}
    assert {words: found for words in said if (found := latin(words, stems))} == {}
    assert [words for words in said if UNPARTED.search(words)] == []
    left = {words: found for words in [*texts, *told(page)] if (found := untranslated(words, names))}
    assert left == {}


def own_names(result):
    """What the config calls things."""
    for case in result.cases:
        yield from (
            case.name,
            case.spec.device or "",
            *case.axes.filters,
            *(str(value) for _, value in case.swept_values),
        )
        yield from (name for name, _ in case.axes.components)
        yield from (one.name for one in getattr(case.spec, "detectors", ()))
        yield from typed(case.spec.model_dump())


def typed(value):
    """All texts that stand as values in a config."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list | tuple):
        for one in value.values() if isinstance(value, dict) else value:
            yield from typed(one)


@pytest.mark.slow_cases_except("rls2")
@pytest.mark.parametrize("stem", QUICK)
def test_nothing_is_left_in_english(stem, tmp_path):
    check(stem, 8, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("stem", ALL)
def test_nothing_is_left_in_english_in_any_shipped_config(stem, tmp_path):
    check(stem, 20, tmp_path)


@pytest.mark.parametrize(
    ("said", "left"),
    [
        ("РЛС 2, цель: turn", ["turn"]),
        ("nearest, 4 of 6 подтверждает", ["nearest", "of"]),
        ("r+Vr: 10 plots, $\\sigma$ of P_D, rls2_wide", ["plots", "of"]),
        ("rls2: r+Vr, PDA, `radarsim run`, F_r = 700 Гц, --set filters.2.combine=likelihood, P4", []),
    ],
)
def test_the_check_sees_what_is_latin(said, left):
    assert latin(said, {"rls2"}) == left
    assert UNPARTED.search("12 % [10,5, 21]")
    assert not UNPARTED.search("12 % [10,5; 21]")


@pytest.mark.slow
def test_all_names_of_shipped_configs_are_in_russian_and_no_others():
    """No config is run: what its cases call things; a name that no config gives any more has no translation."""
    with use_language("ru"):
        names = result_content.config_names(case for stem in ALL for case in load(stem).cases)
    labels = {one.id for one in current.messages("ru") if one.context == translate.LABEL}
    assert labels - names == set()
    given = {own.name for stem in ALL for case in load(stem).cases for own in listed_in(case.spec)}
    given |= {case.spec.device for stem in ALL for case in load(stem).cases if case.spec.device}
    assert {name for name in given - labels if latin(name, set())} == set()


def listed_in(spec):
    """What has a name in a case: filters, detectors, estimators."""
    for key in ("filters", "detectors", "estimators"):
        yield from getattr(spec, key, None) or ()


def test_extensions_are_counted_in_russian():
    with use_language("ru"):
        assert class_count("confirmed, extension", 1) == "1 подтверждено (дополнение)"
        assert class_text("refuted, extension") == "опровергнуто (дополнение)"
        assert "(дополнение)" in class_count("depends on, extension", 2)
    assert class_count("confirmed, extension", 1) == "1 confirmed (extension)"


def test_claims_are_in_russian_words():
    """Statements, what their parts measure and how they are read; what is typed stands in quotes or as `a_key`."""
    with use_language("ru"):
        said = {text: tr(text) for text, _, _ in messages.in_claims() if text}
    assert len(said) > 300
    kept = {"phi"}
    left = {text: found for text, words in said.items() if (found := [*filter(LONG.fullmatch, latin(words, kept))])}
    assert left == {}


def test_names_of_a_config_are_said_as_whole_words_alone():
    names = frozenset({"memory", "memory test", "no memory", "turn", "modified combined"})
    with use_language("ru"):
        assert translate_names("no memory; memory, memory test", names) == "без памяти; с памятью, memory test"
        assert (
            translate_names("`turn.yaml`, target=turn, turn_2: turn.", names)
            == "`turn.yaml`, target=turn, turn_2: разворот."
        )
        assert translate_names("modified\ncombined", names) == "мод.\nкомб."
        assert [translate_names(name) for name in ("memory", "memory test")] == ["с памятью", "memory test"]
    assert translate_names("no memory", names) == "no memory"


@pytest.mark.parametrize("code", [code for code in current.language_codes() if code != current.ENGLISH])
def test_names_of_a_config_stay_apart_and_hold_commas_where_they_did(code):
    """Two filters must not get one name, and a list of names must part where it did."""
    labels = {one.id: one.translations[0] for one in current.messages(code) if one.context == translate.LABEL}
    assert len(set(labels.values())) == len(labels) > 100
    assert [name for name, said in labels.items() if (", " in name) != (", " in said)] == []


def test_the_check_sees_what_is_english():
    assert untranslated("σ of the range, m", {"r"}) == ["the", "range"]
    assert untranslated("СКО $\\sigma$ of r, `radar.scan_period_s` radar.name «plain words»", {"of"}) == []


def test_the_components_of_all_studies_have_a_genitive():
    parts = [
        part for found in registry.call_studies(lambda study: study.user_filter_components()).values() for part in found
    ]
    words = {part.words for part in (*parts, *planar.PlanarStudy.components, planar_tables.ACROSS) if part.words}
    assert {"speed", "course", "rate of climb"} <= words
    genitives = {entry.id for entry in current.messages("ru") if entry.context == "genitive"}
    assert words - genitives == set()
