"""What `radarsim check` predicts, beside numbers of realisations: what is out of reach, what will have no effect."""

import json

import pytest
from click.testing import CliRunner

from radarsim.app import simulation
from radarsim.cli import main


def check(*words):
    ended = CliRunner().invoke(main, ["check", *map(str, words)])
    assert ended.exit_code == 0, ended.output
    return ended


def test_more_realisations_than_a_config_may_ask_for_are_out_of_reach():
    text = check("rls2", "--precision", 1e-5).output
    assert "out of reach" in text
    assert "would do" not in text
    assert "would do" in check("rls2", "--precision", 1e-3).output


def test_one_realisation():
    assert "1 case, 1 realisation, " in check("rls2", "-n", 1).output


@pytest.mark.parametrize(
    ("words", "warned"),
    [
        (["rls2", "--set", "control_variate=true"], False),
        (["rls2"], False),
        (["multimodel_1hz", "--set", "control_variate=true"], False),
        (["discriminator_pair", "--set", "control_variate=true"], True),
        (["discriminator_pair"], False),
    ],
)
def test_a_control_variate_without_effect_is_told_as_by_a_run(words, warned):
    ended = check(*words, "-n", 100)
    assert (f"warning: {simulation.NO_CONTROL}" in ended.stderr) == warned
    (document,) = json.loads(check(*words, "-n", 100, "--json").stdout)
    assert document["warnings"] == [simulation.NO_CONTROL] * warned
