"""The degree of a window switched by the detector: the exact law against plain simulation."""

import numpy as np
import pytest
from scipy.stats import chi2

from radarsim.studies.sonar.manoeuvre.exact import switched_window

DT, SIGMA = 5.0, 10.0


def course(acceleration):
    """Range of the shipped accelerating target: 10 m/s towards the sonar, faster from 100 s to 140 s."""
    t = np.arange(45) * DT
    pushed = np.clip(t - 100, 0, 40)
    return 9000 - 10 * t - acceleration * (pushed**2 / 2 + 40 * np.clip(t - 140, 0, None))


@pytest.mark.parametrize(("memory", "plots", "rate"), [(6, 5, 0.3), (6, 6, 0.01), (5, 4, 0.05)])
def test_by_plain_simulation(memory, plots, rate):
    truth, n = course(0.4), 20_000
    k = chi2.isf(rate, 1)
    of = switched_window(truth, SIGMA, DT, memory, plots, k)
    z = truth + SIGMA * np.random.default_rng(8).standard_normal((n, len(truth)))
    t, s = DT * np.arange(1 - memory, 1), DT * np.arange(1 - plots, 1)
    fits = [np.linalg.pinv(t[:, None] ** np.arange(d + 1))[0] for d in (1, 2)]
    bend = 2 * np.linalg.pinv(s[:, None] ** np.arange(3))[2]
    for i in range(memory - 1, len(truth)):
        window = z[:, i + 1 - memory : i + 1]
        line, parabola = (window @ fit - truth[i] for fit in fits)
        alarm = (window[:, memory - plots :] @ bend) ** 2 > k * SIGMA**2 * bend @ bend
        switched = np.where(alarm, parabola, line)
        for sampled, exact in zip((line, parabola, switched), of, strict=True):
            square = sampled**2
            wide = 5.85 * square.std() / np.sqrt(n)
            assert abs(square.mean() - exact[i - memory + 1] ** 2) < wide


def test_what_the_papers_own_six_plots_give():
    found = []
    for acceleration in (0.1, 0.8):  # the weakest and the strongest shipped manoeuvre
        of = switched_window(course(acceleration), SIGMA, DT, 6, 6, chi2.isf(0.01, 1))
        rms = [np.sqrt(np.mean(one**2)) for one in of]
        found += [rms[0] / rms[2], rms[1] / rms[2]]
    assert found == pytest.approx([0.975, 1.19, 1.87, 1.10], abs=0.005)
