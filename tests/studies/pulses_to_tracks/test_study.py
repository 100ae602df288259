"""What is exact, what is statistics: idealisations, P1's tables, high signal-to-noise ratio, menus."""

import math

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.api.design.solve import solve
from radarsim.bursts.burst import LIGHT_MPS, Burst
from radarsim.studies import registry
from radarsim.studies.pulses_to_tracks import exact_errors, scenario, study, window_menu
from radarsim.studies.pulses_to_tracks.kernels.layout import AGES, LOCKED, TAKEN
from tests.studies.pulses_to_tracks.conftest import (
    CURED,
    IDEAL,
    RANGE,
    SEQUENCE,
    SPECTRUM,
    A,
    V,
    make_case,
    plan_and_sums,
)
from tests.tolerances import assert_rounded, rounding, sigma_error

N = 4096
TOLERANCE = sigma_error(N)
STRONG = {"snr_db": 20.0}


def test_the_bound_is_that_of_a_sinusoid():
    """Rife & Boorstyn 1974: var ω = 6/(snr N (N² − 1) T_p²); an acceleration that is estimated too changes nothing."""
    pulses, snr, period = 16, 10**0.524, 5e-5
    burst = Burst(LIGHT_MPS / 0.03, period, 1e-6, 1e-6, pulses, 1.0, 0.5 / snr, True)
    omega = math.sqrt(6 / (snr * pulses * (pulses**2 - 1))) / period
    expected = 0.03 / 2 * omega / (2 * math.pi)
    for size in (2, 3):
        # κ of three powers of time is 286; a length is taken for N T_p, and N² − 1 for a sum.
        assert_rounded(scenario.fisher_bounds(burst, size)[0], expected, condition=286, operations=2 * pulses)
    assert math.isinf(scenario.fisher_bounds(burst, 2)[1])
    # Of a chirp: var of the rate of ω, 360/(snr N (N² − 1)(N² − 4) T_p⁴) (Djuric & Kay 1990).
    rate = math.sqrt(360 / (snr * pulses * (pulses**2 - 1) * (pulses**2 - 4))) / period**2
    bound = scenario.fisher_bounds(burst, 3)[1]
    assert_rounded(bound, 0.03 / 2 * rate / (2 * math.pi), condition=286, operations=2 * pulses)


def test_power_falls_with_range_and_with_the_pulses_length():
    spec = make_case([RANGE], burst={"snr_range_m": 50e3, "pulse_length_s": 5e-5, "snr_db": 10.0}).spec
    truth = np.array([[100e3, 0.0, 0.0], [50e3, 0.0, 0.0], [50e3, -150.0, 0.0]])
    power = [0.5 / burst.noise_variance for burst in scenario.bursts(spec, truth)]
    loss = np.sinc(5e-5 * 2 * 150 / 0.03) ** 2
    expected_db = [10 - 40 * math.log10(2), 10, 10 + 10 * math.log10(loss)]
    # Powers are of a hundredth of a decibel.
    np.testing.assert_allclose(10 * np.log10(power), expected_db, rtol=0, atol=0.005 + rounding(50))


def test_the_idealisation_with_a_wide_prior_is_p1s_filter():
    """r+V with σ_V at the bound equals P1's exact σ of RLS 4 from the first scan where P1 has all estimates."""
    wide = {"sigma_velocity_mps": 3e4, "sigma_acceleration_mps2": 3e3}
    short = {"pulse_length_s": 1e-9}  # of which no Doppler frequency takes anything
    ideal = study.prepare(make_case([RANGE, IDEAL], burst=short, scans=15, prior=wide)).axes
    sigma = ideal.bound[1, 0, 0]
    p1 = registry.study("range_doppler")
    axes = p1.prepare(load("rls4", [f"radar.sigma_velocity_mps={sigma}"]).cases[0]).axes
    for f, first in ((0, 2), (1, 1)):
        np.testing.assert_allclose(ideal.exact_sigma[f, first:], axes.exact_sigma[f, first:], rtol=2e-4)


def test_sampled_idealisations_have_their_exact_errors():
    plan, sums = plan_and_sums(
        make_case(
            [RANGE, IDEAL, IDEAL | {"name": "a", "observes": A, "process_noise": "white_jerk"}], burst=STRONG, scans=5
        ),
        N,
    )
    sigma = np.sqrt(sums.error[..., 1] / N)
    np.testing.assert_allclose(sigma, plan.axes.exact_sigma, rtol=TOLERANCE)
    assert (sums.locks[1:, :, LOCKED] >= N - 1).all()


def test_exact_errors_follow_a_target_that_leaves_the_model():
    """The mean error of an acceleration that sets in is the filter's answer to it: twice as much for twice as hard."""
    brake = {"kind": "acceleration_start", "coefficients": [100e3, -250.0], "start_s": 15.0, "acceleration_mps2": 4.0}
    first = study.prepare(make_case([IDEAL], target=brake, scans=6)).axes.exact_bias
    second = study.prepare(make_case([IDEAL], target=brake | {"acceleration_mps2": 8.0}, scans=6)).axes.exact_bias
    # Differences from ranges of 100 km, extrapolated over 10 s and squares of it.
    allowed = rounding(operations=60) * 100e3 / 10.0 ** np.arange(3)
    assert (abs(second - 2 * first) <= 3 * allowed).all()
    assert abs(first[0, 2:, 0]).max() > 20
    assert (abs(first[0, :2]) <= allowed).all()


def test_filters_reach_their_idealisation_at_high_signal_to_noise_ratio():
    names = ("sequence", "dense", "cured", "spectrum")
    chains = [{"name": name, "observes": V, "estimator": name} for name in names]
    uses = [
        CURED | {"name": "gated", "use": "gated", "gate_probability": 1 - 1e-9},
        SPECTRUM | {"name": "mixture", "use": "mixture", "lock_probability": 1 - 1e-9},
        CURED | {"name": "fixed", "forecast": {"sigma_velocity_mps": 10.0, "sigma_acceleration_mps2": 5.0}},
    ]
    prior = {"sigma_velocity_mps": 10.0, "sigma_acceleration_mps2": 1.0}
    plan, sums = plan_and_sums(make_case([IDEAL, *chains, *uses], burst={"snr_db": 25.0}, prior=prior, scans=5), N)
    sigma = np.sqrt(sums.error[..., 1] / N)
    for f in range(1, len(sigma)):
        assert plan.axes.ideal[f] == 0
        np.testing.assert_allclose(sigma[f], plan.axes.exact_sigma[0], rtol=TOLERANCE)
        np.testing.assert_allclose(sigma[f], sigma[0], rtol=0.03)  # on the same noise


@pytest.mark.parametrize("snr_db", [20.0, 60.0, 100.0])
def test_measured_acceleration_at_high_signal_to_noise_ratio(snr_db):
    """Complex samples have no image, which real ones must not do without where the echo is strong."""
    burst = {"pulses": 256, "repetition_rate_hz": 20e3, "snr_db": snr_db}
    prior = {"sigma_velocity_mps": 5.0, "sigma_acceleration_mps2": 20.0}
    ideal = {"name": "ideal", "observes": A, "estimator": "fisher_bound"}
    chains = [{"name": name, "observes": A, "estimator": name} for name in ("cured", "spectrum")]
    plan, sums = plan_and_sums(make_case([ideal, *chains], burst=burst, prior=prior, scans=4), 2048)
    sigma = np.sqrt(sums.error[..., 1] / 2048)
    for f in range(3):
        np.testing.assert_allclose(sigma[f], plan.axes.exact_sigma[0], rtol=sigma_error(2048))
    measured = np.sqrt(sums.measured[..., 1, 0] / 2048)
    for f in range(3):
        np.testing.assert_allclose(measured[f], plan.axes.bound[0], rtol=sigma_error(2048))


def test_ages_count_each_realisation_once():
    _, sums = plan_and_sums(make_case([RANGE, SPECTRUM], burst={"snr_db": -2.0}, scans=9), 1024)
    assert (sums.ages[0] == 0).all()
    np.testing.assert_array_equal(sums.ages[1].sum(axis=1), 1024)
    lost = 1024 - sums.locks[1, :, LOCKED]
    np.testing.assert_array_equal(sums.ages[1, :, 0], lost)
    assert 0 < sums.ages[1, 8, 5] < sums.ages[1, 8, AGES - 1]
    np.testing.assert_allclose(
        sums.losses[1, ..., 0].sum(axis=1), sums.error[1, ..., 1], rtol=rounding(operations=1024)
    )


def test_menus_cover_all_forecasts():
    case = make_case([SEQUENCE, SEQUENCE | {"name": "a", "observes": A}], burst={"pulses": 512, "snr_db": 10.0})
    plan = study.prepare(case)
    for options, menu in zip(case.spec.filters, plan.menus, strict=True):
        widest = window_menu.widest_forecast(case.spec, options)
        assert menu.top == widest
        assert len(menu.windows) == menu.levels[0] * menu.levels[1]
        spreads = [menu.spreads(e) for e in range(len(menu.windows))]
        assert spreads[0] == widest
        assert_rounded(spreads[1][0], widest[0] / math.sqrt(2), operations=2)
        assert all(windows[-1] == 512 for windows in menu.windows)
        assert menu.windows[menu.levels[0] - 1 + (menu.levels[1] - 1) * menu.levels[0]] == (512,)
        firsts = [windows[0] for windows in menu.windows[: menu.levels[0]]]
        assert firsts == sorted(firsts)  # the better the forecast, the longer the first window may be
    assert plan.menus[0].levels[1] == 1
    assert plan.menus[1].levels[1] > 1


def test_narrow_gate_leaves_range_alone():
    gated = CURED | {"name": "gated", "use": "gated", "gate_probability": 1e-9}
    _, sums = plan_and_sums(make_case([RANGE, gated], scans=3), 512)
    assert sums.locks[1, :, TAKEN].max() <= 1
    sigma = np.sqrt(sums.error[..., 1] / 512)
    np.testing.assert_allclose(sigma[1], sigma[0], rtol=0.02)  # manoeuvre noise begins a scan earlier


def test_only_range_and_idealisations_have_exact_errors():
    case = make_case([RANGE, IDEAL, CURED])
    has_exact = [exact_errors.has_exact_errors(options) for options in case.spec.filters]
    assert has_exact == [True, True, False]
    axes = study.prepare(case).axes
    assert np.isnan(axes.exact_sigma[2]).all()
    assert np.isfinite(axes.exact_sigma[:2]).all()
    assert axes.ideal.tolist() == [-1, -1, 1]


def test_solve_finds_the_signal_to_noise_ratio_of_a_gain():
    """As the page has it: exact of the idealisation, whose gain there is the one that was asked for."""
    pair = ["{name: r, observes: [range], manoeuvre_variance: 1e-3}"]
    pair.append("{name: ideal, observes: [range, velocity], manoeuvre_variance: 1e-3, estimator: fisher_bound}")
    filters_ = f"filters=[{', '.join(pair)}]"
    question = {"gain": "r", "filter": "ideal", "at_s": 60.0, "equals": 30.0}
    answer = solve("pulses", "burst.snr_db", **question, overrides=[filters_], between=(-10.0, 10.0))
    assert answer.exact
    assert answer.value == pytest.approx(-3.775, abs=0.02)  # powers are of a hundredth of a decibel
    axes = study.prepare(load("pulses", [filters_, f"burst.snr_db={answer.value}"]).cases[0]).axes
    assert 100 * (1 - axes.exact_sigma[1, 6, 0] / axes.exact_sigma[0, 6, 0]) == pytest.approx(30.0, abs=0.2)
