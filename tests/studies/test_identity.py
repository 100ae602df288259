"""Which blocks a program uses: those of its own question, whose bytes it would make too."""

import ast
import json
import shutil
from pathlib import Path

import pytest

from radarsim.app.result import of_other_sources
from radarsim.engine import store
from radarsim.studies import identity, registry

ROOT = Path(__file__).parents[2]
CONFIGS = {
    "range_doppler": ["rls2", "rls3"],
    "multimodel": ["multimodel"],
    "sonar": ["sonar_smoothing", "sonar_manoeuvre", "sonar_clutter_rare", "sonar_clutter_ends"],
    "discriminator": ["discriminator", "discriminator_rare"],
    "ambiguous_doppler": ["ambiguous_rls4", "ambiguous_rare"],
    "pulses_to_tracks": ["pulses"],
}
COMPUTED = """
import json, sys
from radarsim.app.configs import load
from radarsim.app.configs import CaseWork
for stem in sys.argv[1:]:
    CaseWork(load(stem).cases[0]).simulate(0, 2)
print(json.dumps([module.__file__ for name, module in sys.modules.items() if name.startswith("radarsim.")]))
"""
# What reads a config, carries a study's parts and says what is wrong changes no number.
CARRY = {"app", "errors.py", "failures.py", "language", "report"}


@pytest.mark.parametrize("study", registry.SHIPPED)
def test_every_file_that_computes_is_hashed(study, libraries):
    """The files that are loaded by the time that blocks are made, but for those that carry a case."""
    done = libraries.run(*CONFIGS[study], code=COMPUTED)
    loaded = [Path(one).relative_to(identity.PACKAGE) for one in json.loads(done.stdout)]
    inside = {path for path in loaded if path.parts[0] not in CARRY and path.name != "__init__.py"}
    own = Path(*registry.module(study).split(".")[1:])
    rooms = {path for path in inside if path.parts[0] in identity.ROOMS or path.parent == Path("studies")}
    studies = inside - rooms
    assert studies
    assert all(path.is_relative_to(own) for path in studies)
    assert not [path for path in studies if path.stem in identity.SHOW]


@pytest.fixture(scope="module")
def edited(tmp_path_factory, libraries):
    """Runs rls2 again with an edited copy of the package: how much it computed, and the line on other sources."""
    tmp_path = tmp_path_factory.mktemp("edited")
    shutil.copytree(ROOT / "radarsim", tmp_path / "radarsim", ignore=shutil.ignore_patterns("__pycache__"))

    def run(path="errors.py", change=lambda text: text):
        file = tmp_path / "radarsim" / path
        text = file.read_text()
        file.write_text(change(text))
        words = ("run", "rls2", "-n", 9000, "--no-figures", "--out", "out")
        done = libraries.run(*words, path=[tmp_path], cwd=tmp_path)
        file.write_text(text)
        assert done.returncode == 0, done.stderr
        record = json.loads((tmp_path / "out/rls2/run.json").read_text())
        (said,) = [line for line in done.stderr.splitlines() if "other sources" in line] or [""]
        said = said.removeprefix("warning: ")
        assert said in [*record["warnings"], ""]
        return record["realisations_computed"], said

    assert run() == (9000, "")
    return run


def renamed(text):
    """A source whose functions call their local variables otherwise, without its comments."""
    tree = ast.parse(text)
    for function in [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]:
        names = [node for node in ast.walk(function) if isinstance(node, ast.Name)]
        local = {node.id for node in names if isinstance(node.ctx, ast.Store)}
        local -= {node.arg for node in ast.walk(function) if isinstance(node, ast.arg)}
        for node in names:
            if node.id in local:
                node.id += "_renamed"
    return ast.unparse(tree)


def test_what_moves_no_digit_keeps_all_blocks_and_is_said_once(edited):
    assert edited("report/tables.py", renamed) == (0, "")  # only shows
    computed, line = edited("kernels/linear.py", renamed)
    assert computed == 0
    assert line.startswith("stored blocks of rls2 were made by other sources; 9,000 of 9,000 realisations were comp")
    assert edited("kernels/linear.py", renamed) == (0, "")
    assert edited() == (0, "")


MOVED = """
_before = simulate
def simulate(plan, first, count):
    sums = _before(plan, first, count)
    return np.nextafter(sums, np.inf) if first <= 8500 < first + count else sums
"""


@pytest.mark.slow
def test_a_last_digit_of_few_realisations_begins_anew_and_says_so(edited):
    computed, line = edited("studies/range_doppler/study.py", lambda text: f"{text}\nimport numpy as np\n{MOVED}")
    assert computed == 9000
    assert line.startswith("stored blocks of rls2 were made by other sources that give other bytes, and are not used")
    assert edited() == (0, "")


def test_a_study_that_raises_its_model_begins_anew_and_compares_nothing(edited):
    model = "\nobject.__setattr__(STUDY, 'model', STUDY.model + 1)\n"
    assert edited("studies/range_doppler/__init__.py", lambda text: text + model) == (9000, "")


@pytest.mark.parametrize(("again", "stored", "rarer"), [(900, 900, False), (300, 900, True)])
def test_one_line_says_what_was_compared_of_all_cases(monkeypatch, again, stored, rarer):
    names = {f"{number}": f"case {number}" for number in range(5)}
    monkeypatch.setattr(store, "settled", [store.Settled(one, one != "4", again, stored) for one in (*names, "else")])
    kept, begun = of_other_sources(names)
    assert f"case 0, case 1, case 2 and case 3 were made by other sources; {4 * again:,} of 3,600 " in kept
    assert ("A change in one realisation of 100 would have shown" in kept) is rarer
    assert "blocks of case 4 were made by other sources that give other bytes" in begun
    assert [one.identity for one in store.settled] == ["else"]
    assert of_other_sources(names) == []
