"""The plane where it is exact: a target that approaches on the line of sight, with hardly an error in bearing, is that
of the studies of range alone."""

import math

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.studies.range_doppler import steady_state
from radarsim.studies.registry import study
from tests.studies.plane.cases import case_of, plots_of

SCANS, SETTLED = 70, 55  # scans, and those after which another start is forgotten
START = 5.0  # σ of first velocity and acceleration, m/s and m/s²
# Of the bearing: 0.8 mm at 80 km. Sigma points do not do: the process noise across, 40 m a scan, bends their range.
RADAR = {"sigma_bearing_rad": 1e-8, "detection_probability": 1.0}
APPROACH = {"kind": "straight", "range_m": 80e3, "speed_mps": 200.0, "aspect_rad": math.pi}
SIGMA = np.array([50.0, 2.0])  # of range and radial velocity
DT, EQUAL, SIZE = 5.0, 1e-9, np.array([80e3, 200.0])  # s; relative to these sizes of range and radial velocity
NOISE = {"velocity": {"sigma_acceleration_mps2": 1.5}, "acceleration": {"sigma_jerk_mps3": 0.3}}
STARTS = {
    "velocity": {"sigma_start_velocity_mps": START},
    "acceleration": {"sigma_start_velocity_mps": START, "sigma_start_acceleration_mps2": START},
}


def followed(model, rho, filters):
    """The plots (K, 2) of a realisation in range and velocity, and range and radial velocity that the filters estimate
    with their σ, (F, K, 2) each."""
    members = [
        {"name": f"{kind} {doppler}", "kind": kind, "model": model, "doppler": doppler, **NOISE[model], **STARTS[model]}
        | ({"unbiased": False} if kind == "converted" else {})
        for kind, doppler in filters
    ]
    case = case_of(members, APPROACH, SCANS, range_velocity_correlation=rho, **RADAR)
    t, z, _, _ = plots_of(case, 1)
    names = ("range_m", "bearing_rad", "velocity_mps")
    track = study("plane").tracker(case).feed({"t_s": t} | dict(zip(names, z[0].T, strict=True)))
    approaching = np.array([1.0, -1.0])
    return z[0][:, [0, 2]], approaching * track.estimate[..., [0, 2]], track.sigma[..., [0, 2]]


def own_filter(plots, model, rho, doppler):
    """Range and radial velocity (K, 2) of a Kalman filter with its derivative constant over a scan, and their σ."""
    n = {"velocity": 2, "acceleration": 3}[model]
    powers = range(n)
    F = np.array([[DT ** (j - i) / math.factorial(j - i) if j >= i else 0 for j in powers] for i in powers])
    g = np.array([DT ** (n - i) / math.factorial(n - i) for i in powers])
    m = 2 if doppler else 1
    H, R = np.eye(n)[:m], (np.outer(SIGMA, SIGMA) * [[1, rho], [rho, 1]])[:m, :m]
    x, P = np.zeros(n), START**2 * np.eye(n)
    x[:m], P[:m, :m] = plots[0, :m], R
    found = [(x[:2], np.sqrt(np.diag(P)[:2]))]
    (noise,) = NOISE[model].values()
    for z in plots[1:, :m]:
        x, P = F @ x, F @ P @ F.T + noise**2 * np.outer(g, g)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        A = np.eye(n) - K @ H
        x, P = x + K @ (z - H @ x), A @ P @ A.T + K @ R @ K.T
        found.append((x[:2], np.sqrt(np.diag(P)[:2])))
    return np.moveaxis(found, 1, 0)


@pytest.mark.parametrize("rho", [0.0, -0.9, 0.7])
@pytest.mark.parametrize("model", STARTS)
def test_on_the_line_of_sight_it_is_the_filter_of_range(model, rho):
    """At every scan, with Doppler and without, of plots as they are and converted."""
    kinds = [(kind, doppler) for kind in ("extended", "converted") for doppler in (False, True)]
    plots, estimates, sigmas = followed(model, rho, kinds)
    for (_, doppler), estimate, sigma in zip(kinds, estimates, sigmas, strict=True):
        wanted, wanted_sigma = own_filter(plots, model, rho, doppler)
        np.testing.assert_allclose(estimate / SIZE, wanted / SIZE, atol=EQUAL, rtol=0)
        np.testing.assert_allclose(sigma, wanted_sigma, rtol=EQUAL)


def compare_with(other, plots, estimate, sigma, keys):
    """Estimates and σ with those of another study's filter over the same plots, once its start is forgotten."""
    second = {"bearing_rad": np.zeros(SCANS)} if other == "sonar" else {"velocity_mps": plots[:, 1]}
    columns = {"t_s": DT * np.arange(SCANS), "range_m": plots[:, 0], **second}
    case = load(keys | {"study": other, "scans": SCANS, "realisations": 1}).cases[0]
    track = study(other).recording_interface().tracker(case).feed(columns)
    r_and_v = [index for index, (name, _) in enumerate(track.components) if name in ("r", "Vr", "vr")]
    wanted = track.estimate[0][:, r_and_v][SETTLED:]
    np.testing.assert_allclose(estimate[SETTLED:] / SIZE, wanted / SIZE, atol=EQUAL, rtol=0)
    np.testing.assert_allclose(sigma[SETTLED:], track.sigma[0][:, r_and_v][SETTLED:], rtol=EQUAL)


@pytest.mark.parametrize("doppler", [False, True])
def test_with_constant_acceleration_it_comes_to_the_study_of_range_and_doppler(doppler):
    """Estimates are those of its filter over the same plots, σ that of its Riccati equation."""
    plots, (estimate,), (sigma,) = followed("acceleration", 0.0, [("extended", doppler)])
    observes, variance = ["range", "velocity"][: 2 if doppler else 1], 0.3**2
    believed, _ = steady_state.steady_state(len(observes), variance, SIGMA, DT)
    np.testing.assert_allclose(sigma[-5:], np.sqrt(np.diag(believed)[None, :2]).repeat(5, axis=0), rtol=EQUAL)
    keys = {
        "radar": {"wavelength_m": 0.1, "sigma_range_m": 50, "sigma_velocity_mps": 2, "scan_period_s": 5},
        "target": {"kind": "polynomial", "coefficients": [80e3, -200]},
        "filters": [{"name": "one", "observes": observes, "manoeuvre_variance": variance}],
    }
    compare_with("range_doppler", plots, estimate, sigma, keys)


def test_with_constant_velocity_and_without_doppler_it_comes_to_the_sonar():
    """Its Kalman filter of degree 1 in polar coordinates, a random acceleration constant over a scan."""
    plots, (estimate,), (sigma,) = followed("velocity", 0.0, [("extended", False)])
    keys = {
        "sensor": {"sigma_range_m": 50, "sigma_bearing_deg": 1, "scan_period_s": 5},
        "target": {"kind": "polynomial", "frame": "polar", "range_m": [80e3, -200], "bearing_deg": [0]},
        "filters": [{"name": "one", "kind": "kalman", "degree": 1, "manoeuvre_variance": 1.5**2}],
    }
    compare_with("sonar", plots, estimate, sigma, keys)
