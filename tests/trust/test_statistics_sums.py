"""Sums of one realisation against its error, merging of blocks against exact addition."""

import math
import random

import numpy as np
import pytest

from radarsim.api.case_work import CaseWork
from radarsim.engine.blocks import Forest, Node
from radarsim.engine.sums import Sums
from tests.tolerances import rounding
from tests.trust.cases import CASES

BLOCKS, SIZE = 2**13, 4


def merged(values):
    """The total of one block for each row of values (n, SIZE), added in any order of completion."""
    forest, order = Forest(1, SIZE), list(range(len(values)))
    random.Random(1).shuffle(order)
    for i in order:
        forest.add(Node(0, i), Sums(1, values[i]))
    return forest.total()


@pytest.mark.parametrize("signs", [False, True])
def test_a_tree_of_sums_is_as_good_as_fsum(signs):
    """Of numbers of 26 magnitudes the relative error is under that of log₂ n additions; in a row it would be of n."""
    rng = np.random.default_rng(2)
    values = rng.random((BLOCKS, SIZE)) * 10.0 ** rng.integers(-13, 13, (BLOCKS, SIZE))
    if signs:
        values *= rng.choice((-1.0, 1.0), values.shape)
    total = merged(values)
    assert total.count == BLOCKS
    for column, found in zip(values.T, total.values, strict=True):
        bound = math.log2(BLOCKS) * 2.0**-53 * math.fsum(np.abs(column))
        assert abs(found - math.fsum(column)) <= bound
        assert not signs or bound > 0


@pytest.mark.slow
def test_moments_of_a_large_bias_keep_their_spread():
    """σ from Σe² where |bias| is 10⁴ spreads: what is lost is rounding of e², 10⁸ spreads² · 2⁻⁵³."""
    from radarsim.report import statistics

    e = 1e4 + np.random.default_rng(3).normal(size=BLOCKS)
    total = merged(np.stack([e, e**2, e**3, e**4], axis=1))
    exact = math.fsum((x - math.fsum(e) / BLOCKS) ** 2 for x in e) / BLOCKS
    found = statistics.errors(total.values, BLOCKS)
    assert found.spread**2 == pytest.approx(exact, abs=1e8 * 2.0**-53 * math.log2(BLOCKS))


@pytest.mark.parametrize("study", CASES)
def test_sums_of_one_realisation_are_the_powers_of_its_error(study):
    work = CaseWork(CASES[study].loaded().cases[-1])
    for number in (0, 13):
        error = work.plan.layout.unpack(work.simulate(number, 1))["error"]
        assert np.count_nonzero(error) > error.size / 3
        # Three products, and three of the library's power.
        np.testing.assert_allclose(error, error[..., :1] ** np.arange(1, 5), rtol=rounding(operations=4))
