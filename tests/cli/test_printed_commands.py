"""Commands that the program prints can be run as they stand, and replace no answer that is there."""

import re
import shlex
from pathlib import Path

import pytest

from tests.program import command, csv_bytes

PRINTED = re.compile(r"`(radarsim [^`]+)`|^check +(radarsim .+)$", re.MULTILINE)
AT = ("--at", 60)


def printed_commands(text):
    """The commands in what the program has printed, as words without its name; those with a placeholder left out."""
    lines = [backquoted or labelled for backquoted, labelled in PRINTED.findall(text)]
    return [shlex.split(line)[1:] for line in lines if not re.search("CONFIG|NAME|FILE|RESULT", line)]


ANSWERS = {
    "solve": ("solve", "rls2", "radar.sigma_velocity_mps", "--gain", "r", "--filter", "r+Vr", *AT, "--equals", 30),
    "tune": ("tune", "rls2", "--filter", "r", "--for", "sigma r at 60 s"),
}


@pytest.mark.parametrize("kind", ANSWERS)
def test_a_run_that_confirms_an_answer_leaves_the_results_of_the_config(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = ("-n", 500, "--no-figures", "--quiet")
    command("run", "rls2", *run)
    before = csv_bytes(Path("results/rls2"))
    (words,) = printed_commands(command(*ANSWERS[kind]).stdout)
    command(*words, *run)
    assert csv_bytes(Path("results/rls2")) == before
    assert csv_bytes(Path(words[words.index("--out") + 1]) / "rls2") != before


def test_printed_commands_look_where_the_results_are(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = ("--out", "els where")
    printed = command("run", "rls2", "-n", 500, "--no-figures", *out).stdout
    printed += command("claims", "P1.18", "P1.1", *out).stdout
    printed += command("report", "rls2", "-n", 900, *out, code=2).stderr
    printed += command("run", "rls2", "-n", 500, "--seed", 5, *out, code=2).stderr
    commands = printed_commands(printed)
    assert {words[0] for words in commands} == {"claims", "run"}
    for words in commands:
        assert words[-2:] == [*out] or words[-3:] == [*out, "--replace"]
        command(*words, *(["--no-figures"] if words[0] == "run" else []))
