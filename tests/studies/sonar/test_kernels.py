"""Sonar kernels against textbook twins, realisation by realisation on the same plots, in both kernels."""

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.kernels.random import fill_normal_pairs, fill_uniform_pairs
from radarsim.studies.sonar import STUDY, conversion, plot_errors
from tests.studies.sonar import naive as naive
from tests.studies.sonar.precision import assert_estimates_rounded, losses
from tests.studies.sonar.test_study import config as configured
from tests.tolerances import assert_rounded, scaled_condition, sigma_error

T, SCANS = 5.0, 18
SIGMA = np.array([30.0, np.radians(1)])
FILTERS = [
    {"name": "line", "kind": "growing_memory", "degree": 1},
    {"name": "parabola", "kind": "growing_memory", "degree": 2},
    {"name": "window", "kind": "window", "degree": 1, "plots": 4},
    {"name": "window 2", "kind": "window", "degree": 2, "plots": 6},
    {"name": "kalman", "kind": "kalman", "degree": 1, "manoeuvre_variance": 1e-3},
    {"name": "kalman 2", "kind": "kalman", "degree": 2, "manoeuvre_variance": 1e-6},
    {"name": "fixed", "kind": "fixed_gain", "degree": 1, "manoeuvre_variance": 1e-3},
    {"name": "fixed 2", "kind": "fixed_gain", "degree": 2, "manoeuvre_variance": 1e-6},
    {"name": "augmented", "kind": "kalman_augmented", "degree": 1, "error_correlation": 0.6},
    {"name": "augmented 2", "kind": "kalman_augmented", "degree": 2, "manoeuvre_variance": 1e-6},
    {"name": "differenced", "kind": "kalman_differenced", "degree": 1, "error_correlation": 0.6},
    {"name": "differenced 2", "kind": "kalman_differenced", "degree": 2},
]


def config(frame="polar", **sensor):
    return configured(SCANS, FILTERS if frame == "polar" else FILTERS[:8], frame=frame, **sensor)


def plots(plan, realisation, rho, probability, missed=()):
    """Errors (K, 2) and which scans are detected (K,), drawn from the same streams by the plainest code."""
    a, b, e = np.empty(1), np.empty(1), np.zeros((SCANS, 2))
    detected = np.ones(SCANS, dtype=bool)
    for k in range(SCANS):
        fill_normal_pairs(plan.world.plots, realisation, k, a, b)
        fresh = SIGMA * np.array([a[0], b[0]])
        e[k] = fresh if k == 0 else rho * e[k - 1] + np.sqrt(1 - rho**2) * fresh
        if probability < 1 and k > 0:
            fill_uniform_pairs(plan.detections.key, realisation, k, a, b)
            detected[k] = a[0] < probability
    detected[list(missed)] = False
    return e, detected


def twin(spec, z, sigma, rho, scale):
    """Estimates of one filter by its textbook twin; scale turns the manoeuvre variance to the coordinate's units."""
    size, variance = spec["degree"] + 1, spec.get("manoeuvre_variance", 0.0) * scale
    t = np.arange(SCANS) * T
    rho = spec.get("error_correlation", rho)
    match spec["kind"]:
        case "growing_memory":
            return naive.batch(t, z, size, sigma)
        case "window":
            return naive.batch(t, z, size, sigma, last=spec["plots"])
        case "kalman":
            return naive.kalman(t, z, size, sigma, variance)
        case "fixed_gain":
            return naive.kalman(t, z, size, sigma, variance, steady_gains(size, sigma, variance))
        case "kalman_augmented":
            return naive.augmented(t, z, size, sigma, rho, variance, T)
    return naive.differenced(t, z, size, sigma, rho, T)


def steady_gains(size, sigma, variance):
    """Steady gains by running the Riccati recursion until it stands."""
    P, A, N = np.eye(size) * sigma**2, naive.F(T, size), naive.Q(T, size, variance)
    for _ in range(5000):
        P = A @ P @ A.T + N
        K = P[:, 0] / (P[0, 0] + sigma**2)
        P = P - np.outer(K, P[0])
    return K


@pytest.mark.slow_cases("sensor1", "sensor3")
@pytest.mark.parametrize(
    "sensor",
    [
        {"error_correlation": 0.6},
        {"error_correlation": 0.6, "detection_probability": 0.7},
        {"error_correlation": -0.5, "missed_scans": [4, 9, 10]},
        {"detection_probability": 0.5, "missed_scans": [2, 12]},
    ],
)
def test_estimates_are_the_twins(sensor):
    case = load(config(**sensor)).cases[0]
    plan = STUDY.prepare(case)
    rho, probability = sensor.get("error_correlation", 0.0), sensor.get("detection_probability", 1.0)
    missed = [k - 1 for k in sensor.get("missed_scans", ())]
    truth, t = plan.world.truth, np.arange(SCANS) * T
    errors = np.linalg.cond(plot_errors.error_covariance(np.ones(SCANS), rho or 0.6, t, T))
    for realisation in (0, 5, 12345):
        sums = plan.layout.unpack(STUDY.simulate(plan, realisation, 1))
        e, detected = plots(plan, realisation, rho, probability, missed)
        for c in range(2):
            z = np.where(detected, truth[:, c, 0] + e[:, c], np.nan)
            for f, spec in enumerate(FILTERS):
                x, P = twin(spec, z, SIGMA[c], rho, (1.0, 9e3**-2)[c])
                size = spec["degree"] + 1
                error = sums["error"][f, :, 3 * c : 3 * c + size, 0]
                known = ~np.isnan(x)
                assert (sums["estimates"][f, :, 3 * c : 3 * c + size] == known).all()
                assert_estimates_rounded(error, x - truth[:, c, :size], P, z, SIGMA[c], errors)
                believed = sums["believed"][f, :, 3 * c : 3 * c + size]
                variance, loss = np.diagonal(P, axis1=1, axis2=2), losses(P, errors)
                assert_rounded(believed[known], variance[known], (loss[:, None] * variance)[known])
                full = known.all(axis=1)
                off, P = (x - truth[:, c, :size])[full], P[full]
                q = np.array([v @ np.linalg.solve(p, v) for v, p in zip(off, P, strict=True)])
                # P⁻¹ multiplies by κ what P and the errors have lost, of their squares in units of σ.
                spread = np.ptp(z[detected]) / SIGMA[c] + (np.abs(off) / np.sqrt(variance[full])).sum(axis=1)
                assert_rounded(sums["joint"][f, full, c, 0], q, scaled_condition(P) * loss[full] * spread**2)


@pytest.mark.parametrize("frame", ["cartesian", "cartesian_unbiased"])
def test_converted_plots_and_their_weights(frame):
    """The cartesian frame: plots converted as in models, weights by the conversion's own variances, plot by plot."""
    case = load(config(frame, detection_probability=0.8)).cases[0]
    plan = STUDY.prepare(case)
    truth, polar, t = plan.world.truth, plan.axes.polar, np.arange(SCANS) * T
    convert = conversion.convert_plainly if frame == "cartesian" else conversion.convert_unbiased
    for realisation in (0, 77):
        sums = plan.layout.unpack(STUDY.simulate(plan, realisation, 1))
        e, detected = plots(plan, realisation, 0.0, 0.8)
        r, b = polar[:, 0, 0] + e[:, 0], polar[:, 1, 0] + e[:, 1]
        x, y, (xx, _, yy) = convert(r, b, *SIGMA)
        if frame == "cartesian_unbiased":
            xx, _, yy = np.full((3, SCANS), np.nan)
            xx[detected], _, yy[detected] = convert(*conversion.weighting_positions(r[detected], b[detected]), *SIGMA)[
                2
            ]
        for c, (z, variance) in enumerate(((x, xx), (y, yy))):
            # Of a variance the formula's own rounding is relative to the square of the range.
            least = variance[detected].min()
            z = np.where(detected, z, np.nan)
            for f, size in ((0, 2), (1, 3)):
                expected, P = np.full((SCANS, size), np.nan), np.full((SCANS, size, size), np.nan)
                for k in range(2, SCANS):
                    at = np.flatnonzero(detected[: k + 1])
                    if len(at) < 3:
                        continue
                    A = np.vander(t[at] - t[k], size, increasing=True) / np.array([1, 1, 2])[:size]
                    w = 1 / variance[at]
                    P[k] = np.linalg.inv((A.T * w) @ A)
                    expected[k] = P[k] @ ((A.T * w) @ (z[at] - truth[k, c, 0]))
                error = sums["error"][f, :, 3 * c : 3 * c + size, 0]
                expected[:, 1:] -= truth[:, c, 1:size]
                assert_estimates_rounded(error, expected, P, z, np.sqrt(least), np.max(r) ** 2 / least)


def test_third_coordinate_and_walk_of_velocity_leave_the_first_two_alone():
    """Depth is a coordinate like the others, and a walk of velocity is lateral in the bearing."""
    one = config()
    one["target"] |= {"fluctuation_mps2": 0.02}
    plan = STUDY.prepare(load(one).cases[0])
    assert plan.world.walk[0] == 0.02
    assert_rounded(plan.world.walk[1], 0.02 / 9e3, operations=2)
    other = config(sigma_depth_m=5.0)
    other["target"] |= {"depth_m": [100.0, 0.5]}
    plan = STUDY.prepare(load(other).cases[0])
    sums = plan.layout.unpack(STUDY.simulate(plan, 0, 4096))
    sigma = np.sqrt(sums["error"][..., 1] / 4096)
    known = plan.axes.available
    assert sigma[known] == pytest.approx(plan.axes.exact_sigma[known], rel=sigma_error(4096))
    assert [name for name, _ in plan.axes.components] == ["r", "vr", "ar", "b", "vb", "ab", "d", "vd", "ad"]
