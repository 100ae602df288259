"""The classes of the shipped studies: each method takes what the interface gives, and loads its modules when called."""

import inspect
import subprocess
import sys
from pathlib import Path

import pytest

from radarsim.config.study_keys import StudyKeys as Keys
from radarsim.papers.claim import PaperClaims
from radarsim.papers.evidence import Evidence
from radarsim.papers.paper_keys import paper_key
from radarsim.papers.study_claims import claims_of
from radarsim.studies import registry
from radarsim.studies.interface import Study
from radarsim.studies.recording_interface import RecordingInterface

ROOT = Path(__file__).parents[2]
STUDIES = [registry.study(name) for name in registry.SHIPPED]


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_methods_take_the_parameters_of_the_interface(study):
    for name, method in vars(Study).items():
        if callable(method) and not name.startswith("_"):
            parameters = list(inspect.signature(method).parameters)
            assert list(inspect.signature(getattr(type(study), name)).parameters) == parameters, name


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_keys_claims_and_recorded_plots_are_of_the_declared_types(study):
    assert issubclass(study.keys(), Keys)
    claims = claims_of(study)
    assert isinstance(claims, PaperClaims | None)
    if claims is not None:
        assert issubclass(claims.evidence, Evidence)
        assert {claim.id.partition(".")[0] for claim in claims.claims} == {paper_key(study)}
    assert isinstance(study.recording_interface(), RecordingInterface | None)


def test_declared_studies_load_nothing_that_computes():
    """Those of several files: a study in one file is declared where it computes."""
    program = (
        "import sys\n"
        "from radarsim.studies import registry\n"
        "for name in registry.SHIPPED: print(name == 'plane' or registry.study(name).about)\n"
        "print({'numpy', 'numba', 'pandas', 'matplotlib'} & set(sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"
