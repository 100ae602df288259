"""The world of P2: the true flight, the times of the scans, the sensor, plots in the antenna's coordinates."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.kernels import random
from radarsim.physics import frames
from radarsim.physics.recorded import Unreadable, points
from radarsim.studies.multimodel import flight
from radarsim.studies.multimodel.config import Keys, Sensor
from radarsim.studies.multimodel.kernels import plots, records
from radarsim.studies.noise import noise_key


def scan_times(spec: Keys, case: Case, duration: float) -> np.ndarray:
    """Times (K,) of the scans, s from the first plot: regular, or with a jitter drawn once from the seed."""
    period = spec.sensor.scan_period_s
    count = int(np.floor(duration / period * (1 + 1e-12))) + 1
    if spec.scans is not None:
        count = min(spec.scans, count)
    t = np.arange(count) * period
    if spec.sensor.jitter_s > 0:
        a, b = np.empty(count), np.empty(count)
        random.fill_uniform_pairs(noise_key(case, "jitter"), 0, 0, a, b)
        t = np.clip(t + spec.sensor.jitter_s * (2 * a - 1), 0.0, duration)
        t -= t[0]
    return t


def truth(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Times (K,) and true states (K, 9) at the scans; raises ConfigError where the target is no possible one."""
    spec, target = case.spec, case.spec.target
    try:
        if target.kind == "recorded":
            times, positions = points(target.file)
            t = scan_times(spec, case, float(times[-1] - times[0]))
            return t, flight.recorded(times, positions, t)
        phases = [
            flight.Phase(p.start_s, p.lateral_mps2, p.normal_mps2, p.axial_mps2, p.period_s or 0.0, p.trimmed)
            for p in target.phases
        ]
        t = scan_times(spec, case, target.duration_s)
        if len(t) < 4:
            raise ConfigError(f"{case.name}: target: lasts only {len(t)} scans; at least 4 are needed")
        coefficient = target.ballistic_coefficient_kgpm2
        return t, flight.fly(target.position_m, target.velocity_mps, coefficient, target.lag_s, phases, t)
    except Unreadable as error:
        raise ConfigError(*error.faults) from None
    except flight.Unflyable as error:
        raise ConfigError(f"{case.name}: target: {error}") from None


def plot_truth(case: Case, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """What plots are made of (K, 8): range, sine and cosine of elevation and azimuth, x, y, z.

    Raises ConfigError where the target leaves the antenna's sector.
    """
    sensor = case.spec.sensor
    position = x[:, 0::3]
    if sensor.sigma_range_m is None:
        return np.concatenate([np.zeros((len(t), 5)), position], axis=1)
    R = frames.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
    antenna = frames.to_antenna(position, R, sensor.antenna_height_m)
    r = np.linalg.norm(antenna, axis=1)
    outside = antenna[:, 0] <= r * np.sqrt(2 * plots.LEAST)
    if outside.any():
        when = t[np.argmax(outside)]
        raise ConfigError(
            f"{case.name}: target: leaves the antenna's sector at {when:.6g} s: it must stay in front of it"
        )
    s_e, s_a = antenna[:, 1] / r, antenna[:, 2] / r
    return np.stack([r, s_e, np.sqrt(1 - s_e**2), s_a, np.sqrt(1 - s_a**2), *position.T], axis=1)


def sensor_frame(sensor: Sensor) -> np.ndarray:
    """The numbers (n,) of a sensor as the kernels take them; see `kernels.plots.frame`."""
    R = frames.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
    form = records.BICONICAL if sensor.sigma_range_m is not None else records.CARTESIAN
    unbiased = sensor.conversion == "unbiased"
    return plots.frame(R, sensor.antenna_height_m, sensor.sigma, form, unbiased, sensor.detection_probability)


def intervals(t: np.ndarray, tolerance: float = 1e-9) -> tuple[np.ndarray, np.ndarray]:
    """For each scan the number of its interval since the last (K,), and the different intervals (U,), s."""
    steps = np.diff(t, prepend=t[0] - (t[1] - t[0]))
    rounded, index = np.unique(np.round(steps / tolerance), return_inverse=True)
    times = (
        np.array([steps[index == u].mean() for u in range(len(rounded))]) if len(rounded) < 50 else rounded * tolerance
    )
    return index.astype(np.int64), times


def local_plots(sensor: Sensor, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Recorded plots (n, 3) in the local frame: positions (n, 3), covariances (n, 6), and which are whole (n,).

    A plot counts where all three values are there and, of biconical ones, where it lies in front of the antenna.
    """
    whole, sigma = np.isfinite(measured).all(axis=1), np.array(sensor.sigma)
    z, R = np.zeros((len(measured), 3)), np.tile(np.eye(3), (len(measured), 1, 1))
    if sensor.sigma_range_m is None:
        z[whole], R[whole] = measured[whole], np.diag(sigma**2)
    else:
        sines = np.sin(np.where(whole[:, None], measured, 0.0)[:, 1:])
        narrow = np.abs(np.where(whole[:, None], measured, 0.0)[:, 1:]).sum(axis=1) < np.pi / 2
        whole &= narrow & (1 - (sines**2).sum(axis=1) > plots.LEAST)
        turn = frames.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
        seen = measured[whole]
        plain = sensor.conversion == "plain"
        antenna = frames.from_biconical(seen) if plain else frames.unbiased_from_biconical(seen, sigma)
        z[whole] = frames.to_local(antenna, turn, sensor.antenna_height_m)
        R[whole] = frames.plot_covariance(seen, sigma, turn)
    upper = np.triu_indices(3)
    return z, R[:, upper[0], upper[1]], whole
