"""The sonar's world: error correlation, targets in two frames, conversion against quadrature."""

import numpy as np
import pytest

from radarsim.studies.sonar import world


def test_correlation_over_lags_and_gaps():
    t = np.array([0.0, 5.0, 15.0, 20.0])
    C = world.error_covariance(np.full(4, 2.0), 0.6, t, 5.0)
    assert C[0] == pytest.approx([4, 4 * 0.6, 4 * 0.6**3, 4 * 0.6**4])
    assert world.step_correlations(-0.5, t, 5.0) == pytest.approx([0, -0.5, 0.25, -0.5])
    assert world.error_covariance(np.full(4, 2.0), -0.5, t, 5.0)[0] == pytest.approx([4, -2, -0.5, 0.25])
    assert not world.step_correlations(0.0, t, 5.0).any()


def differences(states, t):
    """Largest relative deviation of rates and accelerations from numerical derivatives."""
    h = t[1] - t[0]
    rate, second = np.gradient(states[:, 0], h, edge_order=2), np.gradient(states[:, 1], h, edge_order=2)
    inner = slice(2, -2)
    return max(
        np.max(np.abs(rate - states[:, 1])[inner]) / np.max(np.abs(states[:, 1])),
        np.max(np.abs(second - states[:, 2])[inner]) / np.max(np.abs(states[:, 2])),
    )


def test_frames_are_inverse_and_their_rates_are_derivatives():
    t = np.linspace(0, 400, 4001)
    r, b = world.polynomials([[9e3, -4, 0.01], [0.3, 2e-3, 1e-6]], t)
    x, y = world.cartesian_states(r, b)
    assert differences(x, t) < 1e-6
    assert differences(y, t) < 1e-6
    back = world.polar_states(x, y)
    assert back[0] == pytest.approx(r, rel=1e-10)
    assert back[1] == pytest.approx(b, rel=1e-9, abs=1e-12)


def test_turning_target_keeps_its_speed_and_its_legs_join():
    t = np.linspace(0, 300, 30001)
    x, y = world.turning(8000, -2000, 6.0, 1.0, [(60.0, 120.0, 0.02), (200.0, 230.0, -0.01)], t)
    assert np.hypot(x[:, 1], y[:, 1]) == pytest.approx(6.0)
    assert np.max(np.abs(np.diff(x[:, 0]) / 0.01 - (x[1:, 1] + x[:-1, 1]) / 2)) < 1e-4
    assert np.max(np.abs(np.diff(y[:, 0]) / 0.01 - (y[1:, 1] + y[:-1, 1]) / 2)) < 1e-4
    course = np.unwrap(np.arctan2(y[:, 1], x[:, 1]))
    assert course[-1] - course[0] == pytest.approx(0.02 * 60 - 0.01 * 30)


@pytest.mark.parametrize(("r", "b", "sigma_b"), [(9e3, 0.35, 0.0175), (20e3, 1.2, 0.1), (5e3, -2.0, 0.2)])
def test_conversions_against_quadrature(r, b, sigma_b):
    """By Gauss-Hermite integration: no mean error and the stated covariance, and the plain conversion's stated bias."""
    sigma_r = 30.0
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    weights = weights / weights.sum()
    rr, bb = np.meshgrid(r + sigma_r * nodes, b + sigma_b * nodes, indexing="ij")
    w = np.outer(weights, weights)
    true = np.array([r * np.cos(b), r * np.sin(b)])
    x, y, _ = world.converted_unbiased(rr, bb, sigma_r, sigma_b)
    error = np.stack([x - true[0], y - true[1]])
    assert np.abs((w * error).sum(axis=(1, 2))).max() < 1e-8 * r
    _, _, (xx, xy, yy) = world.converted_unbiased(r, b, sigma_r, sigma_b)
    moments = np.einsum("ikl,jkl,kl->ij", error, error, w)
    assert moments == pytest.approx(np.array([[xx, xy], [xy, yy]]), rel=1e-8)
    x, y, plain = world.converted(rr, bb, sigma_r, sigma_b)
    mean = np.array([(w * (x - true[0])).sum(), (w * (y - true[1])).sum()])
    assert mean == pytest.approx(world.conversion_bias(r, sigma_b) * true / r, rel=1e-6)
    _, _, plain = world.converted(r, b, sigma_r, sigma_b)
    if sigma_b < 0.02:
        assert np.array(plain) == pytest.approx([xx, xy, yy], rel=5e-3)
