"""The list of planted faults fits the sources, so that `make mutants` tries what it says."""

import ast
from pathlib import Path

import pytest

from tests.trust.mutants import ALL

ROOT = Path(__file__).parents[2]
PARTS = (
    "kernels",
    "physics",
    "report",
    "engine",
    "studies/range_doppler",
    "studies/multimodel",
    "studies/discriminator",
    "studies/sonar",
    "studies/ambiguous_doppler",
    "studies/pulses_to_tracks",
    "bursts",
)


def test_enough_faults_in_every_part():
    assert len(ALL) >= 25
    assert {part for part in PARTS if not any(f"radarsim/{part}/" in mutant.path for mutant in ALL)} == set()
    assert len({(mutant.path, mutant.original) for mutant in ALL}) == len(ALL)


@pytest.mark.parametrize("path", sorted({mutant.path for mutant in ALL}))
def test_each_fault_has_one_place_and_leaves_a_program(path):
    text = (ROOT / path).read_text(encoding="utf-8")
    for mutant in (m for m in ALL if m.path == path):
        assert text.count(mutant.original) == 1, (
            f"{path}: {mutant.original!r} is there {text.count(mutant.original)} times"
        )
        assert mutant.mutated != mutant.original
        ast.parse(text.replace(mutant.original, mutant.mutated))


def test_the_named_tests_exist():
    for name in sorted({name for mutant in ALL for name in mutant.tests}):
        file, _, function = name.partition("::")
        text = (ROOT / file).read_text(encoding="utf-8")
        assert f"def {function}(" in text if function else "def test_" in text, name
