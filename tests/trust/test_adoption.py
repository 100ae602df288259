"""What a wrong program does with the right one's blocks: where a number moves, it takes none of them over."""

import json
from pathlib import Path

import pytest

from tests.trust import mutate
from tests.trust.faults import FAULTS

ROOT = Path(__file__).parents[2]
TRIED = """
import hashlib, json, sys
from pathlib import Path
from radarsim.app.configs import CaseWork, load
from radarsim.engine.run import collect
from radarsim.engine.store import folder_of
from radarsim.studies import identity
from tests.trust.faults import FAULTS

config, realisations, store, fault = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]), sys.argv[4]
if fault:
    identity.sources = lambda *_: hashlib.sha256(fault.encode()).hexdigest()
if fault in FAULTS:
    FAULTS[fault].plant()
work = CaseWork(load(config).cases[0])
if fault:
    print(json.dumps(folder_of(store / ".blocks", work).is_dir()), flush=True)
    store = None
made = collect(work, realisations, store=store, threads=0)
print(json.dumps([made.count, made.values.tobytes().hex()]))
"""


def program(start, store, config, realisations, fault, tree=ROOT, **environment):
    """What a program prints: whether it takes the store over, then the count and bytes that it makes itself."""
    done = start.run(config, realisations, store, fault, code=TRIED, path=[tree], cwd=tree, **environment)
    assert fault or done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def came(right, said):
    """What came of it in two words; a program that breaks off before the end takes nothing over that it would make."""
    adopted = said[:1] == [True]
    return f"{'same' if said[1:] == right else 'moved'}, {'adopted' if adopted else 'anew'}"


@pytest.fixture(scope="module")
def rls2(tmp_path_factory, libraries):
    """What came of a fault in a program beside a store that the right one left."""
    store = tmp_path_factory.mktemp("right")
    right = program(libraries, store, "rls2", 9000, "")
    return lambda fault: came(right, program(libraries, store, "rls2", 9000, fault))


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("every_block_is_the_first", "moved, anew"),
        ("noise_of_one_seed", "moved, anew"),
        ("realisations_of_one_side_counted", "moved, anew"),  # between tasks, each of which is right
        ("acceleration_moves_nothing", "moved, anew"),
        ("arrays_of_sums_in_another_order", "same, adopted"),  # in what reads them
    ],
)
def test_a_fault_that_moves_a_number_takes_nothing_over(rls2, fault, expected):
    assert rls2(fault) == expected


@pytest.mark.slow
def test_no_fault_of_meaning_that_moves_a_number_takes_blocks_over(rls2):
    found = {fault: rls2(fault) for fault in FAULTS}
    assert [fault for fault, what in found.items() if what == "moved, adopted"] == []
    assert len([fault for fault, what in found.items() if what == "moved, anew"]) >= 6
    assert len([fault for fault, what in found.items() if what == "same, adopted"]) >= 15


# Rare branches among them: tracks that end, folds that are wrong, plots that are missed.
TRIALS = {
    "radarsim/kernels/linear": ("rls2", 9000),
    "radarsim/studies/multimodel": ("multimodel", 4000),
    "radarsim/studies/sonar/clutter": ("sonar_clutter_ends", 20_000),
    "radarsim/studies/discriminator": ("discriminator_rare", 6000),
    "radarsim/studies/ambiguous_doppler": ("ambiguous_rare", 4000),
    "radarsim/studies/pulses_to_tracks": ("pulses", 4000),
}


@pytest.mark.slow
@pytest.mark.parametrize("part", TRIALS)
def test_no_wrong_formula_that_moves_a_number_takes_blocks_over(libraries, tmp_path, part):
    tree, given = mutate.copied(ROOT, tmp_path / "tree"), (tmp_path / "right", *TRIALS[part])
    own = {"tree": tree, "RADARSIM_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    right = program(libraries, *given, "", **own)
    sites = mutate.sites(ROOT, [path for path in mutate.modules() if path.startswith(part)])
    found = []
    for site in mutate.sample(sites, 10, seed=32):
        file = tree / site.path
        text = file.read_text(encoding="utf-8")
        file.write_text(mutate.mutant(text, site.number).text, encoding="utf-8")
        found.append((came(right, program(libraries, *given, str(site), **own)), site))
        file.write_text(text, encoding="utf-8")
    assert [site for what, site in found if what == "moved, adopted"] == []
    assert [site for what, site in found if what == "moved, anew"]
