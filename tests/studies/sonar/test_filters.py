"""Designs of the sonar filters: against textbook twins, against each other, and against closed forms."""

import numpy as np
import pytest

from radarsim.studies.sonar import closed_forms, filter_design, least_squares
from tests.studies.sonar import naive as naive
from tests.studies.sonar.precision import assert_covariances_rounded, assert_estimates_rounded, losses
from tests.tolerances import assert_rounded

PERIOD, SIGMA = 5.0, 30.0


def plots(weight, t=None, sigma=SIGMA):
    weight = np.atleast_2d(np.asarray(weight, dtype=float))
    return filter_design.Plots(np.arange(weight.shape[1]) * PERIOD if t is None else t, weight, PERIOD, sigma)


def pattern(seed, scans=40, missed=0.3):
    seen = np.random.default_rng(seed).random(scans) > missed
    seen[0] = True
    return seen


def run(design, t, z):
    """The recursion of all filters on one realisation's plots (K,), with not-a-number where missed."""
    x, e, out = np.zeros(3), 0.0, []
    for k in range(len(t)):
        x = naive.F(t[k] - t[k - 1] if k else 0.0, 3) @ x
        e *= design.carry[k]
        if not np.isnan(z[k]):
            innovation = z[k] - x[0] - e
            x = x + design.gain[0, k, :3] * innovation
            e += design.gain[0, k, 3] * innovation
        out.append(x)
    return np.array(out)


def compare(design, z, twin, errors=0.0):
    """Estimates and covariances equal the twin's; errors: see `losses`."""
    x, P = twin
    size = design.size
    t = np.arange(len(z)) * PERIOD
    assert_estimates_rounded(run(design, t, z)[:, :size], x, P, z, SIGMA, errors)
    assert_covariances_rounded(design.covariance[0, :, :size, :size], P, errors)


@pytest.fixture(params=[1, 2, 3])
def observed(request):
    """Plots of a straight track with gaps: weights (K,), plots (K,) with not-a-number where missed."""
    rng = np.random.default_rng(request.param)
    seen = pattern(request.param)
    t = np.arange(len(seen)) * PERIOD
    return seen, np.where(seen, 9e3 - 4 * t + SIGMA * rng.normal(size=len(seen)), np.nan)


T = np.arange(40) * PERIOD


@pytest.mark.parametrize("size", [2, 3])
@pytest.mark.parametrize("rho", [-0.5, 0.0, 0.3, 0.6, 0.9, 0.99])
def test_differenced_and_augmented_are_generalised_least_squares(observed, size, rho):
    seen, z = observed
    errors = np.linalg.cond(rho ** np.rint(np.abs(T[seen][:, None] - T[seen]) / PERIOD))
    differenced, augmented = (
        filter_design.design_recursion(plots(seen), size, rho, *variance) for variance in ((), (0.0,))
    )
    for design in (differenced, augmented):
        compare(design, z, naive.batch(T, z, size, SIGMA, rho, PERIOD), errors)
    compare(differenced, z, naive.differenced(T, z, size, SIGMA, rho, PERIOD), errors)


def test_growing_memory_kalman_and_closed_forms_agree():
    everything = plots(np.ones(50))
    line, kalman = (
        filter_design.design_recursion(everything, 2),
        filter_design.design_recursion(everything, 2, 0.0, 0.0),
    )
    n = np.arange(2, 51)
    A, B = closed_forms.gains_closed(n)
    P = line.covariance[0, 1:]
    loss = losses(P[:, :2, :2])
    for design in (line, kalman):
        for i, closed in enumerate((A, B / PERIOD)):
            assert_rounded(design.gain[0, 1:, i], closed, loss * closed)
        smoothed = SIGMA * closed_forms.sigma_smoothed(n)
        assert_rounded(np.sqrt(design.covariance[0, 1:, 0, 0]), smoothed, loss * smoothed)
    ahead = P[:, 0, 0] + 2 * PERIOD * P[:, 0, 1] + PERIOD**2 * P[:, 1, 1]  # all positive
    extrapolated = SIGMA * closed_forms.sigma_extrapolated(n)
    assert_rounded(np.sqrt(ahead), extrapolated, loss * extrapolated)
    second, n = filter_design.design_recursion(everything, 3, 0.0), n[1:]
    kalman = filter_design.design_recursion(everything, 3, 0.0, 0.0)
    sigma = SIGMA * closed_forms.sigma_acceleration(n, PERIOD)
    for design in (second, kalman):
        assert_rounded(np.sqrt(design.covariance[0, 2:, 2, 2]), sigma, losses(second.covariance[0, 2:]) * sigma)


def test_printed_gains_of_unequal_weights_are_wrong_and_ours_right():
    """The print gives B_n for equal weights alone; with others only the recursion is least squares."""
    rng = np.random.default_rng(7)
    weight, t = rng.uniform(0.1, 4, 12), np.cumsum(rng.uniform(0.3, 2, 12)) * PERIOD
    t -= t[0]
    design = filter_design.design_recursion(plots(weight, t), 2)
    C = np.diag(SIGMA**2 / weight)
    W, P = least_squares.generalised_least_squares(t, C, 2)
    loss = losses(design.covariance[0, 1:, :2, :2])[-1]
    assert_rounded(design.gain[0, -1, :2], W[:, -1], condition=loss)
    assert_rounded(design.covariance[0, -1, :2, :2], P, condition=loss)
    assert abs(design.gain[0, -1, 1] * PERIOD / (6 / (12 * 13)) - 1) > 0.05


def test_missed_plot_has_no_gain_and_a_second_plot_at_one_time_averages():
    seen = np.ones(10)
    seen[[4, 5]] = 0
    for size in (2, 3):
        for design in (
            filter_design.design_recursion(plots(seen), size, 0.6),
            filter_design.design_recursion(plots(seen), size, 0.6, 1e-4),
            filter_design.design_recursion(plots(seen), size, 0.0, 1e-4),
            filter_design.design_recursion(
                plots(seen), size, 0.0, 1e-4, 0, filter_design.steady_gain(PERIOD, SIGMA, size, 1e-4)
            ),
        ):
            assert not design.gain[0, 4:6].any()
            assert design.gain[0, 6].any()
    twice = filter_design.design_recursion(plots([1, 1, 1], np.array([0.0, 0.0, PERIOD])), 2)
    assert_rounded(twice.gain[0, :, 0], [1, 0.5, 1], condition=losses(twice.covariance[0, 2:, :2, :2])[-1])


def test_a_plot_at_the_time_of_the_last_one_tells_nothing_of_a_correlated_error():
    design = filter_design.design_recursion(plots(np.ones(5), np.array([0.0, 5.0, 10.0, 10.0, 15.0])), 2, 0.6, 0.0)
    assert not design.gain[0, 3].any()
    assert np.isfinite(design.covariance).all()
