"""P3: Monte-Carlo against exact values over correlations, degrees, lengths and patterns of misses; faults must show."""

import numpy as np
import pytest

from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load
from radarsim.studies.sonar import STUDY, least_squares, plot_errors
from tests.studies.sonar.precision import TERMS
from tests.tolerances import Z, assert_rounded, mean_error, scaled_condition, share_error, sigma_error

N = 100_000
BOUND = sigma_error(N)
RHO = [-0.5, 0.0, 0.3, 0.6, 0.9, 0.99]
FILTERS = [
    {"name": "line", "kind": "growing_memory", "degree": 1},
    {"name": "parabola", "kind": "growing_memory", "degree": 2},
    {"name": "naive", "kind": "kalman", "degree": 1},
    {"name": "naive 2", "kind": "kalman", "degree": 2},
    {"name": "augmented", "kind": "kalman_augmented", "degree": 1},
    {"name": "augmented 2", "kind": "kalman_augmented", "degree": 2},
    {"name": "differenced", "kind": "kalman_differenced", "degree": 1},
    {"name": "differenced 2", "kind": "kalman_differenced", "degree": 2},
    {"name": "window 3", "kind": "window", "degree": 1, "plots": 3},
    {"name": "window 50 deg 2", "kind": "window", "degree": 2, "plots": 50},
    {"name": "window 12", "kind": "window", "degree": 1, "plots": 12},
    {"name": "kalman q", "kind": "kalman", "degree": 1, "manoeuvre_variance": 1e-3},
    {"name": "fixed", "kind": "fixed_gain", "degree": 1, "manoeuvre_variance": 1e-3},
    {"name": "fixed 2", "kind": "fixed_gain", "degree": 2, "manoeuvre_variance": 1e-5, "plots": 6},
]


def config(scans=50, filters=FILTERS, fluctuation=0.0, frame="polar", **sensor):
    return {
        "study": "sonar",
        "sensor": {"sigma_range_m": 30.0, "sigma_bearing_deg": 1.0, "scan_period_s": 5.0, **sensor},
        "target": {
            "kind": "polynomial",
            "frame": "polar",
            "range_m": [9e3, -4.0],
            "bearing_deg": [20.0, 0.01],
            "fluctuation_mps2": fluctuation,
        },
        "frame": frame,
        "filters": filters,
        "scans": scans,
        "realisations": N,
    }


def misses(seed, scans=50):
    """A random pattern of scans that give no plot."""
    found = np.flatnonzero(np.random.default_rng(seed).random(scans) < 0.3) + 1
    return [int(k) for k in found if k > 3]


def simulated(plan, count=N):
    return plan.layout.unpack(sum(STUDY.simulate(plan, b, min(4096, count - b)) for b in range(0, count, 4096)))


def deviations(plan, sums):
    """Relative deviation (F, K, C) of the measured from the exact σ, and its standard error for any distribution."""
    with np.errstate(all="ignore"):
        n = sums["estimates"]
        m2, m4 = sums["error"][..., 1] / n, sums["error"][..., 3] / n
        return np.sqrt(m2) / plan.axes.exact_sigma - 1, np.sqrt((m4 / m2**2 - 1) / n) / 2


@pytest.mark.slow_cases_except("0.6")
@pytest.mark.parametrize("rho", RHO)
def test_every_linear_case_is_exact(rho):
    """Both degrees, 3 to 50 plots, a random pattern of misses, white and correlated errors."""
    plan = STUDY.prepare(load(config(error_correlation=rho, missed_scans=misses(int(rho * 100) + 60))).cases[0])
    sums = simulated(plan)
    off, _ = deviations(plan, sums)
    assert np.isfinite(off[plan.axes.available]).all()
    assert np.nanmax(np.abs(off)) < BOUND
    ahead = np.sqrt(sums["ahead"][..., 1] / N) / plan.axes.exact_ahead - 1
    assert np.nanmax(np.abs(ahead)) < BOUND


def test_what_a_filter_says_of_itself_is_as_wrong_as_calculated():
    """The naive filter's normalised error at ρ = 0.9; and 1 per component for those that know of it."""
    plan = STUDY.prepare(load(config(scans=20, error_correlation=0.9)).cases[0])
    sums = simulated(plan)
    q, qq = sums["joint"][..., 0] / N, sums["joint"][..., 1] / N
    exact = plan.axes.exact_nees
    known = np.isfinite(exact)
    assert (np.abs(q - exact) / np.sqrt((qq - q**2) / N))[known].max() < Z
    names = plan.axes.filters
    assert exact[names.index("naive"), -1, 0] > 3 * 2
    C = plot_errors.error_covariance(np.ones(20), 0.9, np.arange(20) * 5.0, 5.0)
    _, P = least_squares.generalised_least_squares(np.arange(20) * 5.0, C, 2)
    kappa = scaled_condition(P) * np.linalg.cond(C)
    assert_rounded(exact[names.index("augmented"), -1, 0], 2.0, condition=kappa, operations=20 * TERMS)


@pytest.mark.slow
@pytest.mark.parametrize(("rho", "probability"), [(0.0, 0.7), (0.6, 0.9)])
def test_random_misses_are_exact_as_means_over_patterns(rho, probability):
    plan = STUDY.prepare(load(config(scans=10, error_correlation=rho, detection_probability=probability)).cases[0])
    assert np.isfinite(plan.axes.exact_sigma[plan.axes.available]).all()
    sums = simulated(plan)
    off, own = deviations(plan, sums)
    assert np.nanmax(np.abs(off) / own) < Z
    assert (sums["estimates"][:, :, 0] == N).all()
    detected = sums["estimates"][0, 1, 1] / N  # a velocity at the second scan: its plot was detected
    assert abs(detected - probability) < share_error(probability, N)


def test_walk_of_velocity_is_exact():
    plan = STUDY.prepare(load(config(scans=40, fluctuation=0.05, error_correlation=0.3)).cases[0])
    off, _ = deviations(plan, simulated(plan))
    away = np.array([name.startswith("a") for name, _ in plan.axes.components])
    assert np.nanmax(np.abs(off[:, :, ~away])) < BOUND


def test_mixed_sonars_are_exact():
    further = [
        {"sigma_bearing_deg": 2.0, "scan_period_s": 3.7, "first_s": 1.3},
        {"sigma_range_m": 90.0, "sigma_bearing_deg": 0.5, "scan_period_s": 17.0, "first_s": 5.0},
    ]
    plan = STUDY.prepare(load(config(scans=12, further=further, missed_scans=[6, 11])).cases[0])
    off, _ = deviations(plan, simulated(plan))
    assert np.isfinite(off[plan.axes.available]).all()
    assert np.nanmax(np.abs(off)) < BOUND


def test_conversion_bias_and_its_cure():
    """At 4 degrees and 15 km the plain conversion is 36 m short; the unbiased one is not, nor are its estimates."""
    made = {}
    for frame in ("cartesian", "cartesian_unbiased"):
        given = config(scans=10, filters=FILTERS[:1], frame=frame) | {
            "target": {"kind": "polynomial", "frame": "cartesian", "x_m": [15e3, -4.0], "y_m": [0.0, 3.0]}
        }
        given["sensor"]["sigma_bearing_deg"] = 4.0
        plan = STUDY.prepare(load(given).cases[0])
        made[frame] = simulated(plan)["error"][0, :, 0] / N, plan.axes.conversion_bias
    (plain, formula), (mended, _) = made["cartesian"], made["cartesian_unbiased"]
    assert_rounded(formula, np.expm1(-(np.radians(4) ** 2) / 2) * 15e3, operations=6)
    assert abs(plain[0, 0] - formula) < mean_error(N, np.sqrt(plain[0, 1]))
    assert abs(mended[0, 0]) < mean_error(N, np.sqrt(mended[0, 1]))
    assert abs(mended[9, 0]) < 0.25 * abs(plain[9, 0]) + mean_error(N, np.sqrt(mended[9, 1]))


def track_columns(n=6):
    t = 100 + np.array([0.0, 5.0, 10.0, 17.0, 21.0, 26.0])[:n]
    r = np.array([9010.0, 8975.0, np.nan, 8950.0, 8900.0, 8890.0])[:n]
    b = np.array([3.13, -3.14, 3.14, np.nan, -3.13, -3.12])[:n]
    return {"t_s": t, "range_m": r, "bearing_rad": b}


def test_track_over_recorded_plots_is_least_squares():
    case = load(config(filters=FILTERS[:1] + FILTERS[8:9])).cases[0]
    columns = track_columns()
    track = STUDY.recording_interface().tracker(case).feed(columns)
    for f, c, sigma, key in ((0, 0, 30.0, "range_m"), (0, 1, np.radians(1), "bearing_rad"), (1, 0, 30.0, "range_m")):
        z, since = columns[key], columns["t_s"] - columns["t_s"][-1]
        chosen = np.flatnonzero(np.isfinite(z))[-3 * f :]  # all, or the last three
        plots = np.unwrap(z[chosen]) if c else z[chosen]
        slope, value = np.polyfit(since[chosen], plots, 1)
        A = np.stack([since[chosen] ** 0, since[chosen]], axis=1)
        P = sigma**2 * np.linalg.inv(A.T @ A)
        state, kappa = slice(2 * c, 2 * c + 2), scaled_condition(P) * np.abs(plots).max() / sigma
        unit = np.sqrt(np.diag(P))
        assert_rounded(track.estimate[f, -1, state], [value, slope], unit, kappa, operations=6 * TERMS)
        assert_rounded(track.sigma[f, -1, state], unit, condition=scaled_condition(P), operations=6 * TERMS)
    assert np.isnan(track.estimate[0, 0, 1])


@pytest.mark.parametrize("frame", ["cartesian", "cartesian_unbiased"])
def test_track_in_the_cartesian_frame(frame):
    case = load(config(filters=FILTERS[:1], frame=frame)).cases[0]
    track = STUDY.recording_interface().tracker(case).feed(track_columns())
    assert [name for name, _ in track.components] == ["x", "vx", "y", "vy"]
    assert track.estimate[0, -1, 0] == pytest.approx(-8890, abs=30)  # σ of the plot
    assert np.isfinite(track.estimate[0, -1]).all()


@pytest.mark.slow
def test_growing_memory_falls_behind_whatever_the_fluctuation():
    """A smaller one only later: exact σ of the range, first plot at which growing memory is worse (docs/sonar.md)."""
    for size, of_window, of_kalman in (("0.05", 25, 11), ("0.02", 49, 35)):
        changes = ["target=sonar_fluctuating", f"target.fluctuation_mps2={size}", "scans=60", "realisations=8"]
        axes = CaseWork(load("sonar_smoothing", changes).cases[0]).plan.axes
        growing, window, kalman = (
            axes.exact_sigma[axes.filters.index(name), 10:, 0] for name in ("growing", "window 10", "kalman q")
        )
        for other, first in ((window, of_window), (kalman, of_kalman)):
            worse = growing > other
            assert 11 + int(np.argmax(worse)) == first
            assert worse[first - 11 :].all()
