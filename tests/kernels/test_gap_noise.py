"""Process noise over gaps: that of the scans between, in exact arithmetic, and a covariance that grows."""

from fractions import Fraction

import numpy as np
import pytest

from radarsim.kernels import gap_noise
from radarsim.kernels.kalman_algebra import unpack
from radarsim.physics import motion

LAWS = {  # of a variance of one in a scan period of one
    "random_jerk": lambda t: gap_noise.manoeuvre_noise(1, t, 1, 3),
    "white_acceleration": lambda t: gap_noise.acceleration_step_noise(1, t, 1),
    "white_jerk": lambda t: gap_noise.white_jerk_noise(1, t),
}
GAPS = (*(Fraction(k, 7) for k in range(8, 60)), Fraction(10**3), Fraction(10**6 * 3 + 1, 3), Fraction(10**12))


def carried(Q, t):
    """F Q F' over a time t, exactly."""
    t = Fraction(t)
    F = np.array([[1, t, t * t / 2], [0, 1, t], [0, 0, 1]], dtype=object)
    return F @ Q @ F.T


@pytest.mark.parametrize("kind", LAWS)
def test_the_noise_of_whole_periods_is_that_of_the_scans_in_them(kind):
    scan = np.array(
        [[Fraction(x).limit_denominator(1000) for x in row] for row in motion.process_noise(kind, 1.0, 1.0)]
    )
    total = np.zeros((3, 3), dtype=object)
    for k in range(1, 40):
        total = carried(total, 1) + scan
        if k > 1:
            assert (unpack_exactly(LAWS[kind](Fraction(k))) == total).all()
    for first, second in ((10**12, 1), (10**6, 10**12), (3, 10**9)):
        parts = [unpack_exactly(LAWS[kind](Fraction(part))) if part > 1 else scan for part in (first, second)]
        assert (unpack_exactly(LAWS[kind](Fraction(first + second))) == carried(parts[0], second) + parts[1]).all()


def unpack_exactly(packed):
    return np.array([[packed[i] for i in column] for column in ((0, 1, 2), (1, 3, 4), (2, 4, 5))], dtype=object)


@pytest.mark.parametrize("kind", LAWS)
def test_the_noise_of_any_gap_is_a_covariance(kind):
    """All principal minors, exactly."""
    for t in GAPS:
        Q = unpack_exactly(LAWS[kind](t))
        for rows in ((0,), (1,), (2,), (0, 1), (0, 2), (1, 2), (0, 1, 2)):
            assert determinant(Q[np.ix_(rows, rows)]) >= 0, (t, rows)


def determinant(Q):
    if len(Q) == 1:
        return Q[0, 0]
    return sum((-1) ** j * Q[0, j] * determinant(np.delete(Q[1:], j, axis=1)) for j in range(len(Q)))


@pytest.mark.parametrize("kind", LAWS)
def test_variances_grow_with_the_gap(kind):
    times = np.concatenate([np.linspace(0.01, 12, 2000), np.geomspace(12.5, 1e12, 500)])
    variances = np.array([np.diag(unpack(LAWS[kind](t))) for t in times.tolist()])
    assert np.isfinite(variances).all()
    assert (np.diff(variances, axis=0) > 0).all() or (np.diff(variances, axis=0) > -1e-12 * variances[1:]).all()


def test_a_random_acceleration_is_the_lower_part_of_a_random_jerk():
    for t in (0.4, 1.0, 1.3, 2.0, 17.2):
        jerk, acceleration = (unpack(gap_noise.manoeuvre_noise(0.3, t, 1.0, size)) for size in (3, 2))
        np.testing.assert_allclose(acceleration[:2, :2], jerk[1:, 1:], rtol=1e-14)


def test_up_to_a_period_there_is_one_draw():
    for t in (0.1, 2.0, 2.5, 2.5 * (1 + 1e-12)):
        np.testing.assert_allclose(
            unpack(gap_noise.manoeuvre_noise(0.3, t, 2.5, 3)), motion.manoeuvre_covariance(0.3, t), rtol=1e-14
        )
