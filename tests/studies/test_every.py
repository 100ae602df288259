"""What holds of every study, and of each kind of rare event: blocks add up, and a case is itself wherever it goes."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from radarsim.app.work import CaseWork
from tests.trust.cases import CASES, MORE

every = pytest.mark.parametrize("study", CASES | MORE)


@pytest.fixture(scope="module")
def works():
    """The work of each study's small case, prepared when first asked for."""
    made = {}

    def of(study):
        if study not in made:
            made[study] = CaseWork((CASES | MORE)[study].loaded().cases[0])
        return made[study]

    return of


@every
def test_blocks_add_up_whatever_their_bounds(works, study):
    """A realisation is itself in any block, group of lanes or part of one: over 37 in one and in three parts."""
    work = works(study)
    whole = work.plan.layout.unpack(work.simulate(3, 37))
    parts = [work.plan.layout.unpack(work.simulate(*part)) for part in ((3, 8), (11, 16), (27, 13))]
    for name, values in whole.items():
        added = sum(part[name] for part in parts)
        # Sums of large and small numbers in another order: to rounding of the largest of their kind.
        np.testing.assert_allclose(added, values, rtol=1e-9, atol=1e-11 * np.abs(values).max(initial=0), err_msg=name)
    assert np.isfinite(work.simulate(3, 37)).all()


@every
def test_a_case_is_the_same_elsewhere_and_another_with_another_seed(works, study):
    work = works(study)
    copy = pickle.loads(pickle.dumps(work))
    assert copy.identity == work.identity
    assert copy.simulate(5, 20).tobytes() == work.simulate(5, 20).tobytes()
    other = CaseWork(replace(work.case, seed=work.case.seed + 1))
    assert other.identity != work.identity
    assert other.simulate(5, 20).tobytes() != work.simulate(5, 20).tobytes()
