"""The floor in the plane among false plots, and from which scan on covariances are tested."""

import math

import numpy as np
import pytest

from radarsim.studies.floors.bound import CRB, ENUMERATION, FALSE_REDUCTION
from radarsim.studies.floors.false_plots import information_share, information_shares
from radarsim.studies.registry import study
from tests.studies.plane.cases import STRAIGHT, TURN, case_of, member, run_of

HALF = 6.0  # standard deviations: half the width of the window
STEP = 1e-4


def score_variance(detection, density, m, n, seed):
    """The mean square of the derivative of the logarithm of a scan's likelihood by the target's place, by differences;
    and its standard error. Plots in a cube."""
    draw, squares = np.random.default_rng(seed), []
    for _ in range(n):
        plots = draw.uniform(-HALF, HALF, size=(draw.poisson(density * (2 * HALF) ** m), m))
        if draw.uniform() < detection:
            plots = np.concatenate([plots, draw.normal(size=(1, m))])

        def log_likelihood(place, plots=plots):
            ratios = np.exp(-0.5 * ((plots - place) ** 2).sum(axis=1)) / math.tau ** (m / 2) / density
            return math.log(1 - detection + detection * ratios.sum())

        place = STEP * np.eye(m)[0]
        squares.append(((log_likelihood(place) - log_likelihood(-place)) / (2 * STEP)) ** 2)
    return np.mean(squares), np.std(squares) / math.sqrt(n)


@pytest.mark.parametrize(("detection", "density", "m"), [(0.9, 0.03, 2), (0.6, 0.005, 3)])
def test_information_among_false_plots_is_the_variance_of_the_score(detection, density, m):
    value, error = score_variance(detection, density, m, 4000, 5)
    assert abs(information_share(detection, density, m) - value) < 4 * error
    assert error < 0.03


def test_information_falls_from_that_of_missed_plots():
    densities = np.array([0.0, 1e-4, 1e-3, 1e-2, 1e-1])
    for m in (2, 3):
        shares = information_shares(0.8, densities, m)
        assert shares[0] == 0.8
        assert (np.diff(shares) < 0).all()
        np.testing.assert_allclose(shares[1:], [information_share(0.8, d, m) for d in densities[1:]], rtol=0.02)


def test_the_floor_says_how_false_plots_count():
    radar = {"repetition_rate_hz": 40e3, "false_plots_from_s": 30.0, "sigma_bearing_rad": 3e-3}
    filters = [member("extended", doppler=False), member("extended")]
    floors = []
    for density in (0.0, 1e-6, 2.0):
        case = case_of(filters, STRAIGHT, 12, false_plots_per_km2=density, **radar)
        floors.append(study("plane").floor(case.spec, study("plane").axes(case.spec)))
    (known, known_doppler), (few, _), (many, many_doppler) = (floor.bounds for floor in floors)
    assert {floor.kind for floor in floors} == {CRB}
    assert set(known.patterns) == set(few.patterns) == {ENUMERATION}
    np.testing.assert_array_equal(few.sigma, known.sigma)
    assert many.patterns[-1] == FALSE_REDUCTION
    assert many.patterns[:6] == known.patterns[:6]
    assert (many.sigma[-1] > known.sigma[-1]).all()
    # Without Doppler false plots cost more.
    assert (many.sigma[-1, :2] / known.sigma[-1, :2] > many_doppler.sigma[-1, :2] / known_doppler.sigma[-1, :2]).all()


def test_covariances_are_tested_once_the_velocity_is_known():
    """Before, speed and course are no linear functions of it, and the NEES says so of every filter."""
    case = case_of([member("extended"), member("extended", doppler=False)], TURN, 14, detection_probability=1.0)
    plane, n = study("plane"), 40
    first = [plane.tested_from(case.spec, keys) for keys in case.spec.filters]
    nees = np.mean([run_of(case, i)["nees"][..., 0] for i in range(n)], axis=0) / 4
    for f, k in enumerate(first):
        assert 1 <= k <= 6
        assert nees[f, k] < 2
    assert nees[0, 1] > 5
