"""How `make test` divides the suite: both parts run, their exit codes count, groups of tests stay together."""

import re
import shutil
import signal
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PYTHON = """#!/bin/sh
echo "$*" >> {calls}
case "$*" in
*"and not alone"*) {first} ;;
*) {second} ;;
esac
"""


@pytest.fixture
def make_test(tmp_path):
    """`make test` with shell commands in the place of its two parts: its exit code, and how many parts it began."""
    if not shutil.which("make"):
        pytest.skip("no make here")

    def run(first: str, second: str) -> tuple[int, int]:
        python, calls = tmp_path / "bin" / "python", tmp_path / "calls"
        python.parent.mkdir(exist_ok=True)
        python.write_text(PYTHON.format(calls=calls, first=first, second=second))
        python.chmod(0o755)
        calls.write_text("")
        for name in ("installed", "tested"):
            (tmp_path / name).touch()
        words = ["make", "--silent", "test", f"VENV={tmp_path}"]
        # A shell that starts the suite in the background has interrupts ignored in all that it starts.
        ended = subprocess.run(
            words,
            cwd=ROOT,
            capture_output=True,
            start_new_session=True,
            timeout=60,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        return ended.returncode, len(calls.read_text().splitlines())

    return run


@pytest.mark.parametrize(("first", "second", "fails"), [(0, 0, False), (1, 0, True), (0, 1, True), (137, 2, True)])
def test_both_parts_run_and_a_failure_of_either_counts(make_test, first, second, fails):
    code, parts = make_test(f"exit {first}", f"exit {second}")
    assert bool(code) == fails
    assert parts == 2


def test_an_interrupt_ends_both_parts(make_test):
    """Ctrl-C goes to all processes of the terminal's group; pytest then ends with 2."""
    code, parts = make_test("trap 'exit 2' INT; kill -INT 0; sleep 10", "exit 0")
    assert code != 0
    assert parts == 1


@pytest.mark.slow
def test_each_group_of_tests_is_given_to_one_process():
    """Two files of a study, and two files: what each test is preceded by is its process."""
    study = "tests/studies/range_doppler"
    files = [f"{study}/test_closed_form.py", f"{study}/test_chart.py", "tests/physics", "tests/kernels/test_lanes.py"]
    words = ["-m", "pytest", "-vv", "-n", "2", "--dist", "loadscope", "--no-loadscope-reorder", *files]
    ended = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=True)
    processes = defaultdict(set)
    for process, path in re.findall(r"\[(gw\d)\].* (tests/\S+?\.py)::", ended.stdout):
        processes[study if path.startswith(study) else path].add(process)
    assert len(processes) == 4
    assert all(len(names) == 1 for names in processes.values())
    assert len(set.union(*processes.values())) == 2
