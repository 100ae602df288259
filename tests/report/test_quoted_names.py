"""Names of filters that read as words are in quotes, wherever a sentence, a caption or a headline has them."""

import re

import pytest

from radarsim.api import result_content
from radarsim.api.configs import load
from radarsim.api.run import run
from radarsim.language.current import language_codes, use_language
from radarsim.language.translate import list_filters, quote_name, shorten_names
from radarsim.report.math_text import plain_text

QUOTED = re.compile("[“«][^”»]*[”»]")
CONFIGS = {
    "rls2": "filters",
    "multimodel_1hz": "filters",
    "sonar_asynchronous": "filters",
    "sonar_manoeuvre": "filters",
    "discriminator_pair": "estimators",
    "ambiguous_rls4": "filters",
    "pulses_rls4": "filters",
    "plane": "filters",
}


def test_symbols_need_no_quotes():
    assert [quote_name(name) for name in ("r+Vr", "MMA2-122", "Kalman-2", "H 300", "PDA")] == [
        *("r+Vr", "MMA2-122", "Kalman-2", "H 300", "PDA")
    ]
    assert quote_name("PDA, 4 of 6") == "“PDA, 4 of 6”"
    assert shorten_names([quote_name("cured, gated"), "A, B", "r"]) == "“cured, gated”, “A, B” and r"
    assert list_filters(["dense", "r", "wide", "IMM"], 2) == "“dense”, r and 2 more"


@pytest.mark.slow_cases_except("rls2")
@pytest.mark.parametrize("config", CONFIGS)
def test_words_are_quoted_in_sentences_and_captions(config):
    case = load(config).cases[0]
    key, members = CONFIGS[config], getattr(case.spec, CONFIGS[config])
    names = {member.name: f"lone wolf {chr(ord('a') + i)}" for i, member in enumerate(members)}
    settings = {f"{key}.{i}.name": name for i, name in enumerate(names.values())}
    if baseline := getattr(case.spec, "baseline", None):
        settings["baseline"] = [names[name] for name in (baseline, *case.further_baselines)]
    result = run(config, realisations=40, overrides=settings, figures=False)
    for code in language_codes():
        with use_language(code):
            figures = result_content.case_figures(result.cases, result._tables, result.experiment).values()
            answer = result_content.make_answer(result.cases, result._tables)
            question = result_content.question_text(result.experiment)
            captions = [plain_text(figure.caption) for figure in figures]
        texts = [question, *answer.texts, *answer.warnings, *captions]
        assert any("lone wolf" in text for text in texts)
        assert [text for text in texts if "lone wolf" in QUOTED.sub("", text)] == []
