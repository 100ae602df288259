"""What commands show on a terminal of 80 columns, in English and in Russian: whole lines, and nothing in English."""

import itertools
import random
import re

import pytest

from radarsim.cli import progress as cli_progress
from radarsim.cli.command_group import main
from radarsim.language.current import VARIABLE
from tests.language.test_russian import NAMES, untranslated
from tests.program import Terminal

WIDTH = 80
FIRST = "rls2"
COMMANDS = {
    "run": ["run", FIRST, "-n", "3000", "--no-figures"],
    "report": ["report", FIRST, "-n", "3000", "--no-figures"],
    "sweep": [
        "run",
        FIRST,
        "--set",
        "sweep={radar.sigma_velocity_mps: [5, 15]}",
        "-n",
        "300",
        "--no-figures",
        "--out",
        "swept",
    ],
    "check": ["check", FIRST, "-n", "1e5"],
    "precision": ["check", "rls4", "--precision", "2"],
    "claims": ["claims", FIRST],
    "solve": ["solve", FIRST, "radar.sigma_velocity_mps", "--gain", "r", "--at", "60", "--equals", "30"],
    "unattained": ["solve", FIRST, "radar.sigma_velocity_mps", "--gain", "r", "--at", "60", "--equals", "99"],
    "sensitivity": ["sensitivity", FIRST, "--no-figures"],
    "chart": ["chart", FIRST, "--no-figures"],
    "compare": ["compare", FIRST, "rls4", "--no-figures"],
    "clean": ["clean", "--dry-run"],
    "doctor": ["doctor", f"results/{FIRST}"],
    "list": ["list", "sonar"],
    "new": ["new", "mine", "--like", FIRST],
    "simulate": ["simulate", FIRST, "-o", "plots.csv"],
    "track": ["track", FIRST, "plots.csv", "-o", "track.csv"],
}
KEPT = NAMES | {  # what a user types and names of the config's own
    *("radarsim", "run", "check", "claims", "rls", "track", "plots", "mine", "yaml", "results", "new", "study"),
    *("must", "got"),  # faults of a config are told in English
    *("target", "sonar", "with", "start", "set", "between", "make", "reproduce", "figures", "compare"),
    *("chart", "blocks"),
}


def shown(monkeypatch, *arguments):
    """What a command writes to both streams of a terminal, without colours and bars."""
    out, err = Terminal(), Terminal()
    with monkeypatch.context() as patch:
        patch.setattr("sys.stdout", out)
        patch.setattr("sys.stderr", err)
        patch.setattr(cli_progress, "SILENT_S", 1e6)
        with pytest.raises(SystemExit):
            main(list(arguments))
    return [re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", one.getvalue()) for one in (out, err)]


@pytest.fixture
def results(tmp_path, monkeypatch):
    """A folder of its own, with results of two radars and plots."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    for name in (FIRST, "rls4"):
        shown(monkeypatch, "run", name, "-n", "3000", "--no-figures", "-q")
    shown(monkeypatch, "simulate", FIRST, "-o", "plots.csv")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", "ru"])
def test_every_command_is_whole_at_eighty_columns(results, monkeypatch, language):
    monkeypatch.setenv(VARIABLE, language)
    told = {name: shown(monkeypatch, *arguments) for name, arguments in COMMANDS.items()}
    for name, (out, err) in told.items():
        assert out or err, name
        for line in (out + err).split("\n"):
            whole = line.startswith(("check ", "проверка "))  # a command, to be copied
            assert len(line) <= WIDTH or whole or "/" in line, (name, line)
        assert "�" not in out, name
    rows = [line for line in told["run"][0].split("\n") if line.startswith((" r ", " r+Vr "))]
    assert len(rows) == 6
    for name in ("run", "report", "sweep", "sensitivity"):
        lines = told[name][0].split("\n")
        head = next(above for above, line in itertools.pairwise(lines) if line.startswith(" ───"))
        assert any(gain in head for gain in ("gain", "выигрыш")), (name, head)
    assert "σ_V = 5 " in told["sweep"][0]
    assert len([line for line in told["compare"][0].split("\n") if " %" in line and "[" in line]) == 6
    assert all(re.search(r" … [\d,.]+", row) for row in rows)  # no interval is broken
    if language == "ru":
        left = {
            name: found
            for name, (out, _) in told.items()
            if name != "list"  # whose lines are the files' own
            and (found := untranslated(re.sub(r"\S*[/=_.]\S*|--\w+", " ", out), KEPT))
        }
        assert left == {}


def test_what_is_piped_stays_in_one_line_and_speaks_english(results, monkeypatch, capsys):
    with pytest.raises(SystemExit):
        main(["claims", FIRST, "--parts"])
    lines = capsys.readouterr().out.splitlines()
    assert any(len(line) > WIDTH for line in lines)
    assert lines[0].startswith("P1.18  ")
    assert re.search(r"; measured [\d.]+ \[.*\] %$", lines[2])


class Clock:
    """A clock that goes when it is told to."""

    now = 1000.0

    def monotonic(self):
        return self.now


def bar(monkeypatch, of=cli_progress.Progress):
    """A clock of one's own, and a bar on a terminal that goes by it."""
    clock = Clock()
    monkeypatch.setattr("sys.stderr", Terminal())
    monkeypatch.setattr(cli_progress, "time", clock)
    return clock, of(FIRST, quiet=False)


def test_a_bar_of_foretold_time_never_goes_back(monkeypatch):
    """Where more turns out to be ahead, the share waits, and the time left is what is foretold."""
    clock, progress = bar(monkeypatch, cli_progress.TimedProgress)
    with progress:
        texts = []
        for total in (4000, 16_000, 16_000):
            clock.now += 2
            progress.update(round(1000 * (clock.now - Clock.now)), total, 0)
            texts.append(progress.bar.tasks[0].fields["text"].split())
    assert [words[0] for words in texts] == ["50.0", "50.0", "50.0"]
    assert [words[2] for words in texts] == ["0:00:02", "0:00:12", "0:00:10"]


def test_a_bar_says_in_the_language_what_is_left(monkeypatch):
    monkeypatch.setenv(VARIABLE, "ru")
    clock, progress = bar(monkeypatch)
    with progress:
        progress.update(0, 200, 0)
        clock.now += 2
        progress.update(50, 200, 0)
        told = progress.bar.tasks[0].fields["text"]
        progress.update(200, 200, 0)
        done = progress.bar.tasks[0].fields["text"]
    assert told.startswith(" 25,0 %")
    assert "осталось 0:00:06, затем результаты" in told
    assert "осталось" not in done


@pytest.mark.parametrize("seed", range(5))
def test_a_bar_foretells_within_a_factor_of_two_what_is_left(monkeypatch, seed):
    """After a slow compilation and what is stored, of runs that take up to four times as long as others."""
    clock, progress = bar(monkeypatch)
    draw = random.Random(seed)
    runs = [0.0] * 20 + [draw.uniform(0.5, 2.0) for _ in range(40)]
    ends, done, held = clock.now + 30 + sum(runs), 0, 0
    clock.now += 30
    with progress:
        for seconds in runs:
            progress.update(done, 6000, held)
            clock.now += seconds
            done, held = done + 100, held + 100 * (not seconds)
            progress.update(done, 6000, held)
            if 2500 <= done <= 5500:
                told = re.search(r"(\d+):(\d+):(\d+) left", progress.bar.tasks[0].fields["text"]).groups()
                hours, minutes, rest = map(int, told)
                assert 0.5 <= (3600 * hours + 60 * minutes + rest) / (ends - clock.now) <= 2
