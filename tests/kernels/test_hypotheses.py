"""Which branches of hypotheses are kept, against sorting."""

import numpy as np
import pytest

from radarsim.kernels.compiler import kernel
from radarsim.kernels.hypotheses import select_weight
from radarsim.kernels.lanes import address


@kernel
def selected(weights, copy, most):
    return select_weight(address(weights), weights.size, address(copy), most)


@pytest.mark.parametrize("different", [1, 2, 5, 1000])
def test_the_least_kept_weight_is_that_of_a_sorted_list(different):
    rng = np.random.default_rng(different)
    for count in (2, 3, 7, 300):
        weights = rng.choice(np.append(rng.normal(size=different), -1e300), count)
        for most in {1, 2, count // 2 or 1, count - 1}:
            assert selected(weights, np.empty(count), most) == np.sort(weights)[-most]


@pytest.mark.parametrize("order", ["rising", "falling", "equal"])
def test_the_least_kept_weight_of_an_ordered_list(order):
    weights = {"rising": np.arange(50.0), "falling": -np.arange(50.0), "equal": np.zeros(50)}[order]
    before = weights.copy()
    assert [selected(weights, np.empty(50), most) for most in range(1, 50)] == list(np.sort(weights)[:0:-1])
    np.testing.assert_array_equal(weights, before)
