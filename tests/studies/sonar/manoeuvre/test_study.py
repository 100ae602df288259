"""P3's manoeuvres: rates against exact laws within binomial bounds, adaptive filters, uses of a track, own plots."""

import numpy as np
import pytest
from scipy.stats import binom

from radarsim.api.configs import load
from radarsim.studies.sonar import STUDY, least_squares
from radarsim.studies.sonar.conversion import PLACED
from radarsim.studies.sonar.manoeuvre import alarm_laws, detection_laws
from radarsim.studies.sonar.scene import build_scene
from tests.studies.sonar.manoeuvre.test_kernels import FILTERS, SCANS, SIGMA, TARGET, VESSEL, T, config, twin
from tests.studies.sonar.precision import PARABOLA, TERMS, assert_estimates_rounded, estimate_losses
from tests.tolerances import Z, assert_rounded, mean_error, share_error

N = 16_384
ALL = 5e-9  # two-sided, of thousands of looks: 5.85 standard errors
ONE = 1e-4  # two-sided, of a few: binomial 99.99 % bounds
RATES = {"name": "rates", "plots": 6, "false_alarm_probability": [0.3, 0.1, 0.01, 0.001]}
APART = {"name": "apart", "plots": 4, "false_alarm_probability": [0.1, 0.01], "test_every": 4}
PLAIN = [{"name": "growing", "kind": "growing_memory"}]


def simulated(made, count=N):
    plan = STUDY.prepare(load(made).cases[0])
    blocks = range(0, count, plan.block)
    sums = sum(STUDY.simulate(plan, first, min(plan.block, count - first)) for first in blocks)
    return plan, plan.layout.unpack(sums)


def within(count, n, p, level):
    """Whether counts of n lie within the two-sided binomial bounds of probability p."""
    tail = np.minimum(binom.cdf(count, n, p), binom.sf(count - 1, n, p))
    return tail > level / 2


def compared(plan, sums, level):
    """Check all tests with a known law; how many these are."""
    tested, law = sums["tested"][:, :, None], plan.axes.exact_alarms
    known = np.isfinite(law) & (tested > 0)
    n = np.broadcast_to(tested, law.shape)[known]
    assert within(sums["alarms"][known], n, np.clip(law[known], 0, 1), level).all()
    return known.sum()


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"sensor": {"error_correlation": 0.5}},
        {"sensor": {"detection_probability": 0.8, "missed_scans": [4]}, "scans": 11},
        {"target": TARGET | {"y_m": 2000, "course_deg": 100}},
        {"target": {"kind": "polynomial", "frame": "polar", "range_m": [6e3, -5], "bearing_deg": [10, 0.01]}},
    ],
    ids=["steps", "correlated", "missed", "across", "steady"],
)
def test_alarms_are_as_the_exact_law_says(changes):
    made = config(filters=PLAIN, detectors=[RATES, APART]) | {}
    for key, value in changes.items():
        made[key] = made[key] | value if key == "sensor" else value
    plan, sums = simulated(made)
    assert compared(plan, sums, ALL) > 50
    if not changes:
        steady = slice(5, 12)
        share = np.array(RATES["false_alarm_probability"])[:, None]
        for g in range(3):  # each coordinate by itself, and jointly
            assert within(sums["alarms"][0, g, :, steady], N, share, ALL).all()


def test_laws_that_are_not_known_are_left_out():
    """Correlations of several sizes: the joint statistic is no χ²; cartesian frames: weights go with the plots."""
    plan, _ = simulated(config(filters=PLAIN, sensor={"error_correlation": {"range": 0.5, "bearing": 0.2}}), 16)
    law = plan.axes.exact_alarms
    assert np.isfinite(law[0, :2, :2, 10]).all()
    assert np.isnan(law[:, 2]).all()
    plan, sums = simulated(config(filters=PLAIN) | {"frame": "cartesian_unbiased"}, 16)
    assert np.isnan(plan.axes.exact_alarms).all()
    assert sums["tested"][0, 2, -1] == 16


def test_a_walking_velocity_bends_courses():
    target = {"kind": "polynomial", "frame": "polar", "range_m": [6e3, -5], "bearing_deg": [10, 0.01]}
    made = config(filters=PLAIN, detectors=[RATES]) | {"target": target | {"fluctuation_mps2": 0.2}}
    plan, sums = simulated(made)
    assert plan.axes.exact_alarms[0, 0, 2, -1] > 0.015
    assert compared(plan, sums, ALL) > 50


def test_pushes_are_what_the_motion_makes_of_them():
    """Variance of an acceleration under random pushes, one interval's push after the other, moved step by step."""
    target = {"kind": "polynomial", "frame": "polar", "range_m": [6e3, -5], "bearing_deg": [10, 0.01]}
    (case,) = load(config(filters=PLAIN) | {"target": target | {"fluctuation_mps2": 0.2}}).cases
    scene = build_scene(case)
    _, variance, believed = alarm_laws.shift_laws(scene, 0, np.ones((1, SCANS)), 6, 20)
    weights, _ = least_squares.generalised_least_squares(scene.t[15:21], np.eye(6), 3)
    total = 100.0 * weights[2] @ weights[2]
    precision = {"condition": PARABOLA, "operations": 6 * TERMS}
    assert_rounded(believed, [total], **precision)
    for pushed in range(1, 6):
        place, rate, course = 0.0, 0.0, np.zeros(6)
        for j in range(1, 6):
            a = 0.2 if j == pushed else 0.0
            place, rate = place + T * rate + a * T**2 / 2, rate + a * T
            course[j] = place
        total += (weights[2] @ course) ** 2
    assert_rounded(variance, [total], **precision)


def test_first_events_of_independent_tests_are_exact_and_alarms_come_in_runs():
    plan, sums = simulated(config(filters=PLAIN, detectors=[RATES, APART]))
    axes = plan.axes
    assert axes.independent == (False, True)
    law, phase = axes.exact_alarms, axes.phase
    for part in (0, 1, 2):
        scans = np.flatnonzero((phase == part) & (sums["tested"][1, 0] > 0))
        for g in range(3):
            p = law[1, g, :2][:, scans]
            p = 1 - p if part == 2 else p
            detected = np.cumsum(sums["first"][1, g, :2][:, scans], axis=1)
            assert within(detected, N, detection_laws.probability_by_then(p), ALL).all()
    # Overlapping windows on a steady leg: no oftener than if they were independent (Šidák), and by far.
    scans = np.arange(5, 13)
    detected = sums["first"][0, 0][:, scans].sum(axis=1) / N
    independent = detection_laws.probability_by_then(law[0, 0][:, scans])[:, -1]
    assert (detected < independent).all()
    assert detected[0] < independent[0] - share_error(0.5, N)


@pytest.mark.slow
def test_rates_within_the_binomial_bounds_at_a_million():
    n, scans = 1_000_000, [8, 14, 20, 29]  # steady, during, last of it, long after
    plan, sums = simulated(config(filters=PLAIN, detectors=[RATES, APART]), n)
    counts, law = sums["alarms"][0][:, :, scans], plan.axes.exact_alarms[0][:, :, scans]
    assert within(counts, n, law, ONE / law.size).all()
    compared(plan, sums, ALL)


# ---- uses ---------------------------------------------------------------------------------------------------------
def test_spread_of_uses_is_that_of_the_errors():
    """A steady vessel that comes straight in, well tracked: σ to first order is the measured one for all uses.

    In x, y the plots' covariance is that at the mean of earlier plots, which lags by `PLACED` intervals, farther away:
    what is believed is too much by up to the share of this way in the range. The frames share their noise.
    """
    vessel = VESSEL | {"y_m": 0, "acceleration_mps2": 0, "start_s": 0}
    ratios = []
    for frame in ("polar", "cartesian_unbiased"):
        made = config(filters=PLAIN, detectors=[]) | {"target": vessel}
        made |= {"uses": {"horizon_s": 60, "own_ship": {"speed_mps": 4, "course_deg": 90}}, "frame": frame, "scans": 60}
        _, sums = simulated(made)
        n, _, square, fourth, spread = np.moveaxis(sums["uses"][0, 0], -1, 0)
        assert (n == N).all()
        ratios.append(np.sqrt(square / spread))
        if frame == "polar":
            se = np.sqrt((fourth * n / square**2 - 1) / n) / 2
            assert (np.abs(ratios[0] - 1) < Z * se).all()
    way = vessel["speed_mps"] * T
    lag = PLACED * way / (vessel["x_m"] - 59 * way)
    of_lag = ratios[1] / ratios[0]
    assert (of_lag > 1 - lag).all()
    # Terms of second order, σ_β of the first, are not correlated with these.
    assert (of_lag < 1 + mean_error(N, SIGMA[1])).all()


def test_a_future_on_another_course_is_no_matter_of_spread():
    made = config(filters=PLAIN, detectors=[]) | {"uses": {"horizon_s": 60, "at_s": [55.0]}}
    plan, sums = simulated(made, 4096)
    n, first, square, *_ = sums["uses"][0, 0, 2]
    # Southwards the speed grows by 0.6 m/s² from 5 s on, for 40 s, and is kept for 15 s: that way goes unforeseen.
    allowed = mean_error(n, np.sqrt(square / n - (first / n) ** 2))
    assert first / n == pytest.approx(0.6 * (55**2 - 15**2) / 2, abs=allowed)
    assert_rounded(plan.axes.uses.true[0, 1], 5.0, operations=4)


# ---- own plots ----------------------------------------------------------------------------------------------------
def test_recorded_plots_are_followed_as_the_twins_do():
    case = load(config() | {"uses": {"horizon_s": 60.0}}).cases[0]
    rng, t = np.random.default_rng(3), np.arange(SCANS) * T
    truth = STUDY.prepare(case).world.truth
    z = truth[:, :2, 0] + SIGMA * rng.standard_normal((SCANS, 2))
    z[[6, 17]] = np.nan
    track = STUDY.recording_interface().tracker(case).feed({"t_s": t + 100, "range_m": z[:, 0], "bearing_rad": z[:, 1]})
    names = [name for name, _ in track.components]
    assert names == ["r", "vr", "ar", "b", "vb", "ab", "course", "speed", "x_ahead", "y_ahead", "cpa", "t_cpa"]
    for f, spec in enumerate(FILTERS):
        for c in (0, 1) if spec["kind"] != "growing_memory" else ():
            size = spec.get("degree", 1) + 1
            x, P, _, _ = twin(spec, z, c)
            known = np.cumsum(~np.isnan(z[:, c])) >= size
            x[~known], P[~known] = np.nan, np.nan
            state, loss = slice(3 * c, 3 * c + size), 10 * estimate_losses(P, z[:, c], SIGMA[c])  # see `test_kernels`
            assert_estimates_rounded(track.estimate[f, :, state], x[:, :size], P, z[:, c], SIGMA[c], factor=10)
            unit = np.sqrt(np.diagonal(P, axis1=1, axis2=2))[known, :size]
            assert_rounded(track.sigma[f, known, state], unit, loss[known, None] * unit)
    speed = np.hypot(track.estimate[0, 9, 1], track.estimate[0, 9, 0] * track.estimate[0, 9, 4])
    assert_rounded(track.estimate[0, 9, 7], speed, operations=8)
    assert np.isnan(track.estimate[0, 0, 6:]).all()
