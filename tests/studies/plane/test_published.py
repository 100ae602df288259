"""What is published of filters in the plane, found again.

BWB: Bordonaro, Willett & Bar-Shalom, IEEE Trans. AES 50 (2014), 1431: converted plots are biased by the conversion, and
estimates from them by taking the covariance at the plot.
BS: Bar-Shalom, IEEE Trans. AES 37 (2001), 1117: a negative correlation of range and radial velocity helps.
BST: Bar-Shalom & Tse, Automatica 11 (1975), 451: among false plots PDA keeps tracks that the nearest plot loses."""

import math

import numpy as np
import pytest

from radarsim.kernels.polar_plots import converted
from radarsim.studies.registry import study
from tests.studies.plane.cases import STRAIGHT, case_of, member
from tests.tolerances import mean_error, share_error, sigma_error


def run(filters, n, target, scans, **radar):
    case = case_of(filters, target, scans, **radar)
    plan = study("plane").prepare(case)
    return plan.layout.unpack(sum(study("plane").simulate(plan, i, 512) for i in range(0, n, 512)))


def test_the_plain_conversion_is_too_short_and_the_unbiased_one_is_not():
    """By r (exp(-σ²/2) - 1) along the line of sight; BWB eq. 2."""
    n, r, sigma, generator = 100_000, 100e3, (50.0, 0.05), np.random.default_rng(5)
    plots = r + sigma[0] * generator.normal(size=n), sigma[1] * generator.normal(size=n)
    for unbiased, wanted in ((False, r * (math.exp(-(sigma[1] ** 2) / 2) - 1)), (True, 0.0)):
        (x, y), _ = converted(plots, sigma, unbiased)
        assert abs(x.mean() - r - wanted) < mean_error(n, x.std()) < 5
        assert abs(y.mean()) < mean_error(n, y.std())


def test_estimates_from_converted_plots_are_too_far():
    """A plot weighs most along its own bearing, which is off by b: the sum of (cos b x - z)² is least at x =
    r E cos b / E cos² b, r σ²/2 too far; where the conversion makes plots longer, by as much more. An extended filter
    does not err so. BWB II."""
    n, r, sigma = 4096, 100e3, 0.02
    slow = {"kind": "straight", "range_m": r, "speed_mps": 20.0, "aspect_rad": math.pi / 2}
    keys = {"doppler": False, "sigma_acceleration_mps2": 0.01, "sigma_start_velocity_mps": 30.0}
    filters = [
        member("extended", **keys),
        *(member("converted", unbiased=unbiased, **keys) for unbiased in (False, True)),
    ]
    radar = {"sigma_bearing_rad": sigma, "detection_probability": 1.0, "range_velocity_correlation": 0.0}
    first, second = run(filters, n, slow, 30, **radar)["error"][:, -1, 0, :2].T / n
    bias = r * sigma**2 / 2
    for mean, square, wanted in zip(first, second, (0.0, bias, 2 * bias), strict=True):
        assert abs(mean - wanted) < mean_error(n, math.sqrt(square)) + 0.1 * bias
    assert bias > 3 * mean_error(n, math.sqrt(second.max()))


def test_a_negative_correlation_of_range_and_velocity_helps():
    """The next range is the range and its rate times the period: their errors cancel. BS section III."""
    n, sigma = 2048, []
    straight = STRAIGHT | {"aspect_rad": 3.0}
    filters = [member("extended"), member("converted")]
    for rho in (-0.9, 0.0, 0.9):
        radar = {"sigma_bearing_rad": 1e-3, "detection_probability": 1.0, "range_velocity_correlation": rho}
        sums = run(filters, n, straight, 20, **radar)
        sigma.append(np.sqrt(sums["error"][:, -1, 0, 1] / n))
        assert np.all(np.abs(np.sqrt(sums["believed"][:, -1, 0] / n) / sigma[-1] - 1) < sigma_error(n) + 0.05)
    negative, none, positive = np.array(sigma) * (1 + np.outer((1, 0, -1), (1, 1)) * sigma_error(n))
    assert np.all(negative < 0.5 * none)
    assert np.all(none * (1 + sigma_error(n)) < positive)


@pytest.mark.slow
def test_pda_keeps_tracks_that_the_nearest_plot_loses_and_doppler_keeps_more():
    """Of the nearest plot the more, the denser the false plots. BST section 5."""
    n, kept = 4096, []
    filters = [member("extended", doppler=d, association=a) for d in (False, True) for a in ("nearest", "pda")]
    for density in (0.05, 0.15):
        radar = {"repetition_rate_hz": 40e3, "false_plots_per_km2": density, "false_plots_from_s": 20.0}
        sums = run(filters, n, STRAIGHT, 25, detection_probability=0.9, **radar)
        kept.append(sums["counts"][:, -1, 0] / n)
    (few, *_), (nearest, pda, *with_doppler) = kept
    assert few - nearest > math.hypot(share_error(few, n), share_error(nearest, n))
    assert pda - nearest > share_error(nearest, n)
    assert min(with_doppler) - pda > share_error(pda, n)
