"""Random edits of kernels, applied and undone over stored runs: each run shows the numbers of its own sources."""

import json
import random
import shutil
from pathlib import Path

import pytest

from tests.forked_programs import Start
from tests.trust import mutate

ROOT = Path(__file__).parents[2]
SIZES = (900, 9_000, 60_000)  # less than a block of realisations, some blocks, many
PATHS = ("radarsim/kernels/second_order.py", "radarsim/kernels/random.py")
EDITS = 200
RUN = """
import json, sys
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load
from radarsim.engine.collect import collect
work = CaseWork(load("rls2").cases[0])
for size in json.loads(sys.argv[2]):
    answers = []
    for store in (sys.argv[1], None):
        try:
            collected = collect(work, size, store=store, threads=0)
            answers.append((collected.from_store, collected.values.tobytes().hex()))
        except Exception as error:
            answers.append((0, repr(error)))
    print(json.dumps(answers))
"""


def run(start, tree, store, sizes=SIZES):
    """For each size what a program gives with a store and without one: realisations from the store, the bytes."""
    done = start.run(store, json.dumps(sizes), code=RUN, path=[tree], cwd=tree)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture
def libraries(tmp_path):
    """Processes whose kernels may read what they have not written, and check their indices: an edit may spoil both."""
    settings = {"MALLOC_PERTURB_": "90", "NUMBA_BOUNDSCHECK": "1", "RADARSIM_CACHE_DIR": str(tmp_path / "kernels")}
    with Start(tmp_path, radarsim=False, **settings) as start:
        yield start


@pytest.mark.slow
def test_no_edit_shows_a_number_that_its_own_sources_do_not_give(tmp_path, libraries):
    tree, store = tmp_path / "tree", tmp_path / "results"
    tree.mkdir()
    shutil.copytree(ROOT / "radarsim", tree / "radarsim", ignore=shutil.ignore_patterns("__pycache__"))
    right = [with_store for with_store, _ in run(libraries, tree, store)]
    draw, moved = random.Random(1), 0
    for site in mutate.sample(mutate.sites(ROOT, PATHS), EDITS, seed=1):
        file = tree / site.path
        text = file.read_text(encoding="utf-8")
        file.write_text(mutate.mutant(text, site.number).text, encoding="utf-8")
        sizes = draw.sample(SIZES, len(SIZES))
        answers = run(libraries, tree, store, sizes)
        assert answers[0][0][0] == 0, site  # nothing of the sources before
        for with_store, without_store in answers:
            assert with_store[1] == without_store[1], site
        moved += with_store[1] != right[SIZES.index(sizes[-1])][1]
        file.write_text(text, encoding="utf-8")
        undone = run(libraries, tree, store)
        assert [with_store for with_store, _ in undone] == [[size, right[i][1]] for i, size in enumerate(SIZES)], site
    assert moved > EDITS / 2
