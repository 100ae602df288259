"""What the tab key offers where a config is to be named."""

import pytest
from click.shell_completion import ShellComplete

from radarsim.cli.command_group import main


def offered(*words, last):
    """What stands for the last, unfinished word after `radarsim words`."""
    found = ShellComplete(main, {}, "radarsim", "_RADARSIM_COMPLETE").get_completions(list(words), last)
    return [item.value for item in found]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with two configs, one of them deeper, and what is no config."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "away").mkdir()
    for name in ("rl_mine.yaml", "away/rl_other.yaml", "rl_plots.csv", ".hidden.yaml"):
        (tmp_path / name).write_text("study: sonar\n")


@pytest.mark.parametrize("command", [("run",), ("run", "rls1"), ("check",), ("report",), ("claims",), ("simulate",)])
def test_configs_complete_by_name_and_by_file(folder, command):
    found = offered(*command, last="rl")
    assert found[:3] == ["rls1", "rls2", "rls2_manoeuvre_variance"]
    assert found[-1] == "rl_mine.yaml"
    assert "rl_plots.csv" not in found


def test_the_first_of_two_arguments_is_a_config(folder):
    assert "rls2" in offered("track", last="rls")
    assert "rls2" in offered("new", "mine", "--like", last="rls")


def test_files_complete_in_folders(folder):
    assert "away" in offered("run", last="a")
    assert offered("run", last="away/") == ["away/rl_other.yaml"]
    assert offered("run", last="nowhere/x") == []
    assert ".hidden.yaml" not in offered("run", last="")
