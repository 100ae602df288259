"""Laws of the detector of manoeuvres: known values, each law against another way to it."""

import numpy as np
import pytest
from scipy import stats

from radarsim.studies.sonar import exact as least_squares
from radarsim.studies.sonar.manoeuvre import exact


def test_the_papers_k_of_one():
    """0.683 is no alarm without a manoeuvre; to detect as often takes 1.456 σ_a, and one σ_a gives 0.523 (P3 eq. 3)."""
    assert 1 - exact.false_alarm(1.0) == pytest.approx(0.683, abs=5e-4)
    assert exact.detection(1.0, 1.0) == pytest.approx(0.523, abs=5e-4)
    assert exact.shift_for(1 - exact.false_alarm(1.0), 1.0) == pytest.approx(1.456, abs=5e-4)
    assert exact.shift_for(0.3, 1.0) == 0.0


@pytest.mark.parametrize("coordinates", [1, 2, 3])
def test_thresholds_undo_false_alarms(coordinates):
    p = np.array([0.5, 0.1, 1e-3, 1e-9])
    assert exact.false_alarm(exact.threshold(p, coordinates), coordinates) == pytest.approx(p, rel=1e-9)
    assert exact.detection(exact.threshold(p, coordinates), 0.0, coordinates) == pytest.approx(p, rel=1e-9)


def test_detection_is_the_noncentral_law():
    k, shift = np.array([[0.5], [4.0], [20.0]]), np.array([0.3, 1.0, 5.0])
    assert exact.detection(k, shift) == pytest.approx(stats.ncx2.sf(k, 1, shift**2), rel=1e-9)
    # Two coordinates: condition on the second, which is one of one degree of freedom.
    x = np.linspace(-9, 9, 200_001)
    inner = np.where(x**2 < 6.0, exact.detection(np.maximum(6.0 - x**2, 0.0), 1.2), 1.0)
    mixed = np.trapezoid(inner * stats.norm.pdf(x - 0.7), x)
    assert exact.detection(6.0, np.hypot(1.2, 0.7), 2) == pytest.approx(mixed, rel=1e-6)


def test_acceleration_of_a_window_has_the_papers_variance():
    for n in (3, 5, 8):
        t = np.arange(n) * 2.0
        weights, _ = least_squares.generalised_least_squares(t, np.eye(n), 3)
        mean, variance = exact.acceleration_law(weights[2:], 7 - t + 0.3 * t**2 / 2, 4.0 * np.eye(n), np.zeros((n, 1)))
        assert mean == pytest.approx(0.3)
        assert np.sqrt(variance) == pytest.approx(2.0 * least_squares.sigma_acceleration(n, 2.0))


def test_a_random_push_adds_to_the_variance():
    """Pushes are independent: each adds the square of what it moves."""
    weights, pushes = np.array([[1.0, -2.0, 1.0]]), np.array([[0.0, 0.0], [1.0, 0.0], [4.0, 3.0]])
    _, variance = exact.acceleration_law(weights, np.zeros(3), np.eye(3), pushes)
    assert variance == pytest.approx(6 + 2**2 + 3**2)


def test_first_of_independent_tests():
    assert exact.by_then(np.array([0.5, 0.0, 0.5])) == pytest.approx([0.5, 0.5, 0.75])
