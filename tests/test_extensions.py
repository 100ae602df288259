"""The core without its extensions: it runs, reports, solves and judges, and imports none of them."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import radarsim
from radarsim.extensions import Extension, extensions

PACKAGE = Path(radarsim.__file__).parent
SCRIPT = """
import sys
sys.path.insert(0, {folder!r})
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in repr(finder)]  # it knows the whole package
import radarsim
from radarsim.cli.command_group import main
from radarsim.extensions import extensions

assert radarsim.__file__.startswith({folder!r})
for words in {commands!r}:
    main(words, standalone_mode=False)
result = radarsim.judge("rls2", lambda plots: plots["range_m"][..., None], realisations=300)
assert "claims" not in result.tables
assert "radarsim.papers" not in sys.modules
print([type(extension).__name__ for extension in extensions()])
"""


@pytest.fixture
def core(tmp_path):
    """A copy of the package without the papers."""
    shutil.copytree(PACKAGE, tmp_path / "radarsim", ignore=shutil.ignore_patterns("papers", "__pycache__"))
    return tmp_path


@pytest.mark.slow
def test_core_runs_reports_solves_and_judges_without_papers(core):
    out = ["--out", str(core / "results")]
    commands = [
        ["run", "rls2", "-n", "300", "--no-figures", *out],
        ["report", "rls2", *out],
        ["solve", "rls2", "radar.sigma_velocity_mps", "--gain", "r", "--at", "60", "--equals", "30"],
        ["list"],
    ]
    script = SCRIPT.format(folder=str(core), commands=commands)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=core, check=False)
    assert done.returncode == 0, done.stderr
    assert "PapersExtension" not in done.stdout
    folder = core / "results/rls2"
    assert (folder / "curves.csv").is_file()
    assert not (folder / "claims.csv").exists()
    assert "table-claims" not in (folder / "report.html").read_text(encoding="utf-8").partition("<body>")[2]
    assert (core / "results/index.html").is_file()


def test_an_extension_adds_nothing_by_default():
    extension = Extension()
    assert not extension.tables((), {}, {}, "")
    assert extension.report_section({}, {}, {}, (), "range_doppler") is None
    assert not extension.command_sections
    assert extension.stop_rule is None


def test_the_papers_are_an_extension():
    assert "claims" in [name for extension in extensions() for name in extension.table_names]
