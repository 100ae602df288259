"""Fisher matrices of the burst against the print, against sums, against numerical differentiation."""

from dataclasses import replace

import numpy as np
import pytest

from radarsim.bursts import burst as model
from radarsim.bursts import fisher
from tests.studies.discriminator import naive
from tests.tolerances import assert_rounded, rounding, scaled_condition

PAPER = model.Burst(10e9, 1e-5, 1e-6, 1e-6, 30000, 1.0, 2.25)
THETA = np.array([0.7, 1e4, 18e4, -75e4, 1e6])


def test_published_spreads_belong_to_a_quarter_of_the_printed_noise():
    information = fisher.fisher(PAPER, 5, 0.3)
    computed = fisher.spreads(information)
    assert computed == pytest.approx([0.06124, 0.4502, 12.20, 183.4, 1213], rel=5e-4)  # four printed digits
    printed_noise = fisher.spreads(fisher.fisher(replace(PAPER, noise_variance=9.0), 5, 0.3))
    assert_rounded(printed_noise, 2 * computed, condition=scaled_condition(information), operations=5)


def test_with_one_period_less_all_printed_digits_come_out():
    assert fisher.spreads(fisher.fisher(PAPER, 5, 0.29999))[3:] == pytest.approx([183.38, 1213.04], abs=0.01)


def test_closed_form_is_the_printed_matrix():
    mu = fisher.energy_ratio(PAPER, 0.3)
    assert_rounded(mu, 30000 / 9, operations=6)
    assert_rounded(
        fisher.fisher(PAPER, 5, 0.3), naive.fisher(mu, 0.3, 5), operations=20
    )  # powers of T up to the eighth


@pytest.mark.parametrize("pulses", [100, 1000, 10000])
def test_sum_tends_to_the_closed_form(pulses):
    duration = pulses * PAPER.pulse_period_s
    scale = np.sqrt(np.diag(fisher.fisher(PAPER, 5, duration)))
    difference = naive.fisher_sum(PAPER, 5, pulses) - fisher.fisher(PAPER, 5, duration)
    assert np.abs(difference / np.outer(scale, scale)).max() < 6 / pulses


@pytest.mark.parametrize("complex_samples", [False, True])
@pytest.mark.parametrize("size", [2, 4, 6])
def test_exact_sum_is_the_curvature_of_the_likelihood(size, complex_samples):
    """Without noise the Hessian at the truth is minus the Fisher matrix: by second differences."""
    burst = replace(PAPER, pulses=200, complex_samples=complex_samples, sampling_period_s=0.5e-6)
    theta = np.array([0.7, 1e4, 18e4, -75e4, 1e6, 1e7])[:size]
    t = model.sample_times(burst, 200)
    u = model.signal(burst, model.phase_turns(theta, t))
    information = naive.fisher_sum(burst, size, 200, theta)
    moved = 1e-3
    step = moved / np.sqrt(np.diag(information))

    def value(moves):
        return naive.log_posterior(theta + moves, u, t, 1.0, burst.noise_variance, theta, 0.0)

    for i in range(size):
        for j in range(i + 1):
            a, b = np.eye(size)[i] * step, np.eye(size)[j] * step
            curvature = (value(a + b) - value(a - b) - value(b - a) + value(-a - b)) / (4 * step[i] * step[j])
            scale = np.sqrt(information[i, i] * information[j, j])
            # Moves of a thousandth of a radian rms: the second difference errs by their square, times a fourth
            # derivative of up to some ten; residuals of this size are known to the rounding of phases, up to 10³ rad.
            allowed = 10 * moved**2 + 4 * rounding(1e3) / moved
            assert curvature / scale == pytest.approx(-information[i, j] / scale, rel=0, abs=allowed)


def test_the_image_matters_where_doppler_is_near_zero():
    slow = np.array([0.7, 100.0, -2000.0, 0, 0])
    without = fisher.spreads(naive.fisher_sum(PAPER, 5, 199))
    difference = [np.abs(fisher.spreads(naive.fisher_sum(PAPER, 5, 199, at)) / without - 1) for at in (THETA, slow)]
    assert difference[0].max() < 0.05
    assert difference[1].max() > 0.15


def test_shortest_window_is_the_printed_one_with_the_printed_estimates():
    printed = replace(PAPER, noise_variance=9.0)
    assert_rounded(fisher.shortest_window(printed), 1.8e-3, operations=6)
    assert fisher.shortest_window(replace(printed, amplitude=1.17)) == pytest.approx(1.315e-3, abs=1e-6)
    assert fisher.energy_ratio(printed, 1.79e-3) == pytest.approx(4.97, abs=0.005)


def test_complex_samples_hold_twice_the_information():
    twice = 2 * fisher.fisher(PAPER, 5, 0.3)
    assert_rounded(fisher.fisher(replace(PAPER, complex_samples=True), 5, 0.3), twice, operations=20)


@pytest.mark.parametrize("theta", [None, THETA])
def test_many_windows_at_once_are_as_one_by_one(theta):
    windows = [100, 199, 5000, 30000]
    for window, information in zip(windows, fisher.fisher_sums(PAPER, 5, windows, theta), strict=True):
        scale = np.sqrt(np.diag(information))
        alone = naive.fisher_sum(PAPER, 5, window, theta)
        # Sums of so many pulses, weighted by sin² of phases of up to 2·10⁴ rad where θ is given.
        off = rounding(operations=window) + (0 if theta is None else rounding(4e4))
        assert information / np.outer(scale, scale) == pytest.approx(alone / np.outer(scale, scale), rel=0, abs=off)


def test_what_is_not_determined_has_no_bound():
    assert np.all(np.isinf(fisher.spreads(np.zeros((3, 3)))))
    assert np.all(np.isinf(fisher.spreads(np.ones((2, 2)))))
