"""Exact values of P3: the paper's numbers, generalised least squares, and the true errors of given filters."""

import numpy as np
import pytest

from radarsim.studies.sonar import closed_forms, exact_errors, filter_design, least_squares, plot_errors
from tests.studies.sonar.precision import TERMS, assert_covariances_rounded
from tests.tolerances import assert_rounded


def test_sigma_formulas_have_the_digests_values():
    n = np.arange(2, 9)
    assert closed_forms.sigma_smoothed(n).round(3).tolist() == [1, 0.913, 0.837, 0.775, 0.724, 0.681, 0.645]
    assert closed_forms.sigma_extrapolated(n).round(3).tolist() == [2.236, 1.528, 1.225, 1.049, 0.931, 0.845, 0.779]


@pytest.mark.parametrize(
    ("rho", "n", "optimal", "naive", "believed"),
    [
        (0.0, 10, (0.5878, 0.1101), (0.5878, 0.1101), (0.5878, 0.1101)),
        (0.6, 10, (0.8748, 0.1503), (0.9122, 0.1582), (0.5878, 0.1101)),
        (0.9, 20, (0.9637, 0.0689), (1.0377, 0.0761), (0.4309, 0.0388)),
        (-0.5, 10, (0.3694, 0.0705), (0.3907, 0.0753), (0.5878, 0.1101)),
    ],
)
def test_table_of_the_digest(rho, n, optimal, naive, believed):
    t = np.arange(float(n))
    C = plot_errors.error_covariance(np.ones(n), rho, t, 1.0)
    _, P = least_squares.generalised_least_squares(t, C, 2)
    W, plain = least_squares.generalised_least_squares(t, np.eye(n), 2)
    for covariance, printed in ((P, optimal), (W @ C @ W.T, naive), (plain, believed)):
        assert tuple(np.sqrt(np.diag(covariance)).round(4)) == printed


@pytest.mark.parametrize("rho", [-0.5, 0.0, 0.6, 0.99])
@pytest.mark.parametrize("size", [2, 3])
def test_recursion_of_true_errors_is_that_of_the_weights(rho, size):
    """The joint recursion gives W C Wᵀ for filters whose weights are read off by unit plots."""
    rng = np.random.default_rng(3)
    seen = rng.random((4, 12)) > 0.3
    seen[:, :size] = True
    t = np.arange(12) * 5.0
    plots = filter_design.Plots(t, seen.astype(float), 5.0, 30.0)
    truth = np.stack([9e3 - 4 * t + 0.01 * t**3, -4 + 0.03 * t**2, 0.06 * t], axis=1)
    steps = plot_errors.step_correlations(rho, t, 5.0)
    C = plot_errors.error_covariance(np.full(12, 30.0), rho, t, 5.0)
    for design in (
        filter_design.design_recursion(plots, size),
        filter_design.design_recursion(plots, size, 0.6, 1e-4),
        filter_design.design_recursion(plots, size, 0.0, 1e-3, 0, filter_design.steady_gain(5.0, 30.0, size, 1e-3)),
    ):
        bias, S = exact_errors.recursive_errors(design.gain, design.carry, t, truth, steps, np.full(12, 30.0), 0.0)
        for m in range(4):
            W = np.array(unit_weights(design, t, m))
            for k in range(size - 1, 12):
                kept = W[k]
                summed = np.abs(kept) @ np.abs(truth[:, 0]) + np.abs(truth[k])
                assert_rounded(bias[m, k], kept @ truth[:, 0] - truth[k], summed, operations=12 * TERMS)
            expected = W @ C @ np.swapaxes(W, 1, 2)
            assert_covariances_rounded(S[m, size - 1 :], expected[size - 1 :], np.linalg.cond(C))


def unit_weights(design, t, m):
    """Weights (K, 3, K) of a recursive design: its answer to a unit plot at each scan in turn."""
    x, e, out = np.zeros((3, len(t))), np.zeros(len(t)), []
    for k in range(len(t)):
        dt = t[k] - t[k - 1] if k else 0.0
        x = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]]) @ x
        e = e * design.carry[k]
        innovation = np.eye(len(t))[k] - x[0] - e
        x = x + design.gain[m, k, :3, None] * innovation
        e = e + design.gain[m, k, 3] * innovation
        out.append(x)
    return out


def test_walk_of_velocity_by_both_ways_of_reckoning():
    """A filter's true error under a random walk of velocity: joint recursion against explicit weights of every push."""
    t, walk = np.arange(9) * 5.0, 0.02
    plots = filter_design.Plots(t, np.ones((1, 9)), 5.0, 30.0)
    truth = np.zeros((9, 3))
    design = filter_design.design_recursion(plots, 2)
    _, S = exact_errors.recursive_errors(design.gain, design.carry, t, truth, np.zeros(9), np.full(9, 30.0), walk)
    first, W, _ = filter_design.window_weights(plots, 8, 9, 2)
    C = plot_errors.error_covariance(np.full(9, 30.0), 0.0, t, 5.0)
    _, other = exact_errors.weighted_errors(W, first, t, truth, C, walk, first)
    assert_covariances_rounded(S[0, 1:], np.concatenate([S[0, 1:8], other]))


@pytest.mark.filterwarnings("error")
def test_plots_of_which_one_alone_counts_give_no_rate():
    plots = filter_design.Plots(np.array([0.0, 0.5, 1.0]), np.array([[1e-40, 1.0, 0.0]]), 1.0, 30.0)
    _, W, P = filter_design.window_weights(plots, 2, 5, 2)
    assert not W.any()
    assert not P.any()
