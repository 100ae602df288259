"""What commands say in Russian beside a run: the chart and its page, lists, interpretations, reasons of claims not
judged."""

import json
import re

import pytest
from making import messages

from radarsim.api import inventory
from radarsim.api.configs import load
from radarsim.api.design import question
from radarsim.api.design.quantities import MeasuredQuantity
from radarsim.api.doppler_chart import chart, describe_chart
from radarsim.language.current import use_language
from radarsim.language.translate import tr
from radarsim.papers.claim_rows import decisive_value_words, expected_words, unit_after
from radarsim.papers.interpretation_files import markdown_pages
from radarsim.papers.interpretations import alternative_words
from radarsim.papers.judge_interpretations import judge_requests
from radarsim.papers.open_papers import judging_requests, open_papers
from radarsim.papers.paper_cases import key_differences
from radarsim.papers.reasons import translate_reason
from radarsim.papers.specification_curve import specification_curve
from radarsim.report.quantities import SIGMA
from radarsim.studies.range_doppler.doppler_gain import PAGE_TERMS
from radarsim.studies.range_doppler.study import exact_but_for
from tests.language.test_russian import NAMES, shown, untranslated
from tests.program import command


@pytest.fixture(scope="module")
def drawn():
    """The chart of a radar in Russian."""
    with use_language("ru"):
        return describe_chart(load("rls2").cases)


def test_the_chart_and_its_figures(drawn):
    names = NAMES | {"rls", "Lambda", "theta"}
    left = {
        words: found
        for figure in drawn.figures.values()
        for words in shown(figure)
        if (found := untranslated(words, names))
    }
    assert left == {}
    assert "дальности" in drawn.sentences[0]


def test_the_live_page_is_russian_in_its_body_and_in_what_its_script_says(drawn):
    page = drawn.page
    body = page[page.index("<body") : page.index('<script type="application/json" id="data"')]
    words = re.findall(r'aria-label="([^"]*)"', body) + re.findall(r">([^<]+)<", body)
    assert {text: found for text in words if (found := untranslated(text, {"radarsim"}))} == {}
    said = json.loads(re.search(r'id="words">(.*?)</script>', page)[1])
    script = page[page.rindex("<script>") :]
    asked = {
        *re.findall(r'\b(?:translated|filled|part\(\w+,)\(?"([^"]+)"', script),
        *re.findall(r'"((?:reduces|raises|the acc|the vel)[^"]+)"', script),
    }
    assert asked | {"range", "velocity", "acceleration"} == set(PAGE_TERMS)
    assert all(said[text] != text for text in PAGE_TERMS)


def test_the_chart_table_is_the_same(tmp_path):
    english = chart("rls2", out=tmp_path / "en", figures=False)
    with use_language("ru"):
        russian = chart("rls2", out=tmp_path / "ru", figures=False)
    assert (english.folder / "chart.csv").read_bytes() == (russian.folder / "chart.csv").read_bytes()


def test_the_list_says_what_things_are_and_leaves_their_names():
    with use_language("ru"):
        names = command("list")
        ended = command("list", "configs", "scenarios", "studies", "filters")
    for title, _, rows in inventory.inventory():
        for row in rows:
            assert row[0] in names.stdout or "Configs" not in title
            assert row[0] in ended.stdout
            assert tr(row[-1]) == row[-1]
            with use_language("ru"):
                assert tr(row[-1]) in ended.stdout
                assert tr(row[-1]) != row[-1]


@pytest.mark.slow
@pytest.mark.parametrize("claim", ["P1.4", "P1.5"])
def test_interpretations_of_a_claim_and_their_curve(claim, tmp_path):
    with use_language("ru"):
        done = judge_requests(judging_requests([claim]), out=tmp_path, figures=False)
        page = markdown_pages(done)
        over = done.papers[0].claims[0]
        texts = shown(specification_curve(over))
    every = [
        one.name for choice in over.interpretations.choices for one in choice.alternatives
    ]  # the page has them as keys
    typed = {part for name in every for part in re.findall("[A-Za-z]+", name)} | {"same", "time"}
    names = NAMES | typed | {"interpretations", "markdown", "results", "verdicts"}
    assert {text: found for text in [*texts, *page.splitlines()] if (found := untranslated(text, names))} == {}


def test_what_papers_leave_open_is_said_in_the_language():
    choices = [choice for paper in open_papers().values() for choice in paper.interpretations.choices]
    names = {one.name for choice in choices for one in choice.alternatives}
    with use_language("ru"):
        said = {name: alternative_words(name) for name in names}
    assert {name: words for name, words in said.items() if untranslated(words, set())} == {}
    assert said["0.003"] == "0,003"
    assert (alternative_words("half σ_a"), alternative_words("process_noise")) == ("half σ_a", "process noise")


REASONS = (
    "not the paper's experiment: rls1: radar.sigma_range_m is 30, the paper's 200, seed is 2, the paper's 1 …; "
    "and 2 more",
    "not the paper's experiment: rls2 D_M=1: 2 of the paper's 3 filters changed or missing",
    "not the paper's experiment: rls2: target differs from the paper's",
    "rls2 ends at 50 s, the paper's run at 140 s",
    "not the paper's experiment: no such experiment is shipped",
    "a required case is missing",
    "exact value and simulation differ by more than 5.85 standard errors: exact 1.5, simulated 2 [1.9, 2.1]",
)


@pytest.mark.parametrize("why", REASONS)
def test_reasons_of_claims_that_are_not_judged(why):
    assert translate_reason(why) == why
    with use_language("ru"):
        said = translate_reason(why)
    assert untranslated(said, {"rls", "seed", "filters", "target", "radar"}) == []
    assert re.findall(r"\d+", said.replace(",", ".")) == re.findall(r"\d+", why)


@pytest.mark.slow
def test_every_reason_that_the_sources_give_is_known():
    """What `MissingEvidence` is raised with stands in the catalogues."""
    found = {text for _, text, _ in messages.found()}
    raised = set()
    for path in sorted((messages.PACKAGE).rglob("*.py")):
        if path.name != "recorded.py" and not {"one_file", "one_step"} & set(path.parts):
            raised |= set(re.findall(r'raise MissingEvidence\("([^"]+)"', path.read_text(encoding="utf-8")))
    assert len(raised) > 4
    assert raised <= found
    assert key_differences  # its texts are the patterns of `reasons`


def test_units_that_count_have_the_form_of_their_number():
    found = {"measured": 1.0, "exact": 1.0, "judged_lo": "", "judged_hi": "", "lo": 0.0, "hi": 3.0, "unit": "scans"}
    assert [unit_after(n, "scans") for n in (1, 2, 0.5)] == ["scan", "scans", "scans"]
    assert decisive_value_words(found) == "1 scan (exact)"
    with use_language("ru"):
        said = [unit_after(n, "scans") for n in (1, -2, 5, 1.5, 21, float("inf"))]
        assert said == ["обзор", "обзора", "обзоров", "обзора", "обзор", "обзора"]
        assert decisive_value_words(found) == "1 обзор (точно)"
        assert expected_words("about 2 to 5", "plots").endswith(" 5 отметок")
        assert expected_words("0.5", "%") == "0,5 %"
        assert expected_words("few") == tr("few")


def test_what_solve_announces():
    said = []
    with use_language("ru"):
        question.predict_duration(
            said.append,
            tr("computes the {quantity} at about {count} values of {key}", quantity="q", count=7, key="k"),
            12.3,
        )
        near = tr(exact_but_for(load("rls2", ["radar.detection_probability=0.9", "scans=22"]).cases[0]))
        quantity = MeasuredQuantity(SIGMA, "r", "Vr", at_s=60.0).translated_words
    assert said == ["вычисляется q примерно при 7 значениях k: около 12 с"]
    assert near.startswith("среднее")
    assert untranslated(near, set()) == []
    assert untranslated(quantity, {"Vr"}) == []


def test_what_import_says_is_russian_and_its_faults_and_its_file_are_not(tmp_path):
    log, plots = tmp_path / "log.csv", tmp_path / "plots.csv"
    log.write_text("time,track,range_m\n0,1,1000\n5,1,1100\n5,1,1100\n9,,900\n")
    command("import", log, "-o", plots)
    english = plots.read_bytes()
    with use_language("ru"):
        said = command("import", log, "-o", plots)
        fault = command("import", log, "-o", plots, "--track", "1", "--bias", "range_m=9999", code=2)
    assert re.search(r"plots.csv \(3 строки, 1 трасса: .*\n +csv, прочитано 4 записи", said.stdout)
    assert said.stderr.split("\n")[:-1] == [
        " " * 14 + "не учтено: строки, переданные повторно, с тем же временем и теми же значениями (1)",
        " " * 14 + "отметок вне трасс, которые `radarsim track` пропустит: 1 из 3",
    ]
    assert plots.read_bytes() == english
    assert "left out: plots whose range is not above 0 (4)" in fault.stderr
