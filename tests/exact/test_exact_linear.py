"""Exact errors of the linear filters: against an outside calculation, algebra, and limits."""

import numpy as np
import pytest

from radarsim.exact.linear import error_recursion, steady_state
from radarsim.filters.linear import design, least_squares_start, observation
from radarsim.models import targets
from radarsim.models.motion import transition

RADARS = {"rls1": (25, 5, 10), "rls2": (250, 15, 10), "rls3": (250, 15, 5), "rls4": (50, 1, 10), "rls5": (50, 1, 5)}
START = {1: 3, 2: 2}


def sigmas(radar, observes, variance=1e-3, scans=15, coefficients=(1e5, -250.0, 4.0)):
    """Exact bias (K, 3) and σ (K, 3) of a radar's filter."""
    *sigma, dt = RADARS[radar]
    sigma = np.array(sigma, dtype=float)
    made = design(observes, START[observes], variance, sigma, dt, scans)
    x = targets.polynomial(coefficients, np.arange(scans) * dt)
    bias, covariance = error_recursion(made.weights, made.gains, observes, x, sigma, dt)
    return bias, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)), made


# From a calculation by another program: radar, filter, D_M, k, σ_r (m), σ_V (m/s), σ_a (m/s²).
OUTSIDE = [
    ("rls1", 1, 1e-4, 8, 21.36624861, 1.663756707, 0.0662397783),
    ("rls1", 2, 1e-4, 5, 21.24652485, 2.180825908, 0.1046122666),
    ("rls1", 1, 1e-4, 15, 21.12113437, 1.650972125, 0.06603374031),
]


@pytest.mark.parametrize(("radar", "observes", "variance", "k", "r", "v", "a"), OUTSIDE)
def test_agrees_with_an_outside_calculation(radar, observes, variance, k, r, v, a):
    _, sigma, _ = sigmas(radar, observes, variance)
    np.testing.assert_allclose(sigma[k - 1], [r, v, a], rtol=2e-9)


@pytest.mark.parametrize("radar", RADARS)
def test_first_estimates_are_the_papers_closed_forms(radar):
    """σ_a(3) = √6 σ_r/Δt² and σ_V(3) = √26/2 σ_r/Δt for range alone; σ_a(2) = √2 σ_V/Δt with velocity."""
    sr, sv, dt = RADARS[radar]
    _, alone, _ = sigmas(radar, 1)
    _, both, _ = sigmas(radar, 2)
    assert alone[2] == pytest.approx([sr, np.sqrt(26) / 2 * sr / dt, np.sqrt(6) * sr / dt**2], rel=1e-12)
    assert both[1, 2] == pytest.approx(np.sqrt(2) * sv / dt, rel=1e-12)
    assert both[0, :2] == pytest.approx([sr, sv], rel=1e-15)


def test_range_after_two_scans_with_velocity():
    expected = {"rls1": 21.65, "rls2": 183.93, "rls3": 178.71, "rls4": 35.53, "rls5": 35.40}
    for radar, value in expected.items():
        assert sigmas(radar, 2)[1][1, 0] == pytest.approx(value, abs=0.005)


@pytest.mark.parametrize("observes", [1, 2])
@pytest.mark.parametrize("radar", RADARS)
def test_settles_to_the_steady_state(radar, observes):
    *sigma, dt = RADARS[radar]
    believed, true = steady_state(observes, 1e-3, np.array(sigma, dtype=float), dt)
    _, far, made = sigmas(radar, observes, scans=400)
    np.testing.assert_allclose(far[-1], np.sqrt(np.diag(true)), rtol=1e-7)
    np.testing.assert_allclose(made.believed[-1], believed, rtol=1e-7)


def test_a_quadratic_truth_leaves_no_bias_and_a_cubic_one_does():
    *_, dt = RADARS["rls2"]
    quadratic, _, _ = sigmas("rls2", 1, scans=40)
    assert np.abs(quadratic).max() < 1e-6
    cubic, _, made = sigmas("rls2", 1, scans=400, coefficients=(1e5, -250.0, 4.0, 0.01))
    # Steady bias of a constant jerk: b = (I - KH)(B b - j (dt³/6, dt²/2, dt)).
    kept = np.eye(3) - made.gains[-1, :, :1] @ observation(1)
    defect = 0.01 * np.array([dt**3 / 6, dt**2 / 2, dt])
    steady = np.linalg.solve(np.eye(3) - kept @ transition(dt), -kept @ defect)
    np.testing.assert_allclose(cubic[-1], steady, rtol=1e-5)


def test_believed_covariance_without_manoeuvre_variance_is_the_true_one():
    """With D_M = 0 the filter is least squares over all plots, and what it believes is so."""
    sigma = np.array([250.0, 15.0])
    for observes in (1, 2):
        made = design(observes, START[observes], 0.0, sigma, 10.0, 15)
        x = targets.polynomial([1e5, -250.0, 4.0], np.arange(15) * 10.0)
        _, covariance = error_recursion(made.weights, made.gains, observes, x, sigma, 10.0)
        # Down to the rounding of the start, whose largest terms cancel.
        np.testing.assert_allclose(made.believed[1:], covariance[1:], rtol=1e-9, atol=1e-12)
        _, batch = least_squares_start(observes, 15, sigma, 10.0)
        np.testing.assert_allclose(covariance[-1], batch, rtol=1e-9)


@pytest.mark.parametrize(("observes", "n"), [(1, 3), (1, 7), (2, 2), (2, 5)])
def test_start_weights_return_a_polynomial_exactly(observes, n):
    dt = 10.0
    weights, _ = least_squares_start(observes, n, np.array([25.0, 5.0]), dt)
    x = targets.polynomial([3e4, 120.0, -2.0], np.arange(n) * dt)
    np.testing.assert_allclose(np.einsum("ijk,kj->i", weights, x[:, :2]), x[-1], rtol=1e-9, atol=1e-9)
    assert not weights[:, observes:].any()
