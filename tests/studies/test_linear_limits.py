"""Limits of σ where a component of the state is without noise, against the exact recursion over many scans."""

import numpy as np
import pytest

from radarsim.studies.linear_design import Matrices, kalman
from radarsim.studies.linear_exact import exact, limit

SCANS = 400


def filter_of(state, gains=None, P=None, q=0.3, plots=(1.0, 0, 0)):
    """A filter of x, v, a whose a it takes for known, with Kalman gains unless its own are given."""
    F = np.array([[1, 1, 0.5], [0, 1, 1], [0, 0, 1.0]])
    Q = q * np.outer([0.5, 1, 0], [0.5, 1, 0])
    P = np.diag([4.0, 1, 0]) if P is None else P
    H, sigma = np.tile(np.array(plots), (SCANS, 1, 1)), np.full((SCANS, 1), 2.0)
    own = gains is not None
    gains = np.tile(np.array(gains), (SCANS, 1, 1)) if own else kalman(F, Q, P, H, sigma**2)
    return Matrices(F, Q, np.array(state, dtype=float), P, H, sigma**2, H, sigma, gains, own)


def truth_of(model, mean, P):
    return model.F, model.Q, np.array(mean, dtype=float), np.asarray(P, dtype=float)


@pytest.mark.parametrize("probability", [1.0, 0.7])
@pytest.mark.parametrize("gains", [None, (0.75, 0.5, 0), (0.3, 0.05, 0)])
@pytest.mark.parametrize(
    ("mean", "variance"), [((0, 0, 0), 0.0), ((0, 0, 2.0), 0.0), ((0, 0, 2.0), 1.5)], ids=["known", "lag", "random"]
)
def test_the_limit_is_where_the_exact_error_goes(gains, mean, variance, probability):
    model = filter_of((0, 0, 0), gains)
    if gains is None and probability < 1:
        model = filter_of((0, 0, 0), model.gains[-1])
    truth = truth_of(model, mean, np.diag([4.0, 1, variance]))
    sigma, _ = exact(truth, model, probability)
    found = limit(truth, model, probability)
    settled = np.abs(sigma[-1] / np.where(sigma[-1], sigma[-1], 1) - sigma[-2] / np.where(sigma[-1], sigma[-1], 1))
    np.testing.assert_allclose(found, sigma[-1], rtol=1e-9 + 10 * settled.max())
    assert found[2] == pytest.approx(np.sqrt(mean[2] ** 2 + variance), abs=0)


def test_a_known_oscillation_leaves_the_limits_of_the_rest():
    turn = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    F = np.block([[np.eye(1), np.zeros((1, 2))], [np.zeros((2, 1)), turn]])
    F[0, 1] = 1.0
    Q, P, H, sigma = np.diag([0.5, 0, 0]), np.diag([9.0, 0, 0]), np.tile([[1.0, 0, 0]], (60, 1, 1)), np.ones((60, 1))
    model = Matrices(F, Q, np.zeros(3), P, H, sigma**2, H, sigma, kalman(F, Q, P, H, sigma**2), False)
    found = limit((F, Q, np.zeros(3), P), model, 1.0)
    p = (0.5 + np.sqrt(0.25 + 2)) / 2  # the positive root of p² = q p + q r, before a plot
    np.testing.assert_allclose(found, [np.sqrt(p / (p + 1)), 0, 0], rtol=1e-12)


def test_an_error_that_grows_has_no_limit():
    model = filter_of((0, 0, 0), (0.5, 0, 0))  # a constant error of a moves v without end
    assert np.isnan(limit(truth_of(model, (0, 0, 1.0), np.diag([4.0, 1, 0])), model, 1.0)).all()


def test_a_constant_that_a_filter_estimates_has_no_limit_of_its_own_here():
    model = filter_of((0, 0, 0), P=np.diag([4.0, 1, 3.0]), q=0.3)
    assert np.isnan(limit(truth_of(model, (0, 0, 0), model.P), model, 1.0)).all()
