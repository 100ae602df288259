"""Simulation-based calibration: truths drawn from a filter's own model rank evenly among draws of what it believes.

Talts, Betancourt, Simpson, Vehtari, Gelman, "Validating Bayesian inference algorithms with simulation-based
calibration", 2018. Of a filter that is matched to its world, and of no other, the rank of the truth is uniform; gains,
covariance, start and process noise are tried at once, without any exact value.
"""

import numpy as np
import pytest
from scipy.stats import chi2

from radarsim.api.configs import load
from radarsim.kernels import second_order
from radarsim.physics.motion import transition
from radarsim.studies.discriminator import study
from radarsim.studies.range_doppler import filter_design
from radarsim.studies.sonar import filter_design as sonar_filter_design
from radarsim.studies.sonar.plot_errors import step_correlations
from tests.studies.multimodel.test_kernels import DT, run_kernel

DRAWS, SCANS, TRACKS = 99, 14, 4000
LEAST = 1e-6  # of a p-value, over some two hundred of them


def ranks(truth, mean, covariance, rng):
    """Ranks 0 … DRAWS (n, C) of the components of truth (n, C) among draws of N(mean (n, C), covariance (…, C, C))."""
    root = np.linalg.cholesky(covariance)
    draws = mean + np.einsum("...ij,d...j->d...i", root, rng.normal(size=(DRAWS, *mean.shape)))
    return (draws < truth).sum(axis=0)


def p_values(found):
    """Of evenness, by chi-square over twenty classes of ranks (n, C): (C,)."""
    counts = np.stack([np.bincount(one * 20 // (DRAWS + 1), minlength=20) for one in np.moveaxis(found, -1, 0)])
    expected = len(found) / 20
    return chi2.sf((np.square(counts - expected) / expected).sum(axis=1), 19)


def calibrated(truth, mean, covariance, seed=1):
    """The p-values of components and of their sum, which a wrong correlation would spoil: truth and mean (n, C)."""
    unit = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    rng, scaled = np.random.default_rng(seed), covariance / (unit[..., :, None] * unit[..., None, :])
    found = ranks((truth - mean) / unit, np.zeros_like(mean), scaled, rng)
    total = ranks(
        ((truth - mean) / unit).sum(axis=-1, keepdims=True),
        np.zeros((len(mean), 1)),
        scaled.sum(axis=(-2, -1))[..., None, None],
        rng,
    )
    return p_values(np.concatenate([found, total], axis=1))


def random_track(rng, size, variance, dt, scans, first, tracks=TRACKS):
    """States (n, K, 3) that a polynomial of degree size - 1 makes, pushed by its next derivative from `first` on."""
    x = np.zeros((tracks, scans, 3))
    x[:, 0, :size] = rng.normal(size=(tracks, size)) * np.array([1e3, 30.0, 2.0])[:size]
    push = transition(dt, size + 1)[:-1, -1] * np.sqrt(variance)
    for k in range(1, scans):
        x[:, k] = x[:, k - 1] @ transition(dt).T
        if k >= first:
            x[:, k, :size] += rng.normal(size=(tracks, 1)) * push
    return x


def p1(observes, start, variance, believed_variance=None):
    """p-values of the P1 filter on a random jerk; the believed one may be another than the true."""
    sigma, dt, rng = np.array([250.0, 15.0]), 10.0, np.random.default_rng(observes)
    design = filter_design.design(observes, start, believed_variance or variance, sigma, dt, SCANS)
    truth = random_track(rng, 3, variance, dt, SCANS, start)
    plots = truth[:, :, :2] + sigma * rng.normal(size=(TRACKS, SCANS, 2))
    own = [observes], [start], design.weights[None], design.gains[None]
    problem = second_order.Problem((0, 0), truth[0], sigma, dt, *own)
    found = second_order.estimate(problem, plots)[:, 0]
    looks = [start - 1, start, start + 3, SCANS - 1]
    return np.concatenate([calibrated(truth[:, k], found[:, k], design.believed[k], k) for k in looks])


@pytest.mark.parametrize(("observes", "start"), [(1, 3), (1, 6), (2, 2), (2, 3)])
@pytest.mark.parametrize("variance", [1e-3, 1e-1])
def test_linear_filters(observes, start, variance):
    assert p1(observes, start, variance).min() > LEAST


def test_a_manoeuvre_variance_a_third_too_small_shows():
    assert p1(1, 3, 1e-3, 0.67e-3).min() < LEAST


def sonar_plots(rng, truth, rho, sigma, period, t):
    """Plots (n, K) with errors of correlation ρ."""
    steps = step_correlations(rho, t, period)
    error = np.zeros(truth.shape[:2])
    for k, step in enumerate(steps):
        error[:, k] = step * error[:, k - 1] + np.sqrt(1 - step**2) * sigma * rng.normal(size=len(truth))
    return truth[:, :, 0] + error


def sonar_estimates(made, z):
    """Estimates (n, K, 3) over plots z (n, K) of a designed filter, all tracks at once."""
    tracks, scans = z.shape
    now, carried, out = np.zeros((tracks, 3)), np.zeros(tracks), np.zeros((tracks, scans, 3))
    for k, (first, weights) in enumerate(made.window_rows):
        out[:, k] = z[:, first : k + 1] @ weights[0].T
    for k in range(scans) if made.recursion is not None else ():
        t = made.plots.t
        now, carried = now @ transition(t[k] - t[max(k - 1, 0)]).T, made.recursion.carry[k] * carried
        innovation = z[:, k] - now[:, 0] - carried
        gain = made.recursion.gain[0, k]
        now, carried = now + innovation[:, None] * gain[:3], carried + gain[3] * innovation
        out[:, k] = now
    return out


MATCHED = [
    ("growing_memory", 2, 0, 0.0, 0.0),
    ("growing_memory", 3, 0, 0.0, 0.0),
    ("window", 2, 4, 0.0, 0.0),
    ("window", 3, 6, 0.0, 0.0),
    ("kalman", 2, 0, 2.5e-3, 0.0),
    ("kalman", 3, 0, 1e-6, 0.0),
    ("kalman_augmented", 2, 0, 0.0, 0.7),
    ("kalman_augmented", 3, 0, 1e-6, 0.7),
    ("kalman_differenced", 2, 0, 0.0, 0.7),
    ("kalman_differenced", 3, 0, 0.0, -0.4),
]


@pytest.mark.parametrize(("kind", "size", "length", "variance", "rho"), MATCHED)
def test_sonar_filters(kind, size, length, variance, rho):
    """One plot is missed."""
    period, sigma, rng = 5.0, 30.0, np.random.default_rng(size)
    t, detected = np.arange(SCANS) * period, np.ones((1, SCANS))
    detected[0, 8] = 0
    spec = sonar_filter_design.FilterSpec(kind, size, length, np.array([variance]), np.array([rho]))
    made = sonar_filter_design.design_filter(spec, 0, sonar_filter_design.Plots(t, detected, period, sigma))
    truth = random_track(rng, size, variance, period, SCANS, size)
    z = np.where(detected > 0, sonar_plots(rng, truth, rho, sigma, period, t), 0.0)
    found = sonar_estimates(made, z)
    for k in (size - 1, size + 1, 9, SCANS - 1):
        P = made.covariance[0, k, :size, :size]
        assert calibrated(truth[:, k, :size], found[:, k, :size], P, k).min() > LEAST


def test_the_nine_state_filter():
    """The multiple-model kernel with one model, on a target whose acceleration walks as the model says."""
    scans, groups, sigma, rng = 30, 150, 20.0, np.random.default_rng(5)
    spread = np.tile([50.0, 20.0, 10.0], 3)
    push = np.array([DT**2 / 2, DT, 1.0]) * sigma
    root = rng.normal(size=(scans, 3, 3)) * 3 + np.eye(3) * 12
    covariances = root @ np.swapaxes(root, 1, 2)
    found, truths, variances = [], [], []
    for _ in range(groups):
        x = spread[:, None] * rng.normal(size=(9, 8))
        plots, states = np.zeros((scans, 3, 8)), np.zeros((scans, 9, 8))
        for k in range(scans):
            pushed = rng.normal(size=(3, 8))
            for axis in range(3):
                at = slice(3 * axis, 3 * axis + 3)
                x[at] = transition(DT) @ x[at] + push[:, None] * pushed[axis]
            states[k], plots[k] = x, x[0::3] + root[k] @ rng.normal(size=(3, 8))
        kinds = [("accelerated", sigma)]
        arguments = np.eye(1), np.ones(1), plots, covariances, np.zeros(9), np.diag(spread**2)
        mean, variance, _, _ = run_kernel("kalman", "moment", "moment", kinds, *arguments)
        truths.append(states)
        found.append(mean.copy())
        variances.append(variance.copy())
    for k in (0, 5, scans - 1):
        at = [np.concatenate([part[k].T for part in parts]) for parts in (truths, found, variances)]
        P = at[2][:, :, None] * np.eye(9)
        assert p_values(ranks(at[0], at[1], P, rng)).min() > LEAST


BURSTS = {
    "study": "discriminator",
    "burst": {
        **{"carrier_hz": 10e9, "pulse_period_s": 10e-6, "pulse_length_s": 1e-6, "sampling_period_s": 1e-6},
        **{"pulses": 30000, "amplitude": 1.0, "noise_variance": 2.25},
    },
    "truth": {"phase_rad": 0.7, "doppler_derivatives": [10e3, 180e3, -750e3, 1000e3]},
    "prior": {"spread_over_potential": [100.0, 150.0, 500.0, 1000.0, 2000.0]},
    "estimators": [{"name": "cured", "coherence_step": True, "search_points": 2}],
    "engine": "block_sums",
    "realisations": 1000,
}


def test_the_discriminator_where_it_is_locked():
    """Forecasts are drawn, so the posterior of the last window must hold the truth as often as it says."""
    plan = study.prepare(load(BURSTS).cases[0])
    errors, _ = study.estimate(plan, 0, TRACKS)
    last = plan.options["windows"][0] - 1
    ratio = errors[:, 0, last] / plan.posterior[0, last]
    size = plan.layout.shapes["error"][2]
    locked = np.abs(ratio[:, :size]).max(axis=1) < 5
    assert locked.mean() > 0.99
    unit = ratio[locked, :size]
    rng = np.random.default_rng(3)
    found = ranks(np.zeros_like(unit), unit, np.eye(size), rng)
    assert p_values(found).min() > LEAST
