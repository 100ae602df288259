"""Answers are whole and short in every language, and a config draws no more figures than a page holds."""

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


def check_answer(config, n):
    result = run(config, realisations=n)
    for code in current.language_codes():
        with current.use_language(code):
            texts = result_content.make_answer(result.cases, result._tables).texts
        assert unclosed(texts) == [], code
        assert code != "en" or [text for text in texts if not page_sentences.is_short(text)] == []
    return result


@pytest.mark.parametrize("config", FEW)
def test_sentences_of_an_answer_close_their_brackets_and_take_three_lines(config):
    check_answer(config, 300)


@pytest.mark.slow
@pytest.mark.parametrize("config", CONFIGS)
def test_answers_and_figures_of_every_config_fit_a_page(config):
    result = check_answer(config, 200)
    drawn = result.experiment.selected_figures(
        result_content.case_figures(result.cases, result._tables, result.experiment)
    )
    assert 1 <= len(drawn) <= 8  # a page that is read
    named = result.experiment.figures
    assert len(drawn) >= 0.5 * len(named)  # of so few realisations some have nothing to show
