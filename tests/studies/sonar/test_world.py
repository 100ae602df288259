"""The sonar's world: error correlation, targets in two frames, conversion against quadrature."""

import numpy as np
import pytest

from radarsim.studies.sonar import conversion, plot_errors, target_motion
from tests.tolerances import assert_rounded, rounding


def test_correlation_over_lags_and_gaps():
    t = np.array([0.0, 5.0, 15.0, 20.0])
    C = plot_errors.error_covariance(np.full(4, 2.0), 0.6, t, 5.0)
    # A power, which is off by a unit, and products.
    assert_rounded(C[0], [4, 4 * 0.6, 4 * 0.6**3, 4 * 0.6**4], operations=4)
    assert_rounded(plot_errors.step_correlations(-0.5, t, 5.0), [0, -0.5, 0.25, -0.5], operations=2)
    assert_rounded(plot_errors.error_covariance(np.full(4, 2.0), -0.5, t, 5.0)[0], [4, -2, -0.5, 0.25], operations=4)
    assert not plot_errors.step_correlations(0.0, t, 5.0).any()


def assert_derivatives(states, t):
    """Rates and accelerations are central differences, but for h²/6 times the third derivative and for rounding."""
    h, inner = t[1] - t[0], slice(2, -2)
    jerk = np.gradient(states[:, 2], h, edge_order=2)
    for i, third in enumerate((jerk, np.gradient(jerk, h, edge_order=2))):
        off = np.abs(np.gradient(states[:, i], h) - states[:, i + 1])[inner]
        rounded = rounding(operations=8) * np.abs(states[:, i]).max() / h
        assert off.max() <= h**2 / 6 * np.abs(third).max() + rounded


def test_frames_are_inverse_and_their_rates_are_derivatives():
    t = np.linspace(0, 400, 4001)
    r, b = target_motion.polynomial_states([[9e3, -4, 0.01], [0.3, 2e-3, 1e-6]], t)
    x, y = target_motion.cartesian_states(r, b)
    assert_derivatives(x, t)
    assert_derivatives(y, t)
    # Of turns by an angle there and back; accelerations are summed with v²/r.
    distance, speed, acceleration = (np.hypot(x[:, i], y[:, i]) for i in range(3))
    size = np.stack([distance, speed, acceleration + speed**2 / distance], axis=1)
    back = target_motion.polar_states(x, y)
    assert_rounded(back[0], r, size, operations=24)
    assert_rounded(back[1], b, size / distance[:, None], operations=24)


def test_turning_target_keeps_its_speed_and_its_legs_join():
    t = np.linspace(0, 300, 30001)
    x, y = target_motion.turning_states(8000, -2000, 6.0, 1.0, [(60.0, 120.0, 0.02), (200.0, 230.0, -0.01)], t)
    assert_rounded(np.hypot(x[:, 1], y[:, 1]), np.full(30001, 6.0), operations=6)
    # The trapezoid's error, h²/12 times the second derivative of the rate, and rounding of 10 km over h.
    allowed = 0.01**2 / 12 * 6.0 * 0.02**2 + rounding(operations=8) * 1e4 / 0.01
    for states in (x, y):
        assert np.max(np.abs(np.diff(states[:, 0]) / 0.01 - (states[1:, 1] + states[:-1, 1]) / 2)) <= allowed
    course = np.unwrap(np.arctan2(y[:, 1], x[:, 1]))
    assert_rounded(course[-1] - course[0], 0.02 * 60 - 0.01 * 30, size=course.max(), operations=8)


@pytest.mark.parametrize(("r", "b", "sigma_b"), [(9e3, 0.35, 0.0175), (20e3, 1.2, 0.1), (5e3, -2.0, 0.2)])
def test_conversions_against_quadrature(r, b, sigma_b):
    """By Gauss-Hermite integration: no mean error and the stated covariance, and the plain conversion's stated bias."""
    sigma_r = 30.0
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    weights = weights / weights.sum()
    rr, bb = np.meshgrid(r + sigma_r * nodes, b + sigma_b * nodes, indexing="ij")
    w = np.outer(weights, weights)
    true = np.array([r * np.cos(b), r * np.sin(b)])
    x, y, _ = conversion.convert_unbiased(rr, bb, sigma_r, sigma_b)
    error = np.stack([x - true[0], y - true[1]])
    # As many terms of the target's range; its square in the covariance, the formula's by itself, and terms of σ² r².
    assert_rounded((w * error).sum(axis=(1, 2)), np.zeros(2), r, operations=w.size)
    _, _, (xx, xy, yy) = conversion.convert_unbiased(r, b, sigma_r, sigma_b)
    moments = np.einsum("ikl,jkl,kl->ij", error, error, w)
    assert_rounded(moments, [[xx, xy], [xy, yy]], np.full((2, 2), r**2), operations=20 + w.size * sigma_b**2)
    x, y, plain = conversion.convert_plainly(rr, bb, sigma_r, sigma_b)
    mean = np.array([(w * (x - true[0])).sum(), (w * (y - true[1])).sum()])
    assert_rounded(mean, conversion.conversion_bias(r, sigma_b) * true / r, r, operations=w.size)
    _, _, plain = conversion.convert_plainly(r, b, sigma_r, sigma_b)
    if sigma_b < 0.02:
        # The linear one lacks terms of σ_β⁴ r²/2 and σ_β² σ_r².
        second_order = sigma_b**2 * ((sigma_b * r) ** 2 + sigma_r**2)
        assert np.array(plain) == pytest.approx([xx, xy, yy], abs=second_order)
