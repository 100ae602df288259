"""Plain words of YAML, values from Python, and how both are quoted."""

import math

import numpy as np
import pytest

from radarsim.config.error_list import ErrorList, Origin
from radarsim.config.scalars import NotFinite, from_python, from_text
from radarsim.config.value_text import quoted_value, short_number
from radarsim.errors import ConfigError

NUMBERS = {
    "1e5": 1e5,
    "1E5": 1e5,
    "1e-3": 1e-3,
    "1.5e+3": 1500.0,
    ".5": 0.5,
    "-.5": -0.5,
    "1.": 1.0,
    "+3": 3,
    "-7": -7,
    "0": 0,
    "-0": 0,
    "0.15": 0.15,
    "18446744073709551615": 2**64 - 1,
    "1e-400": 0.0,
}
TEXTS = [
    "1_000",
    "010",
    "1:30",
    "0x10",
    "0o7",
    "yes",
    "no",
    "on",
    "off",
    "True",
    "FALSE",
    "1e",
    "e5",
    ".",
    "--1",
    "1 2",
    "nan",
    "inf",
    "2017-01-01",
    "1,5",
    "٣",
    "<<",
]


@pytest.mark.parametrize(("text", "number"), NUMBERS.items())
def test_numbers(text, number):
    assert from_text(text) == number
    assert type(from_text(text)) is type(number)


@pytest.mark.parametrize("text", TEXTS)
def test_what_only_looks_like_a_number_or_a_truth_is_text(text):
    assert from_text(text) == text


@pytest.mark.parametrize("text", [".nan", ".NaN", ".inf", "-.inf", "+.INF", "1e999", "-1e999", "9" * 5000])
def test_numbers_that_are_none_are_refused(text):
    with pytest.raises(NotFinite):
        from_text(text)


def test_words():
    assert from_text("true") is True
    assert from_text("false") is False
    assert [from_text(text) for text in ("", "~", "null")] == [None] * 3


def test_numpy_values_become_plain():
    faults = ErrorList()
    value = from_python(
        {"a": np.float64(1.5), "b": np.arange(3), "c": (np.int64(2), "x"), 5: True}, (), Origin("config"), faults
    )
    assert value == {"a": 1.5, "b": [0, 1, 2], "c": [2, "x"], "5": True}
    assert not faults


@pytest.mark.parametrize(
    ("value", "line"),
    [
        (math.nan, "config: a: must be a finite number, got nan"),
        (-math.inf, "config: a: must be a finite number, got -inf"),
        (10**400, "config: a: must be a finite number, got a number of more than 30 digits"),
        (None, "config: a: has no value"),
        ({1, 2}, "config: a: must be text, a number, true or false, a list or a mapping, got set"),
        (1j, "config: a: must be text, a number, true or false, a list or a mapping, got complex"),
        (np.array([1.0, np.nan]), "config: a.1: must be a finite number, got nan"),
    ],
)
def test_python_values_refused(value, line):
    faults = ErrorList()
    from_python({"a": value}, (), Origin("config"), faults)
    with pytest.raises(ConfigError) as caught:
        faults.raise_if_any()
    assert caught.value.lines == (line,)


def test_a_mapping_that_holds_itself_ends():
    endless = {}
    endless["a"] = endless
    faults = ErrorList()
    from_python(endless, (), Origin("config"), faults)
    with pytest.raises(ConfigError, match=r"config: a\.a\.a: nested more than 50 deep"):
        faults.raise_if_any()


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (1e-3, "0.001"),
        (1e-5, "1e-5"),
        (1e5, "100000"),
        (1e22, "1e22"),
        (10**12, "1e12"),
        (-25e8, "-25e8"),
        (12345678, "12345678"),
        (1e6, "1000000"),
        (1.5e-12, "1.5e-12"),
        (-250, "-250"),
        (0.1, "0.1"),
    ],
)
def test_short_numbers_read_back(number, text):
    assert short_number(number) == text
    assert float(text) == number


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("abc", "'abc'"),
        (True, "true"),
        (None, "nothing"),
        ([1, "a", [2.0]], "[1, 'a', [2]]"),
        ({"a": 1e5, "b": False}, "{a: 100000, b: false}"),
        ("line\nbreak \x1b[31m\u202e", r"'line\nbreak \x1b[31m\u202e'"),
        ("x" * 1000, "'" + "x" * 58 + "…"),
        (list(range(10**6)), "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, …"),
    ],
)
def test_quoted_values_are_short_and_on_one_line(value, text):
    assert quoted_value(value) == text
    assert len(text) <= 60


def test_faults_are_told_file_by_file_from_the_top():
    faults = ErrorList()
    for origin, key in [
        (Origin("b.yaml", 9, 1), "late"),
        (Origin("a.yaml", 3, 1), "other"),
        (Origin("b.yaml", 2, 7), "second"),
        (Origin("b.yaml", 2, 5), "first"),
        (Origin("b.yaml", 2, 5), "first"),
    ]:
        faults.add(origin, (key,), "is wrong")
    with pytest.raises(ConfigError) as caught:
        faults.raise_if_any()
    assert [line.split(": ")[1] for line in caught.value.lines] == ["first", "second", "late", "other"]
