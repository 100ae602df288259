"""Answers are whole and short in every language, and a config draws no more figures than a page holds."""

import re

import pytest

from radarsim.api import result_content
from radarsim.api.run import run
from radarsim.config.find_files import SHIPPED
from radarsim.language import current
from radarsim.report import page_sentences

CONFIGS = sorted(path.stem for path in (SHIPPED / "configs").glob("*.yaml"))
FEW = ("rls2", "pulses_rls5", "ambiguous_rls2")


def unclosed(answer):
    """The sentences of an answer whose brackets do not close."""
    return [text for text in answer if any(text.count(a) != text.count(b) for a, b in ("[]", "()"))]


FAILING = {"pulses_energy": 4000}  # realisations of configs whose only figure is of bursts that fail


def unequal_decimals(answer):
    """Values that have other decimals than the ends of their interval; of shares none and all have none."""
    number = r"[−+]?((?:\d|(?<=\d)[\u202f\u00a0](?=\d))+)(?:[.,](\d+))?(?:·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?"
    estimate = re.compile(rf"(?<![\d.,]){number}(?: [^\s\[]+)? \[{number}[,;] {number}\]")
    found = []
    for text in answer:
        if not re.search(r"\[[^\]]*;", text):  # English: a comma is one between thousands
            text = re.sub(r"(?<=\d),(?=\d{3}(?!\d))", "", text)
        for match in estimate.finditer(text):
            integers, decimals = match.groups()[::2], match.groups()[1::2]
            counted = {d for i, d in zip(integers, decimals, strict=True) if d or i not in ("0", "100")}
            found += [match[0]] if len({len(d or "") for d in counted}) > 1 else []
    return found


def test_unequal_decimals_are_seen():
    assert unequal_decimals(["12.3 m [12, 12.6]", "7,0 % [1,5; 12,80]", "2.5 [2.1, 3]"]) != []
    assert (
        unequal_decimals(
            [
                "830 s [230, 2980]",
                "12.3 m [12.0, 12.6]",
                "7,0 % [1,5; 12,8]",
                "100 % [99.62, 100]",
                "6.5·10⁻⁵ [5.4·10⁻⁵, 7.9·10⁻⁵]",
            ]
        )
        == []
    )


def check_answer(config, n):
    result = run(config, realisations=n)
    for code in current.language_codes():
        with current.use_language(code):
            texts = result_content.make_answer(result.cases, result._tables).texts
        assert unclosed(texts) == [], code
        assert unequal_decimals(texts) == [], code
        assert [text for text in texts if not page_sentences.is_short(text)] == [], code
    return result


@pytest.mark.parametrize("config", FEW)
def test_sentences_of_an_answer_close_their_brackets_and_take_three_lines(config):
    check_answer(config, 300)


@pytest.mark.slow
@pytest.mark.parametrize("config", CONFIGS)
def test_answers_and_figures_of_every_config_fit_a_page(config):
    result = check_answer(config, FAILING.get(config, 200))
    drawn = result.experiment.selected_figures(
        result_content.case_figures(result.cases, result._tables, result.experiment)
    )
    assert 1 <= len(drawn) <= 8  # a page that is read
    named = result.experiment.figures
    assert len(drawn) >= 0.5 * len(named)  # of so few realisations some have nothing to show
