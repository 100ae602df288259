"""The reader of catalogues: what is written comes back, and the standard library reads what is compiled."""

from gettext import GNUTranslations

import pytest

from radarsim.language.gettext_catalogue import Entry, catalogue_text, compile_catalogue, entries

RUSSIAN = "nplurals=3; plural=(n%10==1 && n%100!=11 ? 0 : n%10>=2 && n%10<=4 && (n%100<10 || n%100>=20) ? 1 : 2);"
HEADER = Entry("", translations={0: f"Content-Type: text/plain; charset=UTF-8\nPlural-Forms: {RUSSIAN}\n"})
MADE = [
    HEADER,
    Entry("range", translations={0: "дальность"}, notes=["#: a.py"]),
    Entry("range", context="genitive", translations={0: "дальности"}),
    Entry('a "quoted"\n\\path\tand more', translations={0: "„так“\n\\и\tтак"}),
    Entry(
        "{count} scan",
        plural="{count} scans",
        translations={0: "{count} обзор", 1: "{count} обзора", 2: "{count} обзоров"},
    ),
    Entry("not yet", translations={0: ""}),
]


def test_what_is_written_comes_back():
    assert entries(catalogue_text(MADE)) == MADE


def test_the_standard_library_reads_it():
    said = GNUTranslations(compile_catalogue(MADE))
    assert said.gettext("range") == "дальность"
    assert said.pgettext("genitive", "range") == "дальности"
    assert said.gettext('a "quoted"\n\\path\tand more') == "„так“\n\\и\tтак"
    assert [said.ngettext("{count} scan", "{count} scans", n) for n in (1, 2, 5, 11, 21, 112)] == [
        *("{count} обзор", "{count} обзора", "{count} обзоров"),
        *("{count} обзоров", "{count} обзор", "{count} обзоров"),
    ]
    assert said.gettext("not yet") == "not yet"


def test_a_text_over_several_lines_and_a_comment():
    text = '# of ours\nmsgid ""\n"σ of "\n"the range"\nmsgstr "СКО "\n"дальности"\n'
    assert entries(text) == [Entry("σ of the range", translations={0: "СКО дальности"}, notes=["# of ours"])]


@pytest.mark.parametrize("line", ["msgid without quotes", 'msgwhat "a"', 'msgid "a" "b" c'])
def test_what_is_no_catalogue_is_refused(line):
    with pytest.raises(ValueError, match="no line of a catalogue"):
        entries(f'msgid "a"\nmsgstr "b"\n\n{line}\n')
