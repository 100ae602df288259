"""Catalogues of packages with studies of their own: each speaks by its own, and by no other's."""

import importlib
import sys

import pytest
from click.testing import CliRunner

from radarsim.cli.command_group import main
from radarsim.config.labels import label
from radarsim.language import current, translate
from radarsim.language.current import use_language
from radarsim.language.translate import term, tr
from radarsim.studies import registry

CATALOGUE = """
msgid ""
msgstr "Content-Type: text/plain; charset=UTF-8\\n"

msgid "range"
msgstr "диапазон"

msgctxt "genitive"
msgid "range"
msgstr "диапазона"

msgid "RMS error of the {quantity}"
msgstr "своё {quantity}"

msgid "a question of its own"
msgstr "свой вопрос"

msgid "scan period"
msgstr ""
"""
CODE = """
from radarsim.config.key_types import Positive, key
from radarsim.config.model import Model
from radarsim.config.study_keys import StudyKeys, Member, Members
from radarsim.language.translate import plural, term, tr

RANGE = term("range")

def says(message, **values):
    return tr(message, **values)

class Sensor(Model):
    scan_period_s: Positive = key("scan period", "time between two plots, s")
    reach_m: Positive = key("range", "how far it sees, m")

class Keys(StudyKeys):
    sensor: Sensor = key("sensor", "the sensor")
    filters: Members[Member] = key("filters", "the filters")
"""


@pytest.fixture(autouse=True)
def packages(tmp_path, monkeypatch):
    """Two packages that offer studies: `speaks` has a catalogue, `silent` none."""
    for name in ("speaks", "silent"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(CODE, encoding="utf-8")
    (tmp_path / "speaks" / "language").mkdir()
    (tmp_path / "speaks" / "language" / "ru.po").write_text(CATALOGUE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(current, "packages", lambda: ("speaks", "silent", "not_imported"))
    made = [importlib.import_module(name) for name in ("speaks", "silent")]
    for kept in (current._read, translate._translated_keys):
        kept.cache_clear()
    yield made
    for kept in (current._read, translate._translated_keys):
        kept.cache_clear()
    for name in ("speaks", "silent"):
        del sys.modules[name]


def test_what_a_package_says_is_looked_up_in_its_catalogue_alone(packages):
    speaks, _ = packages
    with use_language("ru"):
        assert [one.says("range") for one in packages] == ["диапазон", "range"]
        assert speaks.says("radial velocity") == "radial velocity"  # radarsim's, which it does not translate
        assert speaks.says("RMS error of the {quantity}", quantity=speaks.RANGE) == "своё диапазон"
    assert speaks.says("range") == "range"


def test_its_words_stay_its_own_in_radarsims_sentences(packages):
    speaks, silent = packages
    with use_language("ru"):
        assert tr("range") == tr(term("range")) == "дальность"
        assert tr("RMS error of the {quantity}", quantity=speaks.RANGE) == "СКО ошибки диапазона"
        assert tr("RMS error of the {quantity}", quantity=silent.RANGE) == "СКО ошибки range"
        assert tr("RMS error of the {quantity}", quantity=term("range")) == "СКО ошибки дальности"
        assert tr(speaks.RANGE) == "диапазон"


def test_what_radarsim_says_for_it_is_found_in_its_catalogue(packages):
    with use_language("ru"):
        assert tr("a question of its own") == "свой вопрос"
    assert tr("a question of its own") == "a question of its own"


def test_keys_are_called_by_the_catalogue_of_their_schemas_package(packages):
    speaks, _ = packages
    ours = label(registry.keys("range_doppler"), "radar.scan_period_s").text
    with use_language("ru"):
        assert tr(ours) == "период обзора"
        assert [tr(label(one.Keys, "sensor.scan_period_s").text) for one in packages] == ["scan period"] * 2
        assert [tr(label(one.Keys, "sensor.reach_m").text) for one in packages] == ["диапазон", "range"]
        assert tr(label(speaks.Keys, "filters.0.name").text) == tr(label(registry.keys("range_doppler"), "name").text)


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ("# ours\n\nrange: диапазон\n".encode(), "line 3: no line of a catalogue: range: диапазон"),
        (b'msgid "a"\nmsgstr "\\x"\n', "line 2: "),
        (b"\xff\xfe", "'utf-8' codec can't decode"),
        (b'msgid ""\nmsgstr "Content-Type: text/plain; charset=none\\n"\n', "unknown encoding: none"),
    ],
)
def test_a_file_that_is_no_catalogue_harms_its_package_alone(packages, tmp_path, monkeypatch, content, fault):
    monkeypatch.setattr(current, "faults", [])
    (tmp_path / "silent" / "language").mkdir()
    file = tmp_path / "silent" / "language" / "ru.po"
    file.write_bytes(content)
    with use_language("ru"):
        assert [packages[1].says("range") for _ in range(2)] == ["range"] * 2
        assert tr("range") == "дальность"
        assert tr("no message of anybody") == "no message of anybody"
        assert packages[0].says("range") == "диапазон"
    (line,) = current.faults
    assert line.startswith(f"package silent speaks English: {file}: {fault}")


def test_a_command_says_once_which_catalogue_it_leaves_out(packages, monkeypatch):
    monkeypatch.setattr(current, "faults", ["package silent speaks English: its file"])
    done = [CliRunner().invoke(main, ["list"]) for _ in range(2)]
    assert [one.exit_code for one in done] == [0, 0]
    assert [one.stderr for one in done] == ["package silent speaks English: its file\n", ""]
