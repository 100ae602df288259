"""`make reproduce-figures` in small: a line for each config, the rest goes on after a fault, a summary at the end."""

import os
import signal
import subprocess
import sys
import time

import pytest

from radarsim.api.maintenance import doctor, reproduce

SMALL = ["realisations=100"]


@pytest.mark.slow
def test_a_line_each_a_fault_told_and_a_summary(tmp_path):
    (tmp_path / "rls3").write_text("a file where a folder should be")
    told = []
    done = reproduce.reproduce(["rls2", "rls3", "rls4"], str(tmp_path), told.append, overrides=SMALL, figures=False)
    assert [line[:7] for line in told] == ["[ 1/3] ", "[ 2/3] ", "[ 3/3] "]
    assert {line.split()[2] for line in told} == {"rls2", "rls3", "rls4"}
    assert any("rls3" in line and "FAILED: " in line for line in told)
    assert {one.stem: (bool(one.faults), one.code) for one in done} == {
        **{"rls2": (False, 0), "rls3": (True, 4), "rls4": (False, 0)}
    }
    assert any("rls2" in line and "claims: " in line for line in told)
    summary = reproduce.summary(done, str(tmp_path), 1.0)
    assert any(line.startswith("claims   ") and "not run" in line for line in summary)
    assert any(line.startswith("time     0:00:01") and "3 configs" in line for line in summary)
    (parts,) = [line for line in summary if "statistics" in line]
    whole = [one for one in done if not one.faults]  # the one that failed has no part in where the time went
    seconds = [float(part.split()[1]) for part in parts.split(":")[0].split(",")]
    assert sum(seconds) == pytest.approx(sum(one.seconds for one in whole), abs=2)  # four numbers rounded to seconds
    assert all(one.stages["simulation"] > 0 and one.stages["writing"] > 0 for one in whole)
    assert [one.stem for one in done if not one.stages] == ["rls3"]
    assert "failed   rls3" in summary
    index = (tmp_path / "index.html").read_text()
    assert "rls2/report.html" in index
    assert "rls4/report.html" in index


def test_configs_are_taken_from_both_ends():
    """Neighbours share kernels, which two processes side by side would both compile."""
    assert reproduce.from_both_ends("abcde") == list("aebdc")
    assert reproduce.from_both_ends("abcdef") == list("afbecd")


def dies(stem):
    if stem == "b":
        os.kill(os.getpid(), signal.SIGKILL)
    return reproduce.FinishedConfig(stem, 0.0, "")


@pytest.mark.slow
def test_a_config_with_which_its_process_dies_is_told_and_the_others_are_done():
    done = {one.stem: one for one in reproduce._run_configs(dies, list("abcd"), None)}
    assert "b: its process ended" in done.pop("b").faults[0]
    assert sorted(done) == list("acd")
    assert not any(one.faults for one in done.values())


@pytest.mark.alone
def test_a_signal_ends_it_and_its_processes(tmp_path):
    command = [sys.executable, "-m", "radarsim.cli.reproduce", str(tmp_path), "rls2", "range_doppler"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as run:
        while not list(tmp_path.glob(".blocks/*")):
            assert run.poll() is None
            time.sleep(0.05)
        run.send_signal(signal.SIGINT)
        _, said = run.communicate(timeout=60)  # until the last process has closed it
    assert run.returncode == 128 + signal.SIGINT
    assert "run the same command again to continue" in said


@pytest.mark.slow
def test_two_at_once_into_one_folder(tmp_path):
    """Both end well, and leave what one alone would have left."""
    shell = [sys.executable, "-m", "radarsim.cli.reproduce"]
    options = ["rls2", "rls4", "sonar_smoothing", "--no-figures", "--set", "realisations=3000"]
    both = [
        subprocess.Popen([*shell, str(tmp_path / "both"), *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for _ in range(2)
    ]
    said = [process.communicate() for process in both]
    assert [(process.returncode, errors) for process, (_, errors) in zip(both, said, strict=True)] == [(0, b"")] * 2
    subprocess.run([*shell, str(tmp_path / "one"), *options], check=True, capture_output=True)
    tables = {path.relative_to(tmp_path / "one") for path in (tmp_path / "one").glob("*/*.csv")}
    assert len(tables) > 10
    for path in tables:
        assert (tmp_path / "both" / path).read_bytes() == (tmp_path / "one" / path).read_bytes(), path
    for stem in options[:3]:
        found = doctor.inspect_result(tmp_path / "both" / stem)
        assert (found.faults, found.notes) == ([], []), stem
    assert all(f"{stem}/report.html" in (tmp_path / "both/index.html").read_text() for stem in options[:3])
    assert not [path for path in (tmp_path / "both").rglob("*") if path.suffix in (".tmp", ".damaged")]


@pytest.mark.slow
def test_output_that_nobody_can_take(tmp_path):
    shell = f"{sys.executable} -m radarsim.cli.reproduce {tmp_path} rls2 rls2 --no-figures --set realisations=100"
    full = subprocess.run(f"{shell} > /dev/full", shell=True, capture_output=True, text=True, check=False)
    assert full.returncode == 4
    assert full.stderr == "output: cannot be written: No space left on device\n"
    piped = subprocess.run(["bash", "-c", f"{shell} | head -0"], capture_output=True, text=True, check=False)
    assert piped.stderr == ""


@pytest.mark.alone
def test_its_processes_end_with_it(tmp_path):
    """Killed, it cannot tell them; they see that it is gone."""
    options = [str(tmp_path), "rls2", "rls4", "--set", "realisations=1e9", "--no-figures"]
    command = [sys.executable, "-m", "radarsim.cli.reproduce", *options]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as run:
        while len(list(tmp_path.glob(".blocks/*/*.sums"))) < 2:
            assert run.poll() is None
            time.sleep(0.05)
        run.kill()
        run.communicate(timeout=60)  # ends when the last process has closed its standard error
