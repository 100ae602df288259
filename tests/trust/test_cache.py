"""The compiler's cache under stress: cold starts at once, no place to write, no fork with live kernels."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from radarsim.api.maintenance.self_test import KNOWN_FOLDER
from tests.kernels.test_compile import USE, house  # noqa: F401

ROOT = Path(__file__).parents[2]
AT_ONCE = 8


def at_once(program, **environment):
    """Standard outputs of eight interpreters started together, none of which may fail."""
    running = [
        subprocess.Popen(
            program, cwd=ROOT, env=os.environ | environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for _ in range(AT_ONCE)
    ]
    ended = [(*process.communicate(timeout=600), process.returncode) for process in running]
    assert [(code, error) for _, error, code in ended] == [(0, "")] * AT_ONCE
    return [said for said, _, _ in ended]


@pytest.mark.slow
@pytest.mark.parametrize("start", range(20))
def test_eight_cold_starts_at_once(house, start):  # noqa: F811
    """They compile, write and read the same files; every one computes the right value, and the cache then serves."""
    import textwrap

    program = [sys.executable, "-c", textwrap.dedent(USE)]
    places = {"PYTHONPATH": str(house), "RADARSIM_CACHE_DIR": str(house / "cache")}
    assert {said.split()[0] for said in at_once(program, **places)} == {"2.0"}
    assert {said.split()[1] for said in at_once(program, **places)} == {"1"}


@pytest.mark.slow
def test_eight_cold_runs_of_the_command_at_once(tmp_path):
    options = ["-n", "5000", "--no-figures", "--quiet", "--out", str(tmp_path)]
    program = [sys.executable, "-m", "radarsim", "run", str(KNOWN_FOLDER / "range_doppler.yaml"), *options]
    at_once(program, RADARSIM_CACHE_DIR=str(tmp_path / "cache"))
    for name in ("curves", "gains"):
        made = (tmp_path / "range_doppler" / f"{name}.csv").read_bytes()
        assert made == (KNOWN_FOLDER / f"range_doppler.{name}.csv").read_bytes()


@pytest.mark.slow
def test_a_home_that_cannot_be_written(tmp_path):
    """The kernels are kept in the temporary directory then; nothing is said and nothing is lost."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "RADARSIM_"))}
    environment |= {"HOME": "/dev/null", "TMPDIR": str(tmp_path)}
    config = str(KNOWN_FOLDER / "range_doppler.yaml")
    program = [sys.executable, "-m", "radarsim", "run", config, "--no-figures", "--quiet"]
    done = subprocess.run([*program, "--out", str(tmp_path / "r")], cwd=ROOT, env=environment, capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")
    assert list(tmp_path.glob("radarsim-*/kernels-*"))
    told = subprocess.run(
        [sys.executable, "-m", "radarsim", "doctor"], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    assert told.returncode == 0
    assert f"{tmp_path}/radarsim-" in told.stdout


HOOKED = """if True:
    import sys

    def refuse(event, arguments):
        if event in ("os.fork", "os.forkpty"):
            raise RuntimeError("a fork with live kernels")

    if __name__ == "__main__":
        sys.addaudithook(refuse)
        from radarsim.cli.command_group import main
        main(sys.argv[1:])
"""


@pytest.mark.slow
@pytest.mark.parametrize("more", [[], ["--workers", "2"]])
def test_a_run_forks_nothing(tmp_path, more):
    options = ["-n", "50000", "--no-figures", "--quiet", "--out", str(tmp_path), *more]
    program = [sys.executable, "-c", HOOKED, "run", str(KNOWN_FOLDER / "range_doppler.yaml"), *options]
    done = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


SUMS = """
import sys
from radarsim.api.configs import load
from radarsim.api.case_work import CaseWork
for stem in sys.argv[1:]:
    print(CaseWork(load(stem).cases[0]).simulate(0, 72).tobytes().hex())
"""
STUDIES = [
    "rls2",
    "sonar_smoothing",
    "multimodel_families",
    "sonar_manoeuvre",
    "sonar_clutter",
    "discriminator",
    "discriminator_rival",
]


@pytest.mark.slow
def test_a_process_that_compiles_gives_the_bytes_of_one_that_reads_the_cache(tmp_path):
    """Each kernel runs its own copies of what it calls, whatever else is in memory; see `SelfContainedLibrary`."""
    environment = os.environ | {"RADARSIM_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", SUMS, *STUDIES]
    cold, warm = (subprocess.run(command, env=environment, capture_output=True, check=True).stdout for _ in range(2))
    assert cold == warm
    assert len(cold.split()) == len(STUDIES)
