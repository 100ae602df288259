"""The plane's filters in Stone Soup, on the same plots: extended, unscented, and PDA among false plots.

    python benchmarks/plane_peers.py

Needs an environment of its own with radarsim and stonesoup (never this package's): see README.md. Prints how far the
estimates lie apart, relative to 60 km, 1 rad and 250 m/s, and Stone Soup's time a scan.

Stone Soup takes derivatives by finite differences, and means of angles on the circle. Here both are the study's: with
its own derivatives extended filters lie 10⁻⁵ apart and PDA 10⁻³, with its own means unscented filters 10⁻⁷."""

import math
import time
from datetime import datetime, timedelta

import numpy as np
import stonesoup.types.angle as angles
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.models.measurement.nonlinear import CartesianToBearingRange, CartesianToBearingRangeRate2D
from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track
from stonesoup.updater.kalman import ExtendedKalmanUpdater, UnscentedKalmanUpdater
from stonesoup.updater.probability import PDAUpdater

import radarsim
from radarsim.api.configs import load
from radarsim.studies.registry import study

N, SCANS, DT, SIGMA, START = 10, 14, 5.0, (50.0, 3e-3, 2.0), 300.0
DENSITY, DETECTION, GATE, CLEAR = 1e-7, 0.8, 0.99, 2  # false plots per m² from scan CLEAR on
COLUMNS = "range_m", "bearing_rad", "velocity_mps"
g = np.array([DT**2 / 2, DT])
MOTION = LinearGaussianTimeInvariantTransitionModel(
    transition_matrix=np.kron([[1, DT], [0, 1]], np.eye(2)), covariance_matrix=4 * np.kron(np.outer(g, g), np.eye(2))
)


def case_of(kind: str, doppler: bool, density: float, association: str):
    radar = dict(zip(("sigma_range_m", "sigma_bearing_rad", "sigma_velocity_mps"), SIGMA, strict=True))
    radar |= {"wavelength_m": 0.1, "scan_period_s": DT, "detection_probability": DETECTION, "repetition_rate_hz": 1e5}
    radar |= {"false_plots_per_km2": 1e6 * density, "false_plots_from_s": CLEAR * DT}
    target = {"kind": "straight", "range_m": 60e3, "speed_mps": 250, "aspect_rad": 2.5, "bearing_rad": -2}
    one = {"name": "one", "kind": kind, "doppler": doppler, "sigma_acceleration_mps2": 2, "association": association}
    keys = {"study": "plane", "radar": radar, "target": target, "filters": [one], "scans": SCANS, "seed": 1}
    return load(keys | {"realisations": N}).cases[0]


class Exact:
    """The derivatives of a plot: bearing, range and its rate."""

    def jacobian(self, state, **_):
        x, y, vx, vy = np.array(state.state_vector, float).ravel()
        r = math.hypot(x, y)
        v = (x * vx + y * vy) / r
        rows = [-y / r, x / r, 0, 0], [x, y, 0, 0], [vx - v * x / r, vy - v * y / r, x, y]
        return np.array(rows)[: self.ndim_meas] / r


class RangeRate(Exact, CartesianToBearingRangeRate2D):
    pass


class Range(Exact, CartesianToBearingRange):
    pass


def mean_angle(cls, values, weights=None):
    """The mean of angles about the first, as a study takes it."""
    apart = (np.array([float(a) for a in values]) - float(values[0]) + math.pi) % math.tau - math.pi
    return cls(float(values[0]) + np.average(apart, weights=weights))


def model_of(doppler: bool):
    noise = np.diag(np.square([SIGMA[1], SIGMA[0], SIGMA[2]])[: 3 if doppler else 2])
    if not doppler:
        return Range(ndim_state=4, mapping=(0, 1), noise_covar=noise)
    return RangeRate(ndim_state=4, mapping=(0, 1), velocity_mapping=(2, 3), noise_covar=noise)


def first_state(z) -> GaussianState:
    """The state after the first plot, whose velocity is not yet unfolded."""
    J = np.array([[math.cos(z[1]), -z[0] * math.sin(z[1])], [math.sin(z[1]), z[0] * math.cos(z[1])]])
    P = np.zeros((4, 4))
    P[:2, :2], P[2:, 2:] = J @ np.diag(np.square(SIGMA[:2])) @ J.T, START**2 * np.eye(2)
    along = J[:, 0]
    P[2:, 2:] += (SIGMA[2] ** 2 - START**2) * np.outer(along, along) * (len(z) == 3)
    velocity = z[2] * along if len(z) == 3 else np.zeros(2)
    return GaussianState(np.concatenate([z[0] * along, velocity])[:, None], P, timestamp=datetime(2020, 1, 1))


def components(state) -> np.ndarray:
    x, y, vx, vy = np.array(state.state_vector, float).ravel()
    return np.array([math.hypot(x, y), math.atan2(y, x), math.hypot(vx, vy), math.atan2(vy, vx)])


def follow(plots, updater, model, doppler: bool, density: float, span: float):
    """Estimates (K, 4) by Stone Soup of the plots (K, M, 2 or 3) of a realisation."""
    predictor, state = KalmanPredictor(MOTION), first_state(plots[0][0])
    estimates = [components(state)]
    for k in range(1, len(plots)):
        when = state.timestamp + timedelta(seconds=DT)
        detections = {
            Detection(StateVector([angles.Bearing(z[1]), z[0], *z[2:]]), timestamp=when, measurement_model=model)
            for z in plots[k]
        }
        if not detections:
            state = predictor.predict(state, timestamp=when)
        elif density:
            r = components(predictor.predict(state, timestamp=when))[0]
            false = density * r / (span if doppler else 1) if k >= CLEAR else 1e-250
            pda = PDAHypothesiser(
                predictor, updater, clutter_spatial_density=false, prob_detect=DETECTION, prob_gate=GATE
            )
            state = updater.update(pda.hypothesise(Track([state]), detections, when))
        else:
            predicted = predictor.predict(state, timestamp=when)
            state = updater.update(SingleHypothesis(predicted, detections.pop()))
        state = GaussianState(state.state_vector, state.covar, timestamp=when)
        estimates.append(components(state))
    return np.array(estimates)


def main() -> None:
    for angle in (angles.Angle, angles.Bearing):
        angle.average = classmethod(mean_angle)
    unscented = lambda model: UnscentedKalmanUpdater(model, alpha=1.0, beta=0.0, kappa=2.0)  # noqa: E731  as the study's
    for name, kind, doppler, updater, density in (
        ("extended", "extended", False, ExtendedKalmanUpdater, 0.0),
        ("extended, Doppler", "extended", True, ExtendedKalmanUpdater, 0.0),
        ("unscented, Doppler", "unscented", True, unscented, 0.0),
        ("PDA", "extended", False, PDAUpdater, DENSITY),
        ("PDA, Doppler", "extended", True, PDAUpdater, DENSITY),
    ):
        case, apart, seconds = case_of(kind, doppler, density, "pda" if density else "known"), 0.0, 0.0
        model = model_of(doppler)
        for i in range(N):
            rows = study("plane").recording_interface().simulated(case, i)
            t = rows["t_s"]
            z = np.transpose([rows[name] for name in COLUMNS[: 3 if doppler else 2]])
            plots = [z[(t == time_s) & np.isfinite(z[:, 0])] for time_s in np.unique(t)]
            before = time.process_time()
            found = follow(plots, updater(model), model, doppler, density, case.spec.radar.span_mps)
            seconds += time.process_time() - before
            off = found - study("plane").tracker(case).feed(rows).estimate[0]
            off[:, 1::2] = (off[:, 1::2] + math.pi) % math.tau - math.pi
            apart = max(apart, float(np.abs(off / [60e3, 1, 250, 1]).max()))
        print(f"{name:20} {apart:8.1e} apart, {1e3 * seconds / N / (SCANS - 1):6.2f} ms a scan")
    print(f"radarsim {radarsim.__version__}")


if __name__ == "__main__":
    main()
