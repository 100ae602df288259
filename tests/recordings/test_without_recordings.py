"""Without the folder of recorded plots, the program runs, reports, solves and judges."""

import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# An editable installation finds modules in the checkout that the copy lacks.
START = """
import sys
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in repr(finder)]
"""
COMMAND = "from radarsim.cli import entry; entry()"
JUDGE = """
import radarsim
result = radarsim.judge("rls2", lambda plots: plots["range_m"], name="raw", realisations=500)
print(sorted(set(result.curves["filter"])))
"""
SOLVE = ("rls2", "radar.sigma_velocity_mps", "--gain", "r", "--filter", "r+Vr", "--at", "60", "--equals", "30")


@pytest.fixture(scope="module")
def core(tmp_path_factory, libraries):
    """A function that runs the program without the folder: a command, or other code."""
    folder = tmp_path_factory.mktemp("core")
    shutil.copytree(ROOT / "radarsim", folder / "radarsim", ignore=shutil.ignore_patterns("__pycache__", "recordings"))

    def run(*words, code=COMMAND):
        done = libraries.run(*words, code=START + code, path=[folder], cwd=folder)
        assert done.returncode == 0, done.stderr
        return done.stdout

    run.folder = folder
    return run


def test_commands_of_recorded_plots_are_gone(core):
    text = core("--help")
    assert "judge" in text
    assert "\n  track " not in text


def test_rls2_runs_reports_solves_and_judges(core):
    core("run", "rls2", "-n", 2000, "--out", "results", "--set", "figures=[gain_r]")
    (core.folder / "results/rls2/report.html").unlink()
    core("report", "rls2", "-n", 2000, "--out", "results", "--no-figures")
    assert (core.folder / "results/rls2/report.html").is_file()
    assert "radar.sigma_velocity_mps" in core("solve", *SOLVE)
    assert core(code=JUDGE) == "['r', 'r+Vr', 'raw']\n"
