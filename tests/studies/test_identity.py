"""A run uses the blocks of its own request and its own sources, and no others: for an edit, and once it is undone."""

import json
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STUDY = "studies/range_doppler/study.py"
LATE = """
_simulate = simulate
def simulate(plan, first, count):
    sums = _simulate(plan, first, count)
    return sums * 2 if first >= 8192 else sums
"""  # changes no realisation of a short run
MANY, FEW = 40_000, 2_000


@pytest.fixture(scope="module")
def edited(tmp_path_factory, libraries):
    """Runs rls2 with an edited copy of the package: a function of the realisations, the file and the text added to it,
    which gives the record, the table of curves and what was said on other sources."""
    folder = tmp_path_factory.mktemp("edited")
    shutil.copytree(ROOT / "radarsim", folder / "radarsim", ignore=shutil.ignore_patterns("__pycache__"))

    def run(realisations, path=STUDY, addition="", *options, out="out"):
        file = folder / "radarsim" / path
        text = file.read_text(encoding="utf-8")
        file.write_text(text + addition, encoding="utf-8")
        words = ("run", "rls2", "-n", realisations, "--no-figures", "--out", out, *options)
        done = libraries.run(*words, path=[folder], cwd=folder)
        file.write_text(text, encoding="utf-8")
        assert done.returncode in (0, 4), done.stderr
        result = folder / out / "rls2"
        record = json.loads((result / "run.json").read_text())
        said = [line for line in record["warnings"] if "other sources" in line]
        assert done.returncode == 4 or all(line in done.stderr for line in said)
        return record["realisations_computed"], (result / "curves.csv").read_bytes(), said

    run.folder, run.start = folder, libraries
    return run


def test_an_edit_of_late_realisations_adopts_nothing_and_leaves_nothing(edited):
    few = edited(FEW)
    with_edit = edited(MANY, STUDY, LATE)
    assert with_edit[0] == MANY  # not one block of the sources before
    assert len(with_edit[2]) == 1
    assert "rls2" in with_edit[2][0]
    without_store = edited(MANY, STUDY, LATE, out="elsewhere")
    assert with_edit[1] == without_store[1]
    undone = edited(MANY)
    assert undone[1] == edited(MANY, out="apart")[1] != with_edit[1]
    assert edited(MANY)[:2] == (0, undone[1])
    assert edited(FEW, STUDY, "", "--replace")[:2] == (0, few[1])  # without it the many would be shown
    again = edited(MANY, STUDY, LATE)
    assert (again[0], again[1], again[2]) == (0, with_edit[1], [])  # an edit that is made again finds its own, too


@pytest.mark.slow
def test_a_comment_in_a_kernel_begins_anew_and_a_sentence_does_not(edited):
    edited(FEW, out="comment")
    assert edited(FEW, "kernels/second_order.py", "# a comment\n", out="comment")[0] == FEW
    assert edited(FEW, "studies/range_doppler/answer.py", "# a comment\n", out="comment")[0] == 0
    assert edited(FEW, "report/tables.py", "# a comment\n", out="comment")[0] == 0


@pytest.mark.slow
def test_doctor_names_blocks_of_other_sources_and_clean_removes_only_them(edited):
    edited(FEW, out="several")
    edited(FEW, STUDY, "# a comment\n", out="several")

    def command(*words):
        done = edited.start.run(*words, path=[edited.folder], cwd=edited.folder)
        assert done.returncode == 0, done.stderr
        return done.stdout

    said = command("doctor", "several/rls2")
    assert "were made by sources that have changed since" in said
    edited(FEW, out="several")
    stale, present = sorted((edited.folder / "several/.blocks").iterdir(), key=lambda path: path.stat().st_mtime)[::-1]
    said = command("doctor", "several/rls2")
    assert stale.name in said
    assert "all intact" in said
    assert "in 1 folder" in command("clean", "--other-sources", "--dry-run", "--out", "several")
    command("clean", "--other-sources", "--out", "several")
    assert list((edited.folder / "several/.blocks").iterdir()) == [present]
    assert "other sources" not in command("doctor", "several/rls2")
    assert edited(FEW, out="several")[0] == 0
