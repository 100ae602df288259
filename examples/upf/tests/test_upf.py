"""What proves the study: a twin of each filter in plain NumPy, and table 1."""

import numpy as np
import pytest
import radarsim
from radarsim.api.configs import load

import upf

CASE = load("upf").cases[0]


def motion(x, t):
    return 1 + np.sin(0.04 * np.pi * t) + 0.5 * x


def seen(x, t):
    return 0.2 * x * x if t <= 30 else 0.5 * x - 2


def augmented(x, P, y, t):
    """A step of the unscented filter of x, v and n with its seven sigma points, by matrices."""
    root = np.sqrt(5) * np.diag(np.sqrt([P, 0.75, 1e-5]))
    points = np.array([x, 0, 0]) + np.vstack([np.zeros(3), root, -root])
    w = np.array([0.4] + 6 * [0.1])
    moved = motion(points[:, 0], t) + points[:, 1]
    measured = np.array([seen(one, t) for one in moved]) + points[:, 2]
    m, z = w @ moved, w @ measured
    S, C, V = w @ (measured - z) ** 2, w @ ((moved - m) * (measured - z)), w @ (moved - m) ** 2
    return m + C / S * (y - z), V - C**2 / S


def extended(x, P, y, t):
    x, P = motion(x, t), 0.25 * P + 0.75
    h = 0.4 * x if t <= 30 else 0.5
    K = P * h / (h * h * P + 1e-5)
    return x + K * (y - seen(x, t)), P - K * h * P


def test_the_kalman_filters_are_those_of_a_few_lines():
    plots, result = radarsim.plots("upf", 3), radarsim.run("upf", realisations=3)
    for name, step in (("ekf", extended), ("ukf", augmented)):
        errors = np.concatenate(list(result.errors(name, "x")))
        for i in range(3):
            x, P = 1.0, 0.75
            for t in range(2, 61):
                x, P = step(x, P, plots["y"][i, t - 1], t)
                assert errors[i, t - 1] == pytest.approx(x - plots.truth[i, t - 1, 0], abs=1e-8)


def test_the_noise_is_of_gamma_3_2():
    x = radarsim.plots("upf", 4000).truth[:, :, 0]
    v = x[:, 1:] - motion(x[:, :-1], np.arange(2, 61))
    n = v.size
    assert v.mean() == pytest.approx(1.5, abs=5 * np.sqrt(0.75 / n))
    assert v.var() == pytest.approx(0.75, rel=5 * np.sqrt((3 * (1 + 2 / 3) - 1) / n))  # kurtosis 3 + 6/3


def test_resampling_keeps_as_many_as_the_weights_say():
    rng = np.random.default_rng(1)
    weight = rng.gamma(0.2, 1, (4, 50))
    weight /= weight.sum(axis=1, keepdims=True)
    kept = np.zeros(weight.shape)
    for _ in range(2000):
        chosen = upf.resampled(weight, rng.random(weight.shape))
        counts = np.stack([np.bincount(row, minlength=50) for row in chosen])
        assert (counts >= np.floor(50 * weight)).all()
        kept += counts
    np.testing.assert_allclose(kept / 2000, 50 * weight, atol=5 * np.sqrt(1 / 2000))


def test_a_realisation_has_the_same_particles_in_any_batch():
    result = radarsim.run("upf", realisations=20)
    for name in ("pf", "upf"):
        few = np.concatenate(list(result.errors(name, "x", realisations=5)))
        assert few.tobytes() == np.concatenate(list(result.errors(name, "x")))[:5].tobytes()


def test_the_rows_of_the_table_are_not_refuted():
    table = radarsim.run("upf", realisations=100).tables["claims"]
    assert set(table["claim"]) == {f"upf.{n}" for n in range(1, 6)}
    assert set(table["as_shipped"]) <= {"confirmed", "not yet decided"}


@pytest.mark.slow
def test_the_table_is_confirmed():
    table = radarsim.run("upf", realisations=8000).tables["claims"]
    assert set(table["as_shipped"]) == {"confirmed"}
