"""What `radarsim check` predicts, beside numbers of realisations: what is out of reach, what will have no effect."""

import json

import pytest

from radarsim.api import case_work
from tests.program import command
from tests.tolerances import assert_rounded, rounding


def test_more_realisations_than_a_config_may_ask_for_are_out_of_reach():
    text = command("check", "rls2", "--precision", 1e-5).output
    assert "out of reach" in text
    assert "would do" not in text
    assert "would do" in command("check", "rls2", "--precision", 1e-3).output


def test_a_rate_of_what_the_pilot_never_saw_has_its_bound():
    """Folds at 20 kHz are 300 m/s apart, 20 σ or more: none is wrong, however many the pilot has."""
    options = ("--precision", 10, "--of", "wrong", "-n", 2000, "--set", "radar.repetition_rate_hz=20000")
    text = command("check", "ambiguous_rls5", *options).output
    assert "none observed: below 0.0" in text
    assert "out of reach" not in text


def test_one_realisation():
    assert "1 case, 1 realisation, " in command("check", "rls2", "-n", 1).output


def test_what_is_surely_short_is_not_timed(monkeypatch):
    """30 scans of filters at 1e-7 s; where each realisation has gains of its own at 5e-7 s."""
    monkeypatch.setattr(case_work.CaseWork, "simulate", None)
    text = command("check", "rls2").output
    assert "under 0.3 s" in text
    assert "100,000 realisations, under a second on" in text
    (document,) = json.loads(command("check", "rls2", "--json").stdout)
    (case,) = document["cases"]
    assert (case["timed"], case["seconds"]) == (False, pytest.approx(0.3, rel=rounding(operations=4)))
    (document,) = json.loads(command("check", "rls2", "-n", 1000, "--set", "radar.bias_range_m=5", "--json").stdout)
    assert_rounded(document["cases"][0]["seconds"], 0.015, operations=4)


@pytest.mark.slow_cases("words2")
@pytest.mark.parametrize(
    "words", [("rls2", "-n", 1e7), ("rls2", "-n", 1, "--set", "scans=400"), ("sonar_smoothing", "-n", 1)]
)
def test_what_may_be_long_or_large_or_is_not_counted_is_timed(words):
    (document,) = json.loads(command("check", *words, "--json").stdout)
    assert all(case["timed"] for case in document["cases"])
    assert "under 0" not in command("check", *words).output.replace("under a second", "")
