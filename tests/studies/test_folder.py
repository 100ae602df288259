"""Studies by convention: every part is where `radarsim.studies.folder` looks for it, and is loaded only then."""

import inspect
import subprocess
import sys
from pathlib import Path

import pytest

from radarsim.config.fields import Study as Keys
from radarsim.report.claims import Evidence, PaperClaims
from radarsim.studies import registry
from radarsim.studies.folder import StudyFolder
from radarsim.studies.interface import RecordedPlots, Study

ROOT = Path(__file__).parents[2]
FILES = {  # of the parts that are functions: the file
    "prepare": "study",
    "simulate": "study",
    "tables": "tables",
    "curves": "tables",
    "inputs": "tables",
    "cost": "tables",
    "figures": "figures",
    "question": "words",
    "answer": "words",
    "seconds_per_update": "cost",
}


FOLDERS = [study for study in map(registry.study, registry.SHIPPED) if isinstance(study, StudyFolder)]


@pytest.mark.parametrize("study", FOLDERS, ids=lambda study: study.name)
def test_every_part_is_there_and_takes_what_the_interface_gives(study):
    for part, file in FILES.items():
        if part in study.offers or part in Study.__abstractmethods__:
            given = list(inspect.signature(getattr(Study, part)).parameters)[1:]
            assert list(inspect.signature(getattr(study.file(file), part)).parameters) == given, part
    assert issubclass(study.keys(), Keys)
    if study.paper is not None:
        claims = study.claims()
        assert isinstance(claims, PaperClaims)
        assert claims.claims
        assert issubclass(claims.evidence, Evidence)
        assert (claims.paper, claims.page, claims.may_grow, claims.may_shorten, claims.held_too) == study.paper
    if "recorded" in study.offers:
        assert isinstance(study.recorded(), RecordedPlots)
    if "shipped" in study.offers:
        assert (study.shipped() / "configs").is_dir()


def test_what_is_not_offered_is_as_the_interface_has_it():
    bare = StudyFolder(package="radarsim.studies.multimodel", name="bare", about="a study", filters={})
    assert (bare.claims(), bare.recorded(), bare.shipped()) == (None, None, None)
    assert (bare.inputs([]), bare.cost({}, {}), bare.seconds_per_update(None)) == (None, None, {})
    assert bare.exact_errors
    assert not bare.draws_sweeps


def test_a_part_of_another_name_is_refused():
    with pytest.raises(ValueError, match="study bare: offers input, must be of curves, gains, inputs, cost"):
        StudyFolder(package=__name__, name="bare", about="a study", filters={}, offers=("input",))


def test_declared_studies_load_nothing_that_computes():
    program = (
        "import sys\n"
        "from radarsim.studies import registry\n"
        "for name in registry.SHIPPED: print(registry.study(name).about)\n"
        "print({'numpy', 'numba', 'pandas', 'matplotlib'} & set(sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"
