"""The command in surroundings that are not a developer's: no variable set, other locales, output that goes nowhere.

All processes here have an environment built from nothing, but for the cache of kernels.
"""

import os
import subprocess
import sys

import pytest
from click.testing import CliRunner

from radarsim.cli.command_group import main
from radarsim.language.current import VARIABLE
from tests.forked_programs import ROOT, Start
from tests.program import command, csv_bytes, newcomer

# Streams always have the encoding that is named; files ASCII, where the locale is not installed and cannot be compiled.
LOCALE = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
TURKISH = LOCALE | {"LC_ALL": "tr_TR.ISO-8859-9", "PYTHONIOENCODING": "iso8859-9"}
RUSSIAN = LOCALE | {"LC_ALL": "ru_RU.KOI8-R", "PYTHONIOENCODING": "koi8-r", VARIABLE: "ru"}
NAMES = "нет", "Iğdır"  # of files: Cyrillic, and letters whose capitals differ in Turkish

PLAIN = "import io, os, runpy, sys\nsys.argv[0] = 'radarsim'\n"
COMMAND = "from radarsim.cli import entry\nentry()"
REPRODUCE = "runpy.run_module('radarsim.cli.reproduce', run_name='__main__')"
# How the numbered descriptor is before the command begins.
FULL = "os.dup2(os.open('/dev/full', os.O_WRONLY), {number})\n"
NO_READER = "reader, writer = os.pipe()\nos.close(reader)\nos.dup2(writer, {number})\nos.close(writer)\n"
UNBUFFERED = "sys.stdout = sys.__stdout__ = io.TextIOWrapper(open(1, 'wb', 0, closefd=False), write_through=True)\n"
CLOSED = "os.close({number})\nsys.std{name} = sys.__std{name}__ = None\n"
LINE = "output: cannot be written: No space left on device\n"


@pytest.fixture(scope="module")
def locales(tmp_path_factory):
    """A folder with the Turkish and the Russian locale; empty where the system has no sources to compile them from."""
    folder = tmp_path_factory.mktemp("locales")
    for name in (TURKISH["LC_ALL"], RUSSIAN["LC_ALL"]):
        language, _, encoding = name.partition(".")
        words = ["localedef", "--quiet", "-i", language, "-f", encoding, str(folder / name)]
        try:
            subprocess.run(words, env=newcomer(folder), stderr=subprocess.DEVNULL, check=False)
        except FileNotFoundError:
            break
    return folder


@pytest.fixture(scope="module")
def start(tmp_path_factory, locales):
    """Processes in the Turkish locale."""
    home, place = tmp_path_factory.mktemp("home"), tmp_path_factory.mktemp("printed")
    with Start(place, inherit=False, **newcomer(home, LOCPATH=str(locales), **TURKISH)) as start:
        yield start


def run(start, words, out="", err="", code=COMMAND, **options):
    """The command, once the descriptors of its output and errors are as told."""
    prepared = out.format(number=1, name="out") + err.format(number=2, name="err")
    return start.run(*words, code=PLAIN + prepared + code, **options)


def test_errors_that_cannot_be_written_leave_the_exit_code(start):
    """Those of the program, of its parser, and of the other module that is a program."""
    fault, usage = ["check", "nope"], ["list", "--bogus"]
    for words, out, err in (
        (fault, "", FULL),
        (usage, "", FULL),
        (fault, FULL, FULL),
        (usage, CLOSED, CLOSED),
        (usage, NO_READER, NO_READER),
    ):
        done = run(start, words, out, err)
        assert (done.returncode, done.stdout, done.stderr) == (2, "", ""), (words, out, err)
    assert run(start, ["out", "nope"], "", FULL, REPRODUCE).returncode == 2


def test_an_answer_that_cannot_be_written_is_not_done(start):
    """Short and longer than any buffer, from commands, from options that come before them, for a shell's tab key."""
    tab = {"_RADARSIM_COMPLETE": "bash_complete", "COMP_WORDS": "radarsim ru", "COMP_CWORD": "1"}
    for done in (
        run(start, ["list", "--json"], FULL),
        run(start, ["schema"], FULL),
        run(start, ["--version"], FULL),
        run(start, [], FULL, **tab),
        run(start, ["--help"], FULL, code=REPRODUCE),
    ):
        assert (done.returncode, done.stderr) == (4, LINE)
    assert run(start, ["--help"], FULL, FULL).returncode == 4


def test_an_answer_that_nobody_reads_is_no_fault(start):
    for words, out, err in ((["schema"], NO_READER, ""), (["--help"], NO_READER, ""), (["--help"], CLOSED, CLOSED)):
        done = run(start, words, out, err)
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_a_run_ends_its_work_whatever_becomes_of_its_output(start, tmp_path):
    """Of two configs the first prints an answer and a warning, of few realisations; neither stops the second."""
    few = ["run", "rls2", "rls4", "-n", "50", "--no-figures", "--out", tmp_path]
    assert run(start, few, FULL + UNBUFFERED, FULL).returncode == 4
    assert len(list(tmp_path.glob("*/report.html"))) == 2
    unmet = ["run", "rls2", "-n", "3000", "--precision", "0.01", "--no-figures", "--out", tmp_path]
    done = run(start, unmet, FULL)
    assert (done.returncode, done.stderr.splitlines(keepends=True)[-1]) == (3, LINE)  # that of the work itself


def test_a_pipe_that_does_not_block_takes_the_whole_answer(start):
    """As some programs hand it to those they start; the reader begins when the pipe is full."""
    piped = (
        "import threading, time\nreader, writer = os.pipe()\nos.set_blocking(writer, False)\nos.dup2(writer, 1)\n"
        "os.close(writer)\nsize = []\n"
        "def read():\n    time.sleep(0.2)\n    while part := os.read(reader, 65536): size.append(len(part))\n"
        "thread = threading.Thread(target=read)\nthread.start()\n"
        "try:\n    from radarsim.cli import entry\n    entry()\n"
        "finally:\n    os.close(1)\n    thread.join()\n    print(sum(size), file=sys.stderr)\n"
    )
    done = start.run("schema", code=PLAIN + piped)
    assert (done.returncode, int(done.stderr)) == (0, len(in_turkish(command("schema").stdout)))


def in_turkish(answer):
    """The bytes of an answer in the Turkish encoding: a question mark for all that it lacks."""
    return answer.encode(TURKISH["PYTHONIOENCODING"], "replace")


def test_answers_are_the_same_in_every_locale(start, tmp_path):
    for words in (["list"], ["claims", "--out", str(tmp_path)], ["check", "rls2"], ["solve", "--help"]):
        done = run(start, words, COLUMNS="82")  # of which help takes 80, as the runner does
        expected = in_turkish(CliRunner().invoke(main, words, prog_name="radarsim").stdout)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.encode("utf-8", "surrogateescape") == expected, words


def file_commands(folder):
    """Commands that write files into a folder, where they find a table."""
    example = ROOT / "docs" / "examples" / "range_doppler.csv"
    return (
        ["run", "rls2", "-n", 200, "--no-figures", "--out", folder],
        ["import", folder / "table", "-o", folder / "imported.csv"],
        ["track", "rls2", example, "-o", folder / "track.csv"],
        ["new", "mine", "--like", "rls2"],
    )


@pytest.fixture(scope="module")
def expected_files(tmp_path_factory):
    """A folder with a table and what the commands make in this process."""
    folder = tmp_path_factory.mktemp("expected")
    (folder / "table").write_text("time;range_km;İsim\n0;100,5;ı\n10;99,25;I\n20;98,1;i\n", encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv(VARIABLE, "ru")
        for words in file_commands(folder):
            command(*words)
    return folder


@pytest.mark.slow
def test_files_are_the_same_in_every_locale(start, tmp_path, expected_files):
    """With the libraries' number formats those of the locale, as a program that has windows sets it."""
    (tmp_path / "table").write_bytes((expected_files / "table").read_bytes())
    localised = "import locale\ntry: locale.setlocale(locale.LC_ALL, '')\nexcept locale.Error: pass\n" + COMMAND
    for words in file_commands(tmp_path):
        done = run(start, words, code=localised, cwd=tmp_path, **{VARIABLE: "ru"})
        assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    assert csv_bytes(tmp_path / "rls2") == csv_bytes(expected_files / "rls2")
    assert csv_bytes(tmp_path) == csv_bytes(expected_files)
    assert (tmp_path / "mine.yaml").read_bytes() == (expected_files / "mine.yaml").read_bytes()
    pages = [(folder / "rls2" / "report.html").read_text(encoding="utf-8") for folder in (tmp_path, expected_files)]
    assert pages[0].count("\n") == pages[1].count("\n")


@pytest.mark.slow
def test_names_that_an_encoding_does_not_have(start, tmp_path):
    """A config and results in folders of such names; of a file that is not there the fault is told."""
    code = start.run(code="import sys; print(sys.getfilesystemencoding())").stdout.strip()

    def argument(name):
        """As Python decodes it there."""
        return os.fsencode(name).decode(code, "surrogateescape")

    for name in NAMES:
        (tmp_path / name).mkdir()
        (tmp_path / name / "rls2.yaml").write_bytes((ROOT / "configs" / "rls2.yaml").read_bytes())
    config = argument(f"{NAMES[0]}/rls2.yaml")
    done = run(start, ["run", config, "-n", "50", "--no-figures", "--out", argument(NAMES[1])], cwd=tmp_path)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    assert (tmp_path / NAMES[1] / "rls2" / "curves.csv").exists()
    for words in (["check", f"{NAMES[1]}.yaml"], ["import", f"{NAMES[0]}.csv", "-o", "plots.csv"]):
        done = run(start, map(argument, words), cwd=tmp_path)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr


@pytest.mark.parametrize("variables", [{"LANG": "C"}, RUSSIAN], ids=["C", "KOI8-R"])
def test_the_interpreter_itself_starts_there(tmp_path, locales, monkeypatch, variables):
    surroundings = newcomer(tmp_path, LOCPATH=str(locales)) | variables
    words = [sys.executable, "-m", "radarsim", "check", "rls2"]
    done = subprocess.run(words, cwd=ROOT, env=surroundings, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    if language := variables.get(VARIABLE):
        monkeypatch.setenv(VARIABLE, language)
    assert done.stdout == command("check", "rls2").stdout.encode(variables.get("PYTHONIOENCODING", "utf-8"), "replace")
