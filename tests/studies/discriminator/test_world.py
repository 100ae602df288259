"""The burst's signal: times, phase, profiles, amplitude."""

from dataclasses import replace

import numpy as np
import pytest

from radarsim.bursts import burst as model
from tests.tolerances import assert_rounded, rounding

PAPER = model.Burst(10e9, 1e-5, 1e-6, 1e-6, 30000, 1.0, 2.25)


def test_sample_times_lie_inside_the_pulses():
    burst = replace(PAPER, pulses=5, sampling_period_s=0.3e-6)
    t = model.sample_times(burst, 5)
    assert t.shape == (4, 5)  # 0, 0.3, 0.6, 0.9 µs
    assert np.all(t % 1e-5 < 1e-6)
    assert replace(PAPER, sampling_period_s=0.1e-6).samples_per_pulse == 10  # 1e-6/1e-7 is 9.999…


def test_a_duration_is_rounded_to_the_nearest_pulse():
    assert PAPER.pulses_in(0.3) == 30000  # 0.3/1e-5 is 29999.999999999996
    assert PAPER.pulses_in(1.7877e-3) == 179
    assert PAPER.pulses_in(1e-9) == 1


def test_phase_is_the_printed_polynomial():
    theta, t = np.array([0.7, 1e4, 18e4, -75e4, 1e6]), 0.123
    by_hand = 0.7 / (2 * np.pi) + 1e4 * t + 18e4 * t**2 / 2 - 75e4 * t**3 / 6 + 1e6 * t**4 / 24
    assert_rounded(model.phase_turns(theta, t), by_hand, condition=1.3, operations=10)  # one of five terms is negative


def test_coefficients_and_parameters_are_one_polynomial():
    theta = np.array([0.7, 1e4, 18e4, -75e4, 1e6])
    b = theta * model.turns_per_parameter(5, 0.3)
    half = model.phase_turns(theta, 0.15)
    assert_rounded(np.polynomial.polynomial.polyval(0.5, b), half, condition=1.3, operations=12)


def test_signal_is_a_cosine_or_its_analytic_partner():
    turns = np.array([0.0, 0.25, 1000.5])
    allowed = rounding(2 * np.pi * turns.max())  # of the phase in rad
    assert model.signal(PAPER, turns) == pytest.approx([1, 0, -1], rel=0, abs=allowed)
    assert model.signal(replace(PAPER, complex_samples=True), turns) == pytest.approx([1, 1j, -1], rel=0, abs=allowed)


def test_profile_phase_is_the_integral_of_its_doppler():
    profile = model.VelocityProfile((0.0, 0.1, 0.2, 0.3), (0.0, 350.0, 450.0, 475.0))
    t = np.linspace(0, 0.3, 30001)
    f = 2 / 0.03 * np.interp(t, profile.times_s, profile.velocities_mps)
    assert f[[0, 10000, 20000, 30000]] == pytest.approx([0, 23333.3, 30000, 31666.7], abs=0.1)
    integral = np.concatenate([[0], np.cumsum(0.5 * (f[1:] + f[:-1]) * np.diff(t))])
    # The rule is exact between corners; its sum is of so many terms.
    assert profile.phase_turns(t, 0.03, 0.0) == pytest.approx(integral, rel=0, abs=rounding(integral[-1], len(t)))


def test_a_polynomial_phase_is_fitted_by_itself():
    theta = np.array([0.7, 1e4, 18e4, -75e4, 1e6])
    t = model.sample_times(PAPER, 30000)
    # By least squares over powers of time in bursts: in turns all coefficients are known to κ(V) ε of the largest.
    turns = theta * model.turns_per_parameter(5, 0.3)
    condition = np.linalg.cond(np.vander(np.linspace(0, 1, 100), 5))
    allowed = rounding(condition, 10) * np.abs(turns).max() / np.abs(turns)
    assert (np.abs(model.fitted_parameters(model.phase_turns(theta, t), t, 5) / theta - 1) <= allowed).all()


def test_balanced_inverse_of_a_matrix_of_many_magnitudes():
    scale = 10.0 ** np.array([0, 4, 8, 12])
    root = np.random.default_rng(2).normal(size=(4, 4))
    even = root @ root.T + np.eye(4)
    matrix = even * np.outer(scale, scale)
    product = model.balanced_inverse(matrix) @ matrix / np.outer(1 / scale, scale)
    assert product == pytest.approx(np.eye(4), rel=0, abs=rounding(np.linalg.cond(even), 16))
