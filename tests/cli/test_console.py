"""What the terminal shows: numbers as sentences have them, and where claims without results are to be had."""

import re

import numpy as np
import pytest
from click.testing import CliRunner

from radarsim.cli import console, main
from radarsim.report.text import significant_digits


@pytest.mark.parametrize(
    ("value", "form", "text"),
    [
        (1695.0, "#.4g", "1695"),
        (0.12, "#.4g", "0.1200"),
        (1.0, "#.4g", "1.000"),
        (-2.151, ".2f", "−2.15"),
        (-0.001, ".2f", "0.00"),
        (-1694.0, "#.4g", "−1694"),
        (0.0, "#.4g", "0.000"),
    ],
)
def test_numbers_of_tables_are_those_of_sentences(value, form, text):
    assert significant_digits(value, form) == text


def test_a_number_that_is_not_known_has_no_unit():
    assert console.known(np.nan, ".2f", " %") == ""
    assert console.known(3.0, ".2f", " %") == "3.00 %"


def test_claims_without_results_say_where_to_find_them(tmp_path):
    result = CliRunner().invoke(main, ["claims", "--out", str(tmp_path / "none")])
    assert result.exit_code == 0
    *_, counted, pointer = result.stdout.splitlines()
    assert re.fullmatch(r"\d+ not run; \d+ extensions not counted", counted.strip())
    assert "make reproduce-figures" in pointer
    assert "docs/claims.md" in pointer
