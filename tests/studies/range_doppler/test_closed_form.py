"""The groups, the limit of fast scans and the sign of the gain in acceleration, against the recursion."""

import numpy as np
import pytest
import scipy.linalg

from radarsim.papers.range_doppler import filter_versions
from radarsim.papers.range_doppler.measures import RADARS
from radarsim.studies.range_doppler import closed_form, steady_state
from tests.tolerances import assert_rounded, rounding, scaled_condition

VERSION = [("random_jerk", 1e-3, "weighted")]


def gains(radar, variance, scans=15):
    base, own = filter_versions.errors_of_both_filters(radar, [("random_jerk", variance, "weighted")], scans)
    return filter_versions.gain(base.true[0], own.true[0])[2:]


@pytest.mark.slow
def test_gains_depend_on_the_scan_and_the_two_groups_alone():
    rng = np.random.default_rng(5)
    for _ in range(300):
        sigma_r, sigma_V, dt = 10 ** rng.uniform([0, -1, -1], [3, 2, 2])
        variance = 10 ** rng.uniform(-6, 2)
        of = closed_form.dimensionless_groups(sigma_r, sigma_V, dt, variance)
        # Another radar with the same groups: a range and a period of its own, the rest follows.
        other_r, other_dt = 10 ** rng.uniform([0, -1], [3, 2])
        other_V = other_r / (other_dt * np.sqrt(of.C_theta))
        other_variance = (of.Lambda * other_r / other_dt**3) ** 2
        same = closed_form.dimensionless_groups(other_r, other_V, other_dt, other_variance)
        assert_rounded(same, of, operations=20)  # powers of a dozen numbers
        own, other = gains((sigma_r, sigma_V, dt), variance), gains((other_r, other_V, other_dt), other_variance)
        # Of covariances whose units are their own: three ranges, velocities that tell next to nothing, and manoeuvres
        # beside which nothing is known before a plot. Ten operations a scan; gains are differences of two σ.
        condition = 250 + 2 / of.C_theta + of.Lambda**2 / 10
        assert_rounded(own, other, size=100 + abs(own), condition=condition, operations=150)


MOTION = np.diag([1.0, 1.0], 1)  # of (r, V, a) over time, in units of τ₂


def riccati(c):
    """Covariance that the limit filter believes and its gain on range and velocity, by SciPy."""
    H, R = np.eye(3)[: 2 if c else 1], np.diag([1.0, 1 / c] if c else [1.0])
    P = scipy.linalg.solve_continuous_are(MOTION.T, H.T, np.diag([0.0, 0.0, 1.0]), R)
    return P, P @ H.T @ np.linalg.inv(R), H, R


@pytest.mark.parametrize("c", [0.0, 1e-3, 0.1, 0.698, 3.0, 30.0, 300.0, 1e4])
def test_the_rational_forms_solve_the_riccati_and_the_lyapunov_equation(c):
    P, K, H, R = riccati(c)
    # SciPy solves an equation whose matrices are off by roundings of their largest number, c.
    scale, tolerance = np.sqrt(np.diag(P)), {"condition": scaled_condition(P) + c, "operations": 10}
    assert_rounded(closed_form.believed_covariance(c), P, size=np.outer(scale, scale), **tolerance)
    gain = closed_form.steady_gain(c)[:, : len(H)]
    assert_rounded(gain, K, size=np.outer(scale, scale[: len(H)]) @ np.linalg.inv(R), **tolerance)
    closed = MOTION - K @ H
    terms = np.abs(np.poly(-np.abs(np.linalg.eigvals(closed))))  # of the sums of products of roots
    assert_rounded(np.poly(closed), closed_form.error_polynomial(c), size=terms, **tolerance)
    noise = np.diag(scipy.linalg.solve_continuous_lyapunov(closed, -K @ R @ K.T))
    assert_rounded(closed_form.noise_variances(c), noise, size=scale**2, **tolerance)


def test_the_forms_take_arrays():
    c = np.array([[0.0, 0.7], [5.0, 1e12]])
    assert closed_form.steady_gains(c).shape == (3, 2, 2)
    np.testing.assert_array_equal(closed_form.steady_gains(c)[:, 1, 0], closed_form.steady_gains(5.0))
    np.testing.assert_array_equal(closed_form.steady_gains(c)[:, 0, 0], 0)
    # The vast c: gains near 100 %, as A ~ (4c)^(1/4) has them.
    assert (closed_form.steady_gains(c)[:, 1, 1] > 96).all()


def test_without_velocity_the_variances_are_simple_fractions():
    # 1/3 is what is left of 2; the polynomial is of small whole numbers.
    assert_rounded(closed_form.noise_variances(0.0), [5 / 3, 3 / 2, 1 / 3], size=2, operations=10)
    np.testing.assert_array_equal(closed_form.error_polynomial(0.0), [1, 2, 2, 1])


@pytest.mark.parametrize("c", [0.3, 1.0, 10.0, 100.0])
def test_the_limit_is_that_of_the_recursion_for_fast_scans(c):
    sigma_r, variance = 100.0, 1e-2
    memory = closed_form.filter_memory(sigma_r, variance)
    sigma = np.array([sigma_r, sigma_r / (memory * np.sqrt(c))])
    away = []
    for share in (0.02, 0.01):
        both = [steady_state.steady_state(observes, variance, sigma, share * memory)[1] for observes in (1, 2)]
        base, own = (np.sqrt(np.diag(S)) for S in both)
        away.append(filter_versions.gain(base, own) - closed_form.steady_gains(c))
    # Of first order in Δt; the next is smaller by the step in memories of the fastest root, √2 c^(1/4)/τ₂.
    step = np.sqrt(2) * max(c, 1) ** 0.25 * share
    assert np.abs(2 * away[1] - away[0]).max() < 2 * step * np.abs(away[0]).max()
    assert np.abs(away[1]).max() < closed_form.LIMIT_POINTS
    unit = sigma_r**2 * share * np.array([1, memory**-2, memory**-4])
    np.testing.assert_allclose(np.diag(both[1]), unit * closed_form.noise_variances(c, share), rtol=step**2)


def test_the_acceleration_gain_changes_sign_at_c_of_seven_tenths():
    at = closed_form.no_acceleration_gain()
    assert at == pytest.approx(0.698, abs=5e-4)  # as printed
    assert closed_form.steady_gains(0.9 * at)[2] < 0 < closed_form.steady_gains(1.1 * at)[2]


def test_a_target_that_moves_as_believed_never_loses_by_the_velocity():
    variances = (1e-4, 1e-3, 1e-2)
    for radar in RADARS.values():
        for start, from_scan in (("process_noise", 0), ("weighted", 40)):
            base, own = filter_versions.errors_of_both_filters(
                radar, [("random_jerk", v, start) for v in variances], 120
            )
            least = np.nanmin(filter_versions.gain(base.believed, own.believed)[:, from_scan:])
            assert least > -100 * rounding(operations=4)  # it is 0 at the first plot
    # Two that ignore the manoeuvre while they start, one over two scans and one over three, are not comparable.
    base, own = filter_versions.errors_of_both_filters(RADARS[1], [("random_jerk", 1e-2, "weighted")], 60)
    assert np.nanmin(filter_versions.gain(base.believed, own.believed)) < -1
    # And the same filters lose on a truth that does not manoeuvre, where c is small.
    base, own = filter_versions.errors_of_both_filters(RADARS[1], VERSION, 60)
    assert np.nanmin(filter_versions.gain(base.true, own.true)[:, 40:]) < -1
