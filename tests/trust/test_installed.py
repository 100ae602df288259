"""Installed from sdist and wheel, with the oldest and newest packages allowed, by other Pythons, on a read-only disk.

Each in an environment of its own, which takes an index of packages and minutes: `make slow`.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from radarsim.app import doctor

ROOT = Path(__file__).parents[2]
CONSTRAINTS = ["-c", str(ROOT / "constraints.txt")]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
NEEDED = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["cluster"]]
OTHERS = ("3.12", "3.13", "3.14")  # beside the one that the suite runs on
pytestmark = pytest.mark.slow


def lowest(needed):
    """`name==X` of `name>=X`."""
    assert all(re.fullmatch(r"[A-Za-z0-9_.-]+>=[0-9.]+", one) for one in needed)
    return [one.replace(">=", "==") for one in needed]


def environment(place, *requirements, interpreter=sys.executable):
    """The interpreter of a new environment that holds these packages and what they need."""
    subprocess.run([interpreter, "-m", "venv", place], check=True)
    python = str(place / "bin/python")
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *map(str, requirements)]
    done = subprocess.run(pip, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return python


def sources(place):
    """A copy of what a release is made of."""
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info", "build")
    for name in ("radarsim", "configs", "scenarios"):
        shutil.copytree(ROOT / name, place / name, symlinks=True, ignore=ignored)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, place)
    return place


def told(python, place, *arguments, before=(), code=0):
    """What a command of the installed package prints, run in a folder without the sources; all it keeps lies there."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "RADARSIM_"))}
    own = {"HOME": str(place), "RADARSIM_CACHE_DIR": str(place / "cache")}
    command = [*before, python, "-m", *map(str, arguments)]
    done = subprocess.run(command, cwd=place, env=clean | own, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout


def proved(python, place):
    """The self-test, and the commands that a user meets first."""
    place.mkdir()
    report = json.loads(told(python, place, "radarsim", "doctor", "--json"))
    assert {one["study"] for one in report["self-test"] if "known" in one["words"]} >= set(doctor.TOLERANCES)
    told(python, place, "radarsim", "run", "rls2", "-n", 10_000, "--out", "results")
    told(python, place, "radarsim", "run", "rls2", "-n", 20_000, "--out", "results", "--workers", 1, "--no-figures")
    assert "all intact" in told(python, place, "radarsim", "doctor", "results/rls2", "--recompute", 1)
    told(python, place, "radarsim", "simulate", "sonar_smoothing", "-o", "plots.csv")
    told(python, place, "radarsim", "track", "sonar_smoothing", "plots.csv", "-o", "track.csv", "--report", "drawn")
    told(python, place, "radarsim", "new", "mine", "--like", "multimodel")
    told(python, place, "radarsim", "check", "mine.yaml", "--set", "realisations=4000", "--precision", 5)
    assert "must be > 0" in told_fault(python, place, "radarsim", "check", "rls2", "--set", "radar.wavelength_m=-1")


def told_fault(python, place, *arguments):
    """What a command that is refused says."""
    command = [python, "-m", *arguments]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    return done.stderr


def drawn(python, place):
    """Every shipped config with few realisations, its tables, figures, report and claims."""
    told(python, place, "radarsim.cli.reproduce", "all", "--set", "realisations=200")


def test_sdist_and_wheel_in_a_bare_environment(tmp_path):
    """The wheel is built from the sdist, as `python -m build` does, so both hold all that is needed."""
    builder = environment(tmp_path / "builder", "build>=1.2")
    release = tmp_path / "release"
    told(builder, sources(tmp_path / "sources"), "build", "--outdir", release)
    (sdist,), (wheel,) = release.glob("*.tar.gz"), release.glob("*.whl")
    python = environment(tmp_path / "bare", *CONSTRAINTS, f"{wheel}[cluster]")
    proved(python, tmp_path / "wheel")
    pip = ["pip", "install", "--quiet", "--force-reinstall", "--no-deps", sdist]
    told(python, tmp_path / "wheel", *pip)
    assert "0 of them" not in told(python, tmp_path / "wheel", "radarsim", "list")
    report = json.loads(told(python, tmp_path / "wheel", "radarsim", "doctor", "--json"))
    assert all("known" in one["words"] for one in report["self-test"])


@pytest.mark.parametrize("wanted", [lowest, lambda needed: ["--upgrade", *needed]], ids=["lowest", "newest"])
def test_the_oldest_and_the_newest_packages_allowed(tmp_path, wanted):
    python = environment(tmp_path / "own", *wanted(NEEDED), sources(tmp_path / "sources"))
    proved(python, tmp_path / "proof")
    drawn(python, tmp_path / "proof")


@pytest.mark.parametrize("version", OTHERS)
def test_another_python(tmp_path, version):
    known = (shutil.which(f"python{version}"), *Path.home().glob(f".pyenv/versions/{version}.*/bin/python3"))
    found = next((one for one in known if one and subprocess.run([one, "-c", ""], check=False).returncode == 0), None)
    if found is None:
        pytest.skip(f"no Python {version} here")
    python = environment(tmp_path / "own", *CONSTRAINTS, *NEEDED, sources(tmp_path / "sources"), interpreter=found)
    proved(python, tmp_path / "proof")


READ_ONLY = (
    'mount --make-rprivate / && mount -t tmpfs none "$0" && mkdir "$0/out" && '
    'mount -o remount,ro,bind / && if [ "$1" = full ]; then mount -o remount,ro "$0"; fi && shift && exec "$@"'
)


def test_a_disk_that_is_read_only_but_for_the_results(tmp_path):
    """As in a container: no cache of kernels, no home, no temporary directory; one line says so, and nothing fails."""
    python, results = sys.executable, tmp_path / "results"
    results.mkdir()

    def within(*arguments, state="free"):
        unshared = ["unshare", "-m", "sh", "-c", READ_ONLY, str(results), state]
        nowhere = {"HOME": "/nowhere", "TMPDIR": "/nowhere", "RADARSIM_CACHE_DIR": "/nowhere", "PYTHONPATH": str(ROOT)}
        command = [*unshared, python, "-m", "radarsim", *map(str, arguments)]
        return subprocess.run(
            command, cwd=tmp_path, env=os.environ | nowhere, capture_output=True, text=True, check=False
        )

    if shutil.which("unshare") is None or within("--help").returncode != 0:
        pytest.skip("no file systems of one's own here")
    options = ("rls2", "-n", 2000, "--no-figures", "--out", results / "out")
    done = within("run", *options)
    assert done.returncode == 0, done.stderr
    (line,) = done.stderr.splitlines()
    assert re.match("warning: kernel cache: .*cannot be written.*each run compiles again", line)
    assert str(results / "out") in done.stdout
    refused = within("run", *options, state="full")
    assert refused.returncode == 4
    assert re.fullmatch(rf"{results}.*: cannot be written: Read-only file system\n", refused.stderr)
    followed = within("track", "rls2", ROOT / "docs/examples/range_doppler.csv", state="full")
    assert followed.returncode == 0
    assert followed.stdout.startswith("t_s,filter,component,unit,estimate,sigma\n")
