"""Messages in the language spoken: numbers, forms of words, counts; which language it is; what the catalogues hold."""

import re
from string import Formatter
from types import SimpleNamespace

import pytest
from making import messages

from radarsim.errors import ConfigError
from radarsim.language import current, translate
from radarsim.language.current import use_language
from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, plural, term, tr
from radarsim.report import wording
from tests.program import command

CODES = [code for code in current.language_codes() if code != current.ENGLISH]


@pytest.fixture(autouse=True)
def _english(monkeypatch):
    monkeypatch.delenv(current.VARIABLE, raising=False)


def folded(span):
    return tr("an unambiguous interval of {span:.4g} m/s, which folds the target's {speed:.4g} m/s", span=span, speed=1)


def test_numbers_are_written_as_the_language_writes_them():
    assert folded(-1.5).startswith("an unambiguous interval of −1.5 m/s,")
    assert numeral("-1,234.5") == "−1234.5"
    assert [numeral(text) for text in ("4,000", "4000", "12000")] == ["4000", "4000", "12,000"]  # four are not split
    assert folded(6.678e9).startswith("an unambiguous interval of 6.678·10⁹ m/s,")
    assert numeral("+1e-05") == "+10⁻⁵"
    with use_language("ru"):
        assert numeral("1.72e-05") == "1,72·10⁻⁵"
        assert folded(-1.5).startswith("интервал однозначности −1,5 м/с ")
        assert numeral("-12,345.5") == "−12\N{NARROW NO-BREAK SPACE}345,5"
        assert [numeral(text) for text in ("4,000", "-1,234.5", "12000.5")] == [
            "4000",
            "−1234,5",
            "12\N{NARROW NO-BREAK SPACE}000,5",
        ]
        assert wording.number(2.5e-7) == "2,5·10⁻⁷"
        assert wording.estimate((12.3, 12.0, 12.6), "м") == "12,30 м [12,00; 12,60]"
        assert tr("{config}: valid", config="1.5") == "1.5: ошибок нет"  # a name of the user's stays as it is


@pytest.mark.parametrize(
    ("count", "english", "russian"),
    [
        (1, "1 run", "1 расчёт"),
        (2, "2 runs", "2 расчёта"),
        (5, "5 runs", "5 расчётов"),
        (11, "11 runs", "11 расчётов"),
        (21, "21 runs", "21 расчёт"),
    ],
)
def test_counts(count, english, russian):
    assert plural("{count} run", "{count} runs", count) == english
    with use_language("ru"):
        assert plural("{count} run", "{count} runs", count) == russian


def test_a_word_has_the_form_that_its_place_asks_for():
    assert tr("RMS error of the {quantity}", quantity=term("range")) == "RMS error of the range"
    with use_language("ru"):
        assert tr(term("range")) == "дальность"
        assert tr("RMS error of the {quantity}", quantity=term("range")) == "СКО ошибки дальности"
        assert tr("RMS error of the {quantity}", quantity="range") == "СКО ошибки range"  # no word of ours


def test_messages_that_differ_in_their_numbers_are_translated_once():
    assert tr("σ of f# at -0.5 s of 3") == "σ of f# at -0.5 s of 3"
    with use_language("ru"):
        for n in (2, 20, 7):
            assert tr(f"smoothed RMS error after {n} plots, over the formula").count(f" {n} ") == 1
        assert tr("largest relative difference in RMS error of the two at ρ = -0.5").endswith("ρ = −0,5")
        assert (
            tr("smoothed RMS error after n2 plots, over the formula")
            == "smoothed RMS error after n2 plots, over the formula"
        )


@pytest.mark.parametrize("code", CODES)
def test_a_translation_has_as_many_numbers_as_its_message(code):
    entries = [one for one in current.messages(code) if translate.NUMBER_PLACEHOLDER in one.id]
    assert len(entries) > 50
    assert [
        one.id
        for one in entries
        if one.translations[0].count(translate.NUMBER_PLACEHOLDER) != one.id.count(translate.NUMBER_PLACEHOLDER)
    ] == []


def test_what_is_not_translated_is_said_in_english():
    with use_language("ru"):
        assert tr("no such message") == "no such message"
        assert tr("") == ""


def test_names_in_a_sentence():
    assert [join_names(names) for names in ([], ["a"], ["a", "b"], ["a", "b", "c"])] == [
        "",
        "a",
        "a and b",
        "a, b and c",
    ]
    with use_language("ru"):
        assert join_names(["a", "b", "c"]) == "a, b и c"


def test_the_option_comes_before_the_variable_and_both_before_english(monkeypatch):
    assert current.current_language() == "en"
    monkeypatch.setenv(current.VARIABLE, "ru")
    assert current.current_language() == "ru"
    with use_language("en"):
        assert current.current_language() == "en"
    monkeypatch.setenv(current.VARIABLE, "")
    assert current.current_language() == "en"


def test_an_unknown_language_is_one_line_and_exit_2(monkeypatch):
    known = ", ".join(current.language_codes())
    for arguments in (["--language", "xx", "list"], ["list", "--language", "xx"]):
        assert command(*arguments, code=2).stderr == f"--language: must be one of {known}, got 'xx'\n"
    monkeypatch.setenv(current.VARIABLE, "xx")
    assert command("list", code=2).stderr == f"RADARSIM_LANGUAGE: must be one of {known}, got 'xx'\n"
    with pytest.raises(ConfigError, match="RADARSIM_LANGUAGE"):
        current.current_language()


@pytest.mark.slow
@pytest.mark.parametrize("code", CODES)
def test_every_message_is_translated(code):
    """Made by `make messages`, then by hand."""
    assert messages.untranslated(code) == []


@pytest.mark.parametrize("code", CODES)
def test_a_translation_has_the_places_of_its_message(code):
    for entry in current.messages(code):
        if not entry.id or entry.context:
            continue
        allowed = {*places(entry.id), *places(entry.plural)}
        for said in entry.translations.values():
            assert set(places(said)) <= allowed, entry.id
            if not entry.plural:
                assert set(places(said)) == allowed or entry.id == "{count} {kind}", entry.id


@pytest.mark.parametrize("code", CODES)
def test_a_word_that_has_a_form_has_every_form_that_is_asked_for(code):
    entries = current.messages(code)
    asked = {spec for one in entries for said in one.translations.values() for spec in forms(said)}
    words = {one.id for one in entries if one.context in asked}
    assert words
    for context in asked:
        assert words <= {one.id for one in entries if one.context == context}, context


@pytest.mark.parametrize("code", CODES)
def test_no_letter_of_a_translation_is_latin_by_mistake(code):
    """A Latin a, c, e, o, p or x inside a Cyrillic word looks right and is not."""
    for entry in current.messages(code):
        for said in entry.translations.values():
            mixed = re.findall(r"[А-Яа-яё][A-Za-z]|[A-Za-z][А-Яа-яё]", said.replace("\\n", " "))
            assert not mixed, said


def places(message):
    """Names of the places; none where the message is no template."""
    try:
        return [name for _, name, _, _ in Formatter().parse(message) if name]
    except ValueError:
        return []


def forms(message):
    """The forms of words that a message's places ask for."""
    try:
        return [spec for _, name, spec, _ in Formatter().parse(message) if name and spec.isalpha() and len(spec) > 1]
    except ValueError:
        return []


def test_names_with_commas_stay_one_name_in_a_row():
    """`cured, gated` is one filter, not two: in questions, captions and warnings."""
    from radarsim.report import answer_warnings, caption_remarks

    names = ["sequence", "cured", "cured, gated", "dense"]
    assert (
        translate.shorten_names(names)
        == caption_remarks.join_few_names(names)
        == "sequence, cured, “cured, gated” and dense"
    )
    assert answer_warnings.few_realisations_warning([SimpleNamespace(name=one, count=9) for one in names]) == [
        "sequence, cured, “cured, gated” and dense: intervals from 9 realisations are rough: run at least 200"
    ]
    assert translate.shorten_names(["cured, gated"]) == "cured, gated"
