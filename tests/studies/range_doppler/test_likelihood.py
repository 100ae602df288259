"""The likelihood of recorded plots: the joint Gaussian density of all of them, and a textbook twin with outliers."""

import numpy as np
import pytest
from scipy.stats import norm

from radarsim.api.load_experiments import load_all
from radarsim.physics.motion import manoeuvre_covariance, transition
from radarsim.studies.error_law import ErrorLaw
from radarsim.studies.range_doppler.plot_likelihood import WIDE_ACCELERATION_MPS2, WIDE_VELOCITY_MPS, PlotLikelihood
from radarsim.studies.range_doppler.tracking import START_RANGES
from tests.recordings.error_laws import error_laws, outlier_law
from tests.tolerances import rounding

T_S = np.array([0.0, 4.0, 9.0, 12.0, 20.0, 26.0, 30.0, 33.0])
PRIOR = np.diag([0.0, WIDE_VELOCITY_MPS**2, WIDE_ACCELERATION_MPS2**2])


def precision(found, sigma):
    """Rounding of a likelihood: of the prior's variance over what plots leave of it, in velocities or in ranges.

    Ten operations in each of the two updates that first tell the rate and its change; later ones lose no digits.
    """
    condition = WIDE_VELOCITY_MPS**2 * max((T_S[1] / sigma[0]) ** 2, 1 / sigma[1] ** 2)
    return rounding(condition, 20) * abs(found)


def case(*overrides):
    (one,) = load_all(["rls2"], overrides)
    return one.cases[0]


def drawn(seed, share=0.0):
    """Plots of a target that moves as the filter believes; some are missing."""
    rng = np.random.default_rng(seed)
    x, z = np.array([50e3, -200.0, 1.0]), []
    for k, dt in enumerate(np.diff(T_S, prepend=0.0)):
        if k:
            x = transition(dt) @ x + manoeuvre_covariance(1e-3, dt)[:, 2] / dt / 1e-3 * rng.normal() * 1e-3**0.5
        z.append(x[:2] + rng.normal(size=2) * [250.0, 15.0] * np.where(rng.random(2) < share, 10.0, 1.0))
    z = np.array(z)
    z[3, 1] = z[5, 0] = np.nan
    return {"t_s": T_S, "range_m": z[:, 0], "velocity_mps": z[:, 1]}


def dense(columns, sigma_range, sigma_velocity, manoeuvre):
    """The logarithm of the joint density of all plots after the first rows, given these: no recursion.

    In long doubles, as the wide prior leaves doubles five digits.
    """
    n, wide = len(T_S), np.longdouble
    R = np.diag([sigma_range**2, sigma_velocity**2]).astype(wide)
    state = np.array([columns["range_m"][0], 0.0, 0.0], dtype=wide)
    spread = (PRIOR + np.diag([sigma_range**2, 0, 0])).astype(wide)
    mean, joint = np.zeros((n, 2), dtype=wide), np.zeros((n, 2, n, 2), dtype=wide)
    for k in range(n):
        if k:
            F = transition(T_S[k] - T_S[k - 1]).astype(wide)
            state, spread = F @ state, F @ spread @ F.T + manoeuvre_covariance(manoeuvre, T_S[k] - T_S[k - 1])
        mean[k], joint[k, :, k] = state[:2], spread[:2, :2] + R
        for j in range(k + 1, n):
            joint[k, :, j] = (spread @ transition(T_S[j] - T_S[k]).T)[:2, :2]
            joint[j, :, k] = joint[k, :, j].T
    z = np.stack([columns["range_m"], columns["velocity_mps"]], axis=1)
    there = np.isfinite(z)
    there[0, 0] = False  # it is what the state begins from
    error, joint = (z - mean).ravel(), joint.reshape(2 * n, 2 * n)
    order = np.flatnonzero(there)  # the first rows come first: the factors of the others are conditional on them
    L = factor(joint[np.ix_(order, order)])
    white = solved(L, error[order])
    score = -np.log(np.diagonal(L)) - 0.5 * (np.log(2 * np.pi) + white**2)
    return float(score[order >= 2 * START_RANGES].sum())


def factor(C):
    """The Cholesky factor of C, in its own precision."""
    L = np.zeros_like(C)
    for i in range(len(C)):
        for j in range(i + 1):
            rest = C[i, j] - L[i, :j] @ L[j, :j]
            L[i, j] = np.sqrt(rest) if i == j else rest / L[j, j]
    return L


def solved(L, y):
    """L⁻¹ y for a lower triangle."""
    x = np.zeros_like(y, dtype=L.dtype)
    for i in range(len(L)):
        x[i] = (y[i] - L[i, :i] @ x[:i]) / L[i, i]
    return x


@pytest.mark.parametrize("values", [(250.0, 15.0, 1e-3), (100.0, 40.0, 1.0), (400.0, 5.0, 1e-6)])
def test_the_product_of_the_predictions_is_the_joint_density(values):
    columns = drawn(1)
    found = PlotLikelihood(case(), None, [columns])(np.array(values))
    assert found == pytest.approx(dense(columns, *values), abs=precision(found, values))


def test_range_alone_ignores_the_velocities():
    columns = drawn(2)
    likelihood = PlotLikelihood(case(), "r", [columns])
    assert likelihood.keys == ("radar.sigma_range_m", "manoeuvre_variance")
    without = PlotLikelihood(case(), "r", [columns | {"velocity_mps": np.full(8, np.nan)}])
    assert likelihood(likelihood.stated) == without(likelihood.stated)


def twin(columns, values, laws, bias):
    """Textbook: all explanations of each number updated by themselves, then merged by their moments; the first numbers,
    which find the state, with the mean square of their errors."""
    sigma, total, x, P = values[:2], 0.0, None, None
    z = np.stack([columns["range_m"], columns["velocity_mps"] - bias * values[1]], axis=1)
    wider = [1 + law.near * (law.offset**2 + law.spread**2) + 99 * law.far for law in laws]
    spans = [np.ptp(column[np.isfinite(column)]) for column in (columns["range_m"], columns["velocity_mps"])]
    for k in range(len(T_S)):
        if k == 0:
            x, P = np.array([z[0, 0], 0.0, 0.0]), PRIOR + np.diag([wider[0] * sigma[0] ** 2, 0, 0])
        else:
            F, Q = transition(T_S[k] - T_S[k - 1]), manoeuvre_covariance(values[2], T_S[k] - T_S[k - 1])
            x, P = F @ x, F @ P @ F.T + Q
        for m in range(2):
            if (k == 0 and m == 0) or np.isnan(z[k, m]):
                continue
            h, made = np.eye(3)[m], []
            errors = ([1.0], [0.0], [wider[m] ** 0.5])
            if k >= START_RANGES:
                errors = error_laws(laws[m], spans[m], sigma[m] ** 2)
            for weight, mean, width in zip(*errors, strict=True):
                S = h @ P @ h + (width * sigma[m]) ** 2
                K, foretold = P @ h / S, x @ h + mean * sigma[m]
                density = weight * norm(foretold, S**0.5).pdf(z[k, m])
                made.append((density, x + K * (z[k, m] - foretold), P - np.outer(K, K) * S))
            density = sum(one[0] for one in made)
            w = [one[0] / density for one in made]
            x = sum(a * one[1] for a, one in zip(w, made, strict=True))
            P = sum(a * (one[2] + np.outer(one[1] - x, one[1] - x)) for a, one in zip(w, made, strict=True))
            total += np.log(density) if k >= START_RANGES else 0.0
    return total


@pytest.mark.parametrize(
    ("laws", "bias"),
    [
        ((outlier_law(0.0, 0.0),) * 2, 0.0),
        ((outlier_law(0.0, 0.05),) * 2, 0.0),
        ((outlier_law(0.1, 0.2),) * 2, 1.5),
        ((outlier_law(0.0, 0.0),) * 2, -2.0),
        ((outlier_law(0.1, 0.02, 5.0, 0.0), outlier_law(0.0, 0.1)), 0.0),
    ],
)
def test_outliers_and_bias_against_a_textbook_twin(laws, bias):
    columns, values = drawn(3, share=0.2), np.array([250.0, 15.0, 1e-3])
    law = ErrorLaw(bias=bias, outlier_laws=laws)
    found = PlotLikelihood(case(), None, [columns])(values, law)
    assert found == pytest.approx(twin(columns, values, laws, bias), abs=precision(found, values))


def test_tracks_add_up():
    tracks = [drawn(4), drawn(5)]
    values = np.array([200.0, 20.0, 1e-2])
    together = PlotLikelihood(case(), None, tracks)
    alone = [PlotLikelihood(case(), None, [one]) for one in tracks]
    added = rounding(operations=2 * len(T_S))  # of sums of numbers of one sign
    assert together(values) == pytest.approx(sum(one(values) for one in alone), rel=added)
    assert together.by_number(values) == pytest.approx(
        {name: sum(one.by_number(values)[name] for one in alone) for name in ("range_m", "velocity_mps")}, rel=added
    )
    assert sum(together.by_number(values).values()) == pytest.approx(together(values), rel=added)
    assert (together.tracks, together.rows) == (2, 16)
