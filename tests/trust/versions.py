"""The lowest and the newest packages that pyproject.toml allows, on each Python at hand, with what a user runs first.

`make version-environments` installs them, which takes an index of packages; `make versions` builds the source
distribution, from it the wheel, installs the wheel into each environment and runs there a command of each group, the
self-test, and some tests from the unpacked source distribution. By default the lowest versions are tried on the oldest
Python and the newest on the newest; with ALL=1 both on every Python.

The lowest versions stand in constraints-lowest.txt, which `make lowest` writes; the newest are what the index has."""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PLACE = ROOT / ".venv/versions"
LOWEST = ROOT / "constraints-lowest.txt"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXTRAS = "asterix", "ais", "cluster", "parquet", "xarray"
PYTHON_MINORS = range(11, 20)  # Pythons 3.x that are looked for
HEAD = "# The lowest versions that pyproject.toml allows and that have a wheel, and what they need: `make lowest`."
TEST_RUNNERS = "pytest>", "hypothesis>"
# From the unpacked source distribution: what depends on pydantic, on the layout of the files, and on the extras.
TESTS = (
    "tests/config/test_identity.py",
    "tests/config/test_find_files.py",
    "tests/config/test_keys_by_kind.py",
    "tests/recordings/formats",
)
BUILDER = "builder"  # the environment that builds the distributions
QUIET = "--quiet", "--disable-pip-version-check"
FLIGHT = ROOT / "docs/examples/range_doppler.csv"
COMMANDS = (
    ("doctor",),
    ("list",),
    ("check", "rls2", "--set", "realisations=4000"),
    ("run", "rls2", "-n", 2000),
    ("run", "rls4", "-n", 2000, "--no-figures", "--workers", 1),
    ("doctor", "results/rls2", "--recompute", 1),
    ("compare", "rls2", "rls4"),
    ("new", "mine", "--like", "rls2"),
    ("solve", "mine", "radar.sigma_velocity_mps", "--gain", "r", "--filter", "r+Vr", "--at", 60, "--equals", 30),
    ("chart", "--no-figures"),
    ("new-study", "my_study"),
    ("simulate", "rls2", "--realisations", "0:10", "-o", "plots.parquet"),
    ("import", FLIGHT, "-o", "plots.csv"),
    ("track", "rls2", "plots.csv", "-o", "track.csv", "--report", "report"),
    ("fit", "mine", "plots.csv"),
    ("claims", "P1"),
    ("interpretations", "P1.4", "--no-figures"),
    ("schema",),
    ("clean", "rls4"),
)


class Environment(NamedTuple):
    """A Python 3.x with the lowest or the newest packages."""

    minor: int
    kind: str

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"3.{self.minor}-{self.kind}"

    @property
    def requirements(self) -> list[str]:
        """What pip installs."""
        return ["--no-deps", "-r", str(LOWEST)] if self.kind == "lowest" else newest_requirements()


def newest_requirements() -> list[str]:
    """What the package needs with its extras, and what the tests need to run."""
    optional = PROJECT["project"]["optional-dependencies"]
    extras = [needed for extra in EXTRAS for needed in optional[extra]]
    return [*PROJECT["project"]["dependencies"], *extras, *runner_requirements()]


def runner_requirements() -> list[str]:
    """What the tests need to run."""
    return [needed for needed in PROJECT["project"]["optional-dependencies"]["test"] if needed.startswith(TEST_RUNNERS)]


def find_pythons() -> dict[int, str]:
    """The interpreters of Python 3.x at hand, by x: on PATH, or of pyenv."""
    interpreters = {}
    for minor in PYTHON_MINORS:
        name = f"python3.{minor}"
        in_pyenv = sorted(Path.home().glob(f".pyenv/versions/3.{minor}.*/bin/python3"))
        for path in filter(None, [shutil.which(name), *map(str, in_pyenv)]):  # the first may be pyenv's, and not run
            version = subprocess.run([path, "-c", "import sys; print(sys.version_info[1])"], capture_output=True)
            if version.stdout.strip() == str(minor).encode():
                interpreters.setdefault(minor, path)
    return interpreters | {sys.version_info[1]: sys.executable}


def select_environments(minors: Sequence[int], every: bool) -> list[Environment]:
    """The environments to try with these Pythons, in ascending order."""
    pins = LOWEST.read_text(encoding="utf-8")
    lowest = [Environment(minor, "lowest") for minor in minors if f"python_version == '3.{minor}'" in pins]
    newest = [Environment(minor, "newest") for minor in minors]
    return lowest + newest if every else lowest[:1] + newest[-1:]


def write_lowest(every: bool) -> None:
    """Write constraints-lowest.txt for the Pythons that pyproject.toml names."""
    named = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["project"]["classifiers"]))
    extras = [word for extra in EXTRAS for word in ("--extra", extra)]
    bounds = ["--only-binary", ":all:", "--resolution", "lowest-direct"]
    with tempfile.NamedTemporaryFile("w", suffix=".in") as runners:
        runners.write("\n".join(runner_requirements()))
        runners.flush()
        command = ["uv", "pip", "compile", "--quiet", "--no-header", "--no-annotate", *bounds, *extras]
        lines = [
            f"{line} ; python_version == '{version}'"
            for version in named
            for line in run([*command, "--python-version", version, "pyproject.toml", runners.name]).splitlines()
        ]
    LOWEST.write_text("\n".join([HEAD, *lines, ""]), encoding="utf-8")


def install(every: bool) -> None:
    """Make the environments that are missing or out of date."""
    interpreters = find_pythons()
    plans = {BUILDER: (sys.executable, PROJECT["build-system"]["requires"])}
    for environment in select_environments(sorted(interpreters), every):
        plans[environment.name] = interpreters[environment.minor], environment.requirements
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda name: _install(name, *plans[name]), plans))


def _install(name: str, python: str, requirements: list[str]) -> None:
    folder, stamp = PLACE / name, PLACE / name / "requirements.txt"
    text = "\n".join([python, *requirements, LOWEST.read_text(encoding="utf-8")])
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == text:
        return
    shutil.rmtree(folder, ignore_errors=True)
    run([python, "-m", "venv", folder])
    run([folder / "bin/python", "-m", "pip", *QUIET, "install", "--no-compile", *requirements])
    stamp.write_text(text, encoding="utf-8")


def run(command: Sequence[object], folder: Path = ROOT, home: Path | None = None) -> str:
    """What a command prints. Raises SystemExit, with all that it said, where it fails."""
    variables = {name: text for name, text in os.environ.items() if not name.startswith(("PYTHON", "RADARSIM_"))}
    if home is not None:
        variables |= {"HOME": str(home), "RADARSIM_CACHE_DIR": str(home / "cache")}
    words = [str(word) for word in command]
    result = subprocess.run(words, cwd=folder, env=variables, capture_output=True, text=True, check=False)
    if result.returncode != 0 or "Traceback" in result.stderr:
        raise SystemExit(f"{' '.join(words)}\n{result.stdout}{result.stderr}exit code {result.returncode}")
    return result.stdout


def check(every: bool) -> None:
    """Build the distributions and try them in each environment. Raises SystemExit where anything fails."""
    installed = {int(place.name.split("-")[0][2:]) for place in PLACE.glob("3.*-*")}
    environments = select_environments(sorted(installed), every)
    with tempfile.TemporaryDirectory() as place, ThreadPoolExecutor(2) as pool:
        folder = Path(place)
        sources, wheel = build_distributions(folder)
        identities = case_identities(Path(sys.executable), folder)
        reports = [
            pool.submit(_check, environment, sources, wheel, folder / environment.name, identities, every)
            for environment in environments
        ]
        for report in reports:
            sys.stdout.write(report.result() + "\n")
            sys.stdout.flush()


def build_distributions(folder: Path) -> tuple[Path, Path]:
    """The unpacked source distribution, and the wheel that is built from it."""
    build = "import sys; from setuptools import build_meta; getattr(build_meta, sys.argv[1])(sys.argv[2])"
    builder = PLACE / BUILDER / "bin/python"
    run([builder, "-c", build, "build_sdist", folder])
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as packed:
        packed.extractall(folder, filter="data")
    sources = folder / archive.name.removesuffix(".tar.gz")
    run([builder, "-c", build, "build_wheel", folder], sources)
    (wheel,) = folder.glob("*.whl")
    return sources, wheel


def case_identities(python: Path, folder: Path) -> object:
    """What identifies the cases of all shipped configs, as the radarsim of an interpreter says."""
    return json.loads(run([python, ROOT / "tests/config/case_identities.py"], folder))


def _check(environment: Environment, sources: Path, wheel: Path, folder: Path, identities: object, every: bool) -> str:
    """Install the wheel and try it in an empty folder, which is its home; returns what was tried."""
    python, before = PLACE / environment.name / "bin/python", time.monotonic()
    folder.mkdir()
    pip = [python, "-m", "pip", *QUIET]
    run([*pip, "install", "--no-index", "--no-deps", "--force-reinstall", wheel])
    run([*pip, "check"])
    if case_identities(python, folder) != identities:
        raise SystemExit(f"{environment.name}: identities of shipped cases are not those of {sys.executable}")
    for words in COMMANDS:
        run([python, "-m", "radarsim", *words], folder, folder)
    run([python, "-c", "import radarsim; radarsim.plots('rls2', n=10).to_xarray()"], folder, folder)
    if every:
        run([python, "-m", "radarsim.cli.reproduce", "all", "--set", "realisations=200"], folder, folder)
    tests = [python, "-m", "pytest", "-p", "no:cacheprovider", "-k", "not spoiled", *TESTS]
    passed = run(tests, sources, folder).splitlines()[-1]
    return f"{environment.name}: {len(COMMANDS)} commands, {passed}; {time.monotonic() - before:.0f} s"


if __name__ == "__main__":
    {"lowest": write_lowest, "install": install, "check": check}[sys.argv[1]]("--all" in sys.argv[2:])
