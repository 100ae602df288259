"""What proves the study: the paper's equations at other indices, and its claims."""

import numpy as np
import pytest
import radarsim
from radarsim.api.configs import load

from kalata import STUDY

CASES = load("kalata").cases


@pytest.mark.parametrize("index", [0.01, 0.3, 1, 5])
def test_the_limits_are_those_of_the_closed_form(index):
    """r = (4 + Λ - √(8 Λ + Λ²))/4, α = 1 - r², β = 2 (1 - r)²; σ² of x is α, of v β (α - β/2)/(1 - α)."""
    case = load("kalata", {"target": {"index": index}}).cases[0]
    r = (4 + index - np.sqrt(8 * index + index**2)) / 4
    a, b = 1 - r**2, 2 * (1 - r) ** 2
    wanted = np.sqrt([a, b * (a - b / 2) / (1 - a)])
    np.testing.assert_allclose(STUDY.limits(case.spec)[0], wanted, rtol=1e-9)


def test_the_exact_values_go_to_the_limits():
    for case in CASES:
        limits, sigma = STUDY.limits(case.spec), STUDY.prepare(case).axes.exact_sigma[:, -1]
        known = np.isfinite(limits)
        np.testing.assert_allclose(sigma[known], limits[known], rtol=1e-6)
        assert known[[0, 3]].all()
        assert known[[1, 2]].all() == (case.spec.target.order == 2)  # α-β filters of a growing acceleration: none


def test_the_claims_are_decided_by_exact_values():
    table = radarsim.run("kalata", realisations=100).tables["claims"]
    assert table["exact"].notna().all()
    assert dict(zip(table["claim"], table["class"], strict=True)) == {
        f"kalata.{n}": "no material difference" if n == 4 else "confirmed" for n in range(1, 8)
    }
