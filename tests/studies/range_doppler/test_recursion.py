"""Many versions at once against the recursion of one filter, and the starts against plain textbook forms."""

import numpy as np
import pytest

from radarsim.papers.range_doppler import filter_versions
from radarsim.papers.range_doppler.measures import RADARS
from radarsim.physics.motion import manoeuvre_covariance, transition
from radarsim.studies.range_doppler import error_recursion
from radarsim.studies.range_doppler.error_recursion import Plots
from radarsim.studies.range_doppler.filter_design import design
from tests.studies.range_doppler import naive
from tests.tolerances import absolute_product, assert_rounded, rounding, scaled_condition

VARIANCES = (1e-5, 1e-3, 1e-1)


@pytest.mark.parametrize("radar", RADARS.values(), ids=RADARS)
@pytest.mark.parametrize(("start", "scans"), [("weighted", (3, 2)), ("four_and_four", (4, 4))])
def test_the_papers_filter_is_the_one_of_one_filter_at_a_time(radar, start, scans):
    sigma, dt = np.array(radar[:2], dtype=float), radar[2]
    found = filter_versions.errors_of_both_filters(radar, [("random_jerk", v, start) for v in VARIANCES], 29)
    for observes, of in zip((1, 2), found, strict=True):
        for i, variance in enumerate(VARIANCES):
            one = design(observes, scans[observes - 1], variance, sigma, dt, 29)
            _, S = error_recursion.error_recursion(one, Plots(sigma), np.zeros((29, 3)), dt)
            true = np.sqrt(np.diagonal(S, axis1=1, axis2=2))
            believed = np.sqrt(np.diagonal(one.believed, axis1=1, axis2=2))
            known = one.available
            P = one.believed[scans[observes - 1] - 1 :]
            loss = naive.update_loss(P, naive.manoeuvre(variance, dt), sigma[:observes], dt)
            tolerance = naive.precision(P, loss=loss)
            np.testing.assert_allclose(of.true[i][known], true[known], rtol=tolerance)
            np.testing.assert_allclose(of.believed[i][known], believed[known], rtol=tolerance)
            assert np.isnan(of.true[i][~known]).all()


@pytest.mark.parametrize("observes", [1, 2])
def test_a_start_with_process_noise_is_a_kalman_filter_without_a_prior(observes):
    sigma, dt = np.array([25.0, 5.0]), 10.0
    Q, variance, push = manoeuvre_covariance(1e-2, dt), 1e-2, np.array([dt**3 / 6, dt**2 / 2, dt])
    believed, _ = filter_versions.start_covariances("process_noise", observes, sigma, dt, Q[None])
    # The information form of the filter, from nothing: plot, step, plot, …
    H, R = np.eye(3)[:observes], np.diag(sigma[:observes] ** 2)
    F = transition(dt)
    back = np.linalg.inv(F)
    gained = H.T @ np.linalg.inv(R) @ H
    information = gained.copy()
    for _ in range((3, 2)[observes - 1] - 1):
        M = back.T @ information @ back  # less what is lost by one jerk of this variance, that moves all three
        information = M - np.outer(M @ push, push @ M) / (1 / variance + push @ M @ push) + gained
    tolerance = rounding(scaled_condition(information), 30)  # ten operations a scan
    np.testing.assert_allclose(believed[0], np.linalg.inv(information), rtol=tolerance)


def test_the_true_error_of_a_start_with_process_noise_is_that_of_its_weights():
    sigma, dt = np.array([25.0, 5.0]), 10.0
    Q = manoeuvre_covariance(1e-1, dt)[None]
    believed, true = filter_versions.start_covariances("process_noise", 2, sigma, dt, Q)
    least, _ = filter_versions.start_covariances("weighted", 2, sigma, dt, Q)
    gap = np.linalg.eigvalsh(true[0] - least[0])
    assert gap.min() > -rounding(scaled_condition(least[0]), 10) * np.trace(true[0])
    assert gap.max() > 0
    assert np.all(np.diag(believed[0]) >= np.diag(true[0]))


def test_first_differences_and_unweighted_starts_by_hand():
    sigma, dt, Q = np.array([30.0, 4.0]), 5.0, np.zeros((1, 3, 3))
    _, true = filter_versions.start_covariances("first_differences", 2, sigma, dt, Q)
    assert_rounded(np.diag(true[0]), [30.0**2, 4.0**2, 2 * 4.0**2 / dt**2], operations=10)
    _, three = filter_versions.start_covariances("first_differences", 1, sigma, dt, Q)
    assert_rounded(np.diag(three[0]), [30.0**2, 2 * 30.0**2 / dt**2, 6 * 30.0**2 / dt**4], operations=10)
    rows = np.concatenate([np.eye(3)[:2] @ transition(-dt), np.eye(3)[:2]])  # both scans, plain least squares
    weights = np.linalg.inv(rows.T @ rows) @ rows.T
    _, plain = filter_versions.start_covariances("unweighted", 2, sigma, dt, Q)
    exact_form = weights @ np.diag(np.tile(sigma**2, 2)) @ weights.T
    size = absolute_product(weights, np.diag(np.tile(sigma**2, 2)), weights.T)
    assert_rounded(plain[0], exact_form, size=size, condition=scaled_condition(rows.T @ rows), operations=10)


def test_forms_of_the_manoeuvre_covariance():
    dt, steps = 4.0, 4000
    Q = np.zeros((3, 3))
    small = transition(dt / steps)
    for _ in range(steps):  # a white jerk of density 1 is many small independent steps of acceleration
        g = np.array([0.0, 0.0, 1.0])
        Q = small @ Q @ small.T + dt / steps * np.outer(g, g)
    white = filter_versions.covariance_of("white_jerk", 1.0, 1.0, dt)
    np.testing.assert_allclose(white, Q, rtol=3 / steps)  # a sum of t⁴ is 5/2 of a step off its integral
    assert_rounded(filter_versions.covariance_of("white_jerk_rate", 1.0, 1.0, dt), dt * white, operations=10)
    step = filter_versions.covariance_of("acceleration_step", 2.0, 1.0, dt)
    np.testing.assert_array_equal(step, 2.0 * np.outer([8.0, 4.0, 1.0], [8.0, 4.0, 1.0]))
    normalised = filter_versions.covariance_of("normalised", 1e-3, 25.0, dt)
    assert_rounded(normalised, manoeuvre_covariance(1e-3 * 625, dt), operations=10)
