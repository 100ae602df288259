"""What is refused in a file before anybody asks what its keys mean, each at its line and column."""

import pytest
import yaml

from radarsim.config import yaml_io
from radarsim.config.error_list import ErrorList

STRUCTURE = {
    "duplicate key": ("study: x\nstudy: y\n", "c.yaml:2:1: study: duplicate key, first in line 1"),
    "duplicate below": (
        "radar:\n  sigma_range_m: 1\n  sigma_range_m: {a: [1]}\n",
        "c.yaml:3:3: radar.sigma_range_m: duplicate key, first in line 2",
    ),
    "duplicate in a list": ("a:\n- {b: 1, b: 2}\n", "c.yaml:2:10: a.0.b: duplicate key, first in line 2"),
    "tag": ("a: !!str 1\n", "c.yaml:1:4: a: tags (tag:yaml.org,2002:str) are not read"),
    "python tag": (
        "a: !!python/object/apply:os.system [ls]\n",
        "c.yaml:1:4: a: tags (tag:yaml.org,2002:python/object/apply:os.system) are not read",
    ),
    "own tag": ("a: [1, !mine {b: 1}]\n", "c.yaml:1:8: a.1: tags (!mine) are not read"),
    "anchor": ("a: &x 1\n", "c.yaml:1:4: a: anchors (&x) are not read"),
    "alias": ("a: *x\n", "c.yaml:1:4: a: aliases (*x) are not read: write the value out"),
    "nan": ("a: [1, .nan]\n", "c.yaml:1:8: a.1: must be a finite number, got '.nan'"),
    "infinity": ("a: -.inf\n", "c.yaml:1:4: a: must be a finite number, got '-.inf'"),
    "overflow": ("a: 1e999\n", "c.yaml:1:4: a: must be a finite number, got '1e999'"),
    "nothing": ("a:\nb: 1\n", "c.yaml:1:3: a: has no value"),
    "null": ("a: [null]\n", "c.yaml:1:5: a.0: has no value"),
    "tilde": ("a: ~\n", "c.yaml:1:4: a: has no value"),
    "two documents": ("a: 1\n---\nb: 2\n", "c.yaml:2:1: there must be one YAML document, here begins another"),
}
WHOLE = {
    "empty": ("", "c.yaml: is empty"),
    "only comments": ("# nothing\n\n", "c.yaml: is empty"),
    "a list": ("- 1\n- 2\n", "c.yaml:1:1: must be a mapping of keys, got [1, 2]"),
    "a word": ("hello\n", "c.yaml:1:1: must be a mapping of keys, got 'hello'"),
    "a number": ("1e5\n", "c.yaml:1:1: must be a mapping of keys, got 100000"),
    "an empty document": ("---\n", "c.yaml:2:1: has no value"),
    "a complex key": ("? [a, b]\n: 1\n", "c.yaml:1:3: a key must be a plain word"),
    "a tagged key": ("!!str a: 1\n", "c.yaml:1:1: a key must be a plain word"),
    "an alias as key": ("*a : 1\n", "c.yaml:1:1: a key must be a plain word"),
    "too deep": ("a: " + "[" * 60 + "]" * 60 + "\n", "c.yaml:1:54: nested more than 50 deep"),
    "too large": ("# " + "x" * 256_000 + "\n", "c.yaml: larger than 256 kB"),
    "Latin 1": (b"a: 1\nb: caf\xe9\n", "c.yaml:2:7: is not UTF-8 text"),
    "UTF-16": ("a: 1\n".encode("utf-16"), "c.yaml:1:1: is not UTF-8 text"),
}


@pytest.mark.parametrize(("text", "line"), STRUCTURE.values(), ids=STRUCTURE)
def test_structure(house, said, text, line):
    lines = said(house("c.yaml", text))
    assert line in lines
    assert all(other == line or ": study: " in other for other in lines)


@pytest.mark.parametrize(("content", "line"), WHOLE.values(), ids=WHOLE)
def test_whole_file(house, said, content, line):
    assert said(house("c.yaml", content)) == [line]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("a: [1, 2\nb: 1\n", "2"),
        ("a: 1\n\tb: 2\n", "2"),
        ("a: 'open\n", "2"),
        ("a: {b: 1\n", "2"),
        ("a: @x\n", "1"),
        ("a: b: c\n", "1"),
    ],
)
def test_what_is_no_yaml(house, said, text, place):
    (line,) = said(house("c.yaml", text))
    assert line.startswith(f"c.yaml:{place}:")
    assert ": not valid YAML: " in line


@pytest.mark.parametrize("character", ["\x00", "\x07", "\x1b", "\ufffe"])
def test_characters_that_yaml_has_not(house, said, character):
    (line,) = said(house("c.yaml", f"a: 1\nb: x{character}\n"))
    assert line.startswith("c.yaml:")
    assert "not valid YAML" in line


def test_a_bomb_of_aliases_is_refused_at_once(house, said):
    bomb = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 30))
    lines = said(house("c.yaml", bomb))
    assert len(lines) == 30 + 29 * 9 + 1


def test_a_long_fault_free_file_is_read_in_time(house, said):
    assert len(said(house("c.yaml", "study: range_doppler\n" + "".join(f"k{i}: 1\n" for i in range(3_000))))) > 3_000


def test_byte_order_mark_is_ignored(house, said):
    assert said(house("c.yaml", "\ufeffstudy: nothing\n"))[0].startswith("c.yaml:1:")


def test_pure_python_parser_gives_the_same(house, monkeypatch):
    text = "é: {b: [1, 'é', 2], c: x}\nd:\n  - e: |\n      text\n    f: .5\n"
    fast = yaml_io.parse_yaml(text, "c.yaml", ErrorList())
    monkeypatch.setattr(yaml_io, "LOADER", yaml.SafeLoader)
    assert yaml_io.parse_yaml(text, "c.yaml", ErrorList()) == fast
    assert fast.data == {"é": {"b": [1, "é", 2], "c": "x"}, "d": [{"e": "text\n", "f": 0.5}]}
    assert fast.origin(("é", "b", 2))[:3] == ("c.yaml", 1, 17)
    assert fast.key_origin(("d", 0, "f"))[:3] == ("c.yaml", 5, 5)


@pytest.mark.parametrize("text", ["1e5", "7", "true", "~", ".nan", ""])
def test_what_stands_in_quotes_is_text(text):
    faults = ErrorList()
    assert yaml_io.parse_yaml(f"a: '{text}'\nb: \"{text}\"\n", "c.yaml", faults).data == {"a": text, "b": text}
    assert not faults
