"""Commands that store nothing, stopped by a signal: the exit code, one line, nothing half written."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from radarsim.cli import early_end
from radarsim.errors import Interruption

LONG = {
    "solve": [
        "solve",
        "ambiguous_rls2",
        "radar.sigma_velocity_mps",
        *("--right", "memory", "--equals", "99", "-n", "1e6"),
    ],
    "sensitivity": ["sensitivity", "multimodel_1hz", "-n", "1e6"],
    "chart": ["chart", "manoeuvre_variance"],
}


def obedient():
    """As from a terminal: a shell lets what it starts in the background ignore SIGINT."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def until_it_listens(process):
    """Until the command has set its handlers: before that, Python's own or none would answer."""
    while not caught(process.pid) >> signal.SIGTERM - 1 & 1:
        assert process.poll() is None
        time.sleep(0.02)


def caught(number):
    """The signals that a process handles, as a mask."""
    status = Path(f"/proc/{number}/status").read_text()
    return int(next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt")), 16)


def ended_by(number, options, folder, after_s):
    """A command that gets a signal so long after it listens ends with its exit code, one line and no file."""
    with subprocess.Popen(
        [sys.executable, "-m", "radarsim", *options],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=obedient,
    ) as process:
        until_it_listens(process)
        time.sleep(after_s)
        process.send_signal(number)
        try:
            said, error = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 128 + number, error
    assert said == ""
    assert error == f"stopped by {'Ctrl-C' if number == signal.SIGINT else 'SIGTERM'}\n"
    assert not [path for path in folder.rglob("*") if path.is_file()]


@pytest.mark.slow_cases_except("solve-2", "chart-15")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", LONG)
def test_a_signal_ends_it_with_one_line_and_no_file(name, number, tmp_path):
    ended_by(number, LONG[name], tmp_path, after_s=0.5)


def test_an_exception_that_a_library_makes_of_the_signal_is_still_the_signal():
    @early_end.stop_on_signals()
    def importing():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.1)
        except Interruption as error:
            _late().cancel()
            raise RuntimeError("an import that failed") from error

    with pytest.raises(Interruption):
        importing()


def test_a_signal_that_is_swallowed_ends_the_process_a_little_later(monkeypatch):
    left = []
    monkeypatch.setattr(early_end, "PATIENCE_S", 0.05)
    monkeypatch.setattr(early_end, "fail", left.append)
    with early_end.stop_on_signals():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.1)
        except Interruption:
            pass
        time.sleep(0.3)
    assert [error.exit_code for error in left] == [143]


def test_what_python_swallows_of_a_signal_is_not_printed(capsys, monkeypatch):
    """As in a finaliser, or in what a C library calls; faults of another kind are printed as ever."""

    class Dying:
        def __init__(self, fault):
            self.fault = fault

        def __del__(self):
            raise self.fault

    monkeypatch.setattr(sys, "unraisablehook", sys.__unraisablehook__)
    with early_end.stop_on_signals():
        Dying(Interruption(signal.SIGTERM, goes_on=False))
        assert capsys.readouterr().err == ""
        Dying(ValueError("another"))
        assert "another" in capsys.readouterr().err
    assert sys.unraisablehook is sys.__unraisablehook__


def test_other_faults_pass_and_handlers_are_as_before():
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with pytest.raises(KeyError), early_end.stop_on_signals():
        {}["x"]
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before


def test_an_ignored_signal_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with early_end.stop_on_signals():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def _late():
    """The timer that a signal has started."""
    (timer,) = [thread for thread in threading.enumerate() if isinstance(thread, threading.Timer)]
    return timer
