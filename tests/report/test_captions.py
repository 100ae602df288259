"""Every caption against its table, and every answer whole, in both languages: what is told is what the numbers say."""

import re

import pytest

from radarsim import language
from radarsim.app.run import run
from radarsim.config.document import SHIPPED
from radarsim.report import html
from tests.report import captions

CONFIGS = sorted(path.stem for path in (SHIPPED / "configs").glob("*.yaml"))
FEW = ("rls2", "pulses_rls5", "ambiguous_rls2")


def cut(answer):
    """The paragraphs of an answer whose brackets do not close."""
    parts = html.split_into_clauses(answer)
    return [part for part in parts if any(part.count(a) != part.count(b) for a, b in ("[]", "()"))]


def right(config, n):
    result = run(config, realisations=n)
    for code in language.known():
        with language.speaking(code):
            faults, _ = captions.checked(result)
            assert faults == [], code
            assert cut(type(result).answer.func(result)) == [], code
    return result


@pytest.mark.parametrize("config", FEW)
def test_captions_and_answers_are_as_the_tables(config):
    right(config, 300)


@pytest.mark.slow
@pytest.mark.parametrize("config", CONFIGS)
def test_captions_and_answers_of_every_config_are_as_the_tables(config):
    result = right(config, 200)
    from radarsim.app import result as output

    drawn = result.experiment.drawn(output.case_figures(result.cases, result.tables, result.experiment))
    assert 1 <= len(drawn) <= 8  # a page that is read
    named = result.experiment.figures
    assert len(drawn) >= 0.5 * len(named)  # of so few realisations some have nothing to show


@pytest.mark.parametrize(
    ("words", "others"),
    [
        ("lowest: r+Vr (", "lowest: r ("),
        ("highest: r (1", "highest: r (2"),
        ("At most 3", "At most 4"),
        (" 20 s); ", " 30 s); "),
    ],
)
def test_a_wrong_caption_is_noticed(words, others):
    result = run("rls2", realisations=20000)
    from radarsim.app import result as output

    drawn = output.case_figures(result.cases, result.tables, result.experiment)
    name, caption = next((name, one.caption) for name, one in drawn.items() if words in one.caption)
    assert captions.judged(result, name, caption)[0] == []
    assert captions.judged(result, name, caption.replace(words, others))[0]


@pytest.mark.parametrize("code", language.known())
def test_a_translation_tells_the_same_values_in_the_same_order(code):
    """What is read back by a translation's own places would not tell lowest from highest exchanged in it."""
    places = re.compile(r"\{(\w+)")
    with language.speaking(code):
        for one in (*captions.ENDS, *captions.MOST, *captions.EXTREMES):
            assert places.findall(language.tr(one)) == places.findall(one)
