"""Exact errors of the linear filters: against an outside calculation, algebra, and limits."""

import numpy as np
import pytest

from radarsim.kernels.kalman_algebra import pack
from radarsim.physics import targets
from radarsim.physics.motion import process_noise, transition
from radarsim.studies.range_doppler.error_recursion import Plots, error_recursion
from radarsim.studies.range_doppler.filter_design import design, least_squares_start, noise_by_time, observation
from radarsim.studies.range_doppler.kernels.recorded_rows import noise_over
from radarsim.studies.range_doppler.steady_state import normalised_error, steady_state
from tests.studies.range_doppler import naive
from tests.tolerances import assert_rounded, mean_error, scaled_condition

RADARS = {"rls1": (25, 5, 10), "rls2": (250, 15, 10), "rls3": (250, 15, 5), "rls4": (50, 1, 10), "rls5": (50, 1, 5)}
START = {1: 3, 2: 2}


def sigmas(radar, observes, variance=1e-3, scans=15, coefficients=(1e5, -250.0, 4.0)):
    """Exact bias (K, 3) and σ (K, 3) of a radar's filter."""
    *sigma, dt = RADARS[radar]
    sigma = np.array(sigma, dtype=float)
    made = design(observes, START[observes], variance, sigma, dt, scans)
    x = targets.polynomial(coefficients, np.arange(scans) * dt)
    lasting, covariance = error_recursion(made, Plots(sigma), x, dt)
    return lasting[:, :, 0], np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)), made


# From a calculation by another program: radar, filter, D_M, k, σ_r (m), σ_V (m/s), σ_a (m/s²).
OUTSIDE = [
    ("rls1", 1, 0.0001, 4, 24.36698589, 3.913121958, 0.2500037329),
    ("rls1", 1, 0.001, 15, 22.93971175, 2.734737655, 0.1680410921),
    ("rls1", 2, 0.0001, 4, 21.44923771, 2.700968809, 0.1670624167),
    ("rls1", 2, 0.001, 15, 21.07992477, 2.423337125, 0.1777127122),
    ("rls2", 1, 0.001, 7, 218.2281655, 17.04707822, 0.5475353504),
    ("rls2", 1, 0.001, 15, 189.3437389, 9.883065557, 0.2599204319),
    ("rls2", 2, 0.001, 7, 157.2882415, 8.537999348, 0.2882934311),
    ("rls2", 2, 0.001, 15, 154.70673, 7.615483011, 0.2562505753),
    ("rls3", 1, 0.01, 5, 235.2809876, 55.7417566, 5.3452282),
    ("rls3", 1, 0.001, 15, 170.4854702, 11.33401406, 0.3151735222),
    ("rls3", 2, 0.01, 5, 129.8429622, 11.20004567, 0.9372707692),
    ("rls3", 2, 0.001, 15, 120.4860665, 6.195684952, 0.1939480391),
    ("rls4", 1, 0.001, 15, 43.81226442, 4.0462822, 0.1918540135),
    ("rls4", 2, 0.001, 15, 20.91510801, 0.9208438431, 0.1292880191),
    ("rls5", 1, 0.0001, 4, 48.73397172, 15.65247584, 2),
    ("rls5", 1, 0.001, 15, 35.98558263, 3.157960652, 0.1419148076),
    ("rls5", 2, 0.0001, 4, 25.30094242, 0.8343365248, 0.08954159168),
    ("rls5", 2, 0.001, 15, 16.02713655, 0.7862479252, 0.09708078126),
]


@pytest.mark.parametrize(("radar", "observes", "variance", "k", "r", "v", "a"), OUTSIDE)
def test_agrees_with_an_outside_calculation(radar, observes, variance, k, r, v, a):
    _, sigma, _ = sigmas(radar, observes, variance)
    np.testing.assert_allclose(sigma[k - 1], [r, v, a], rtol=5e-10)  # ten printed digits


@pytest.mark.parametrize("radar", RADARS)
def test_first_estimates_are_the_papers_closed_forms(radar):
    """σ_a(3) = √6 σ_r/Δt² and σ_V(3) = √26/2 σ_r/Δt for range alone; σ_a(2) = √2 σ_V/Δt with velocity."""
    sr, sv, dt = RADARS[radar]
    _, alone, of_range = sigmas(radar, 1)
    _, both, of_both = sigmas(radar, 2)
    three = [sr, np.sqrt(26) / 2 * sr / dt, np.sqrt(6) * sr / dt**2]
    assert_rounded(alone[2], three, condition=scaled_condition(of_range.believed[2]), operations=10)
    condition = scaled_condition(of_both.believed[1])
    assert_rounded(both[1, 2], np.sqrt(2) * sv / dt, condition=condition, operations=10)
    assert both[0, :2].tolist() == [sr, sv]  # roots of squares of whole numbers


@pytest.mark.parametrize("observes", [1, 2])
@pytest.mark.parametrize("radar", RADARS)
def test_settles_to_the_steady_state(radar, observes):
    *sigma, dt = RADARS[radar]
    believed, true = steady_state(observes, 1e-3, np.array(sigma, dtype=float), dt)
    _, far, made = sigmas(radar, observes, scans=400)
    # A memory is of two to four scans, (σ²/D)^(1/6)/Δt: the start is forgotten, and so are roundings of ten scans ago.
    tolerance = naive.precision(np.array([believed, true]), 10)
    np.testing.assert_allclose(far[-1], np.sqrt(np.diag(true)), rtol=tolerance)
    np.testing.assert_allclose(made.believed[-1], believed, rtol=tolerance)


def test_a_quadratic_truth_leaves_no_bias_and_a_cubic_one_does():
    *_, dt = RADARS["rls2"]
    quadratic, _, made = sigmas("rls2", 1, scans=40)
    # Of ranges of up to 307 km, in units of σ and of the scan period.
    assert np.abs(quadratic * [1, dt, dt**2]).max() < naive.precision(made.believed[2:]) * 307e3
    cubic, _, made = sigmas("rls2", 1, scans=400, coefficients=(1e5, -250.0, 4.0, 0.01))
    # A parabola through three points of a cubic: its rate lags by j dt²/3, its bend by j dt.
    parabola, size = [0.0, -0.01 * dt**2 / 3, -0.01 * dt], 1e5 / np.array([1, dt, dt**2])
    assert_rounded(cubic[2], parabola, size=size, condition=scaled_condition(made.believed[2]), operations=10)
    # Steady bias of a constant jerk: b = (I - KH)(B b - j (dt³/6, dt²/2, dt)).
    kept = np.eye(3) - made.gains[-1, :, :1] @ observation(1)
    defect = 0.01 * np.array([dt**3 / 6, dt**2 / 2, dt])
    steady = np.linalg.solve(np.eye(3) - kept @ transition(dt), -kept @ defect)
    # The defect is what is left of ranges of 1e8 m, and is added up over the scans of a memory, two.
    size = targets.polynomial((1e5, -250.0, 4.0, 0.01), np.array([399 * dt]))[0, 0] / np.array([1, dt, dt**2])
    assert_rounded(cubic[-1], steady, size=size, condition=2, operations=10)


def test_believed_covariance_without_manoeuvre_variance_is_the_true_one():
    """With D_M = 0 the filter is least squares over all plots, and what it believes is so."""
    sigma = np.array([250.0, 15.0])
    for observes in (1, 2):
        made = design(observes, START[observes], 0.0, sigma, 10.0, 15)
        x = targets.polynomial([1e5, -250.0, 4.0], np.arange(15) * 10.0)
        _, covariance = error_recursion(made, Plots(sigma), x, 10.0)
        tolerance = naive.precision(made.believed[START[observes] - 1 :])
        scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))[1:]
        allowed = tolerance * scale[:, :, None] * scale[:, None, :]
        assert (np.abs(made.believed[1:] - covariance[1:]) <= allowed).all()
        _, batch = least_squares_start(observes, 15, sigma, 10.0)
        np.testing.assert_allclose(covariance[-1], batch, rtol=tolerance)


@pytest.mark.parametrize("observes", [1, 2])
@pytest.mark.parametrize("variance", [1e-2, 1e-9, 1e-16])
def test_steady_state_of_fast_radars_with_long_memory(observes, variance):
    """A filter whose memory is hundreds of scans and more: its closed form, in the limit of continuous plots of range.

    A jerk of variance D held for dt has the spectral density D·dt, plots have σ²·dt: its poles are those of the
    third-order Butterworth filter of ω = (D/σ²)^(1/6), its transfer function (2ω s² + 2ω² s + ω³) over their product,
    and the variance that it leaves of the plots' noise is 5/3·ω·σ²·dt (Parseval).
    """
    dt, sigma = 0.01, np.array([50.0, 1e6])
    states = steady_state(observes, variance, sigma, dt)
    omega = (variance / sigma[0] ** 2) ** (1 / 6)
    assert omega * dt < 0.01
    # Of first order in ω dt; velocities to 1e6 m/s tell nothing.
    tolerance = omega * dt + naive.precision(np.array(states), 1 / (omega * dt))
    assert states[1][0, 0] == pytest.approx(5 / 3 * omega * dt * sigma[0] ** 2, rel=tolerance)


@pytest.mark.parametrize("pattern", [(True, True, True), (True, True, False), (True, False, False)])
def test_normalised_error_of_gaussian_errors(pattern):
    """Mean and variance of eᵀP⁻¹e per component against a million drawn errors, of units that differ by 10⁴."""
    rng, known = np.random.default_rng(5), np.flatnonzero(pattern)
    units = np.array([250.0, 15.0, 0.02])
    P, S = (_covariance(rng, units) for _ in range(2))
    m = 0.7 * units
    mean, variance = normalised_error(P[None], m[None], (S + np.outer(m, m))[None], np.array([pattern]))
    e = rng.multivariate_normal(m[known] / units[known], (S / np.outer(units, units))[np.ix_(known, known)], 10**6)
    inverse = np.linalg.inv((P / np.outer(units, units))[np.ix_(known, known)])
    q = np.einsum("ni,ij,nj->n", e, inverse, e) / known.size
    assert mean.item() == pytest.approx(q.mean(), abs=mean_error(10**6, q.std()))
    assert variance.item() == pytest.approx(q.var(), abs=mean_error(10**6, ((q - q.mean()) ** 2).std()))


def _covariance(rng, units):
    A = rng.normal(size=(3, 3))
    return (A @ A.T + np.eye(3)) * np.outer(units, units)


def test_normalised_error_without_components_is_not_a_number():
    of = normalised_error(np.zeros((1, 3, 3)), np.zeros((1, 3)), np.zeros((1, 3, 3)), np.zeros((1, 3), dtype=bool))
    assert np.isnan(of).all()


def test_normalised_error_of_a_singular_covariance_is_not_a_number_beside_others_that_are():
    P = np.stack([np.diag([4.0, 1.0, 1.0]), np.ones((3, 3))])
    mean, variance = normalised_error(P, np.zeros((2, 3)), 2 * P, np.ones((2, 3), dtype=bool))
    assert_rounded(mean, [2, np.nan], operations=5)
    assert_rounded(variance, [8 / 3, np.nan], operations=5)


@pytest.mark.parametrize("noise", ["random_jerk", "white_jerk", "white_acceleration"])
def test_noise_over_a_time_of_one_period_is_that_of_a_scan(noise):
    noise_over_period = noise_over(noise_by_time(noise, 0.3, 7.0), 7.0)
    assert_rounded(np.array(noise_over_period), pack(process_noise(noise, 0.3, 7.0)), operations=10)
