"""The world of P2: the true flight, the times of the scans, the sensor, plots in the antenna's coordinates."""

from functools import lru_cache

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.kernels import random
from radarsim.physics import frames
from radarsim.physics.recorded_course import CourseError, read_points
from radarsim.studies.multimodel.config import Keys, Sensor
from radarsim.studies.multimodel.flight import ImpossibleFlight, Phase, fly, smoothed_states
from radarsim.studies.multimodel.kernels import layout, plots
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


def true_states(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Times (K,) and true states (K, 9) at the scans; raises ConfigError for an impossible target."""
    spec, target = case.spec, case.spec.target
    try:
        if target.kind == "recorded":
            times, positions = read_points(target.file)
            t = scan_times(spec, case, float(times[-1] - times[0]))
            return t, smoothed_states(times, positions, t)
        phases = [
            Phase(p.start_s, p.lateral_mps2, p.normal_mps2, p.axial_mps2, p.period_s or 0.0, p.trimmed)
            for p in target.phases
        ]
        t = scan_times(spec, case, target.duration_s)
        if len(t) < 4:
            raise ConfigError(f"{case.name}: target: lasts only {len(t)} scans; at least 4 are needed")
        coefficient = target.ballistic_coefficient_kgpm2
        return t, _cached_flight(
            target.position_m, target.velocity_mps, coefficient, target.lag_s, tuple(phases), t.tobytes()
        )
    except CourseError as error:
        raise ConfigError(*error.faults) from None
    except ImpossibleFlight as error:
        raise ConfigError(f"{case.name}: target: {error}") from None


@lru_cache(maxsize=4)
def _cached_flight(
    position: tuple[float, ...],
    velocity: tuple[float, ...],
    coefficient: float,
    lag: float,
    phases: tuple[Phase, ...],
    t: bytes,
) -> np.ndarray:
    """`fly`, cached for all cases with the same flight: it takes most of their preparation."""
    track = fly(position, velocity, coefficient, lag, phases, np.frombuffer(t))
    track.flags.writeable = False
    return track


def plot_truth(case: Case, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The truth of plots (K, 8): range, sine and cosine of elevation and of azimuth, x, y, z.

    Raises ConfigError if the target leaves the antenna's sector."""
    sensor = case.spec.sensor
    position = x[:, 0::3]
    if sensor.sigma_range_m is None:
        return np.concatenate([np.zeros((len(t), 5)), position], axis=1)
    R = frames.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
    antenna = frames.to_antenna(position, R, sensor.antenna_height_m)
    r = np.linalg.norm(antenna, axis=1)
    is_outside = antenna[:, 0] <= r * np.sqrt(2 * plots.MIN_U2)
    if is_outside.any():
        time_s = t[np.argmax(is_outside)]
        raise ConfigError(
            f"{case.name}: target: leaves the antenna's sector at {time_s:.6g} s: it must stay in front of it"
        )
    s_e, s_a = antenna[:, 1] / r, antenna[:, 2] / r
    return np.stack([r, s_e, np.sqrt(1 - s_e**2), s_a, np.sqrt(1 - s_a**2), *position.T], axis=1)


def sensor_frame(sensor: Sensor) -> np.ndarray:
    """The numbers (n,) of a sensor as the kernels take them; see `plots.pack_frame`."""
    R = frames.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
    form = layout.BICONICAL if sensor.sigma_range_m is not None else layout.CARTESIAN
    unbiased = sensor.conversion == "unbiased"
    return plots.pack_frame(R, sensor.antenna_height_m, sensor.sigma, form, unbiased, sensor.detection_probability)


def intervals(t: np.ndarray, tolerance: float = 1e-9) -> tuple[np.ndarray, np.ndarray]:
    """The number (K,) of each scan's interval since the previous scan, and the distinct intervals (U,), s."""
    steps = np.diff(t, prepend=t[0] - (t[1] - t[0]))
    rounded, index = np.unique(np.round(steps / tolerance), return_inverse=True)
    times = (
        np.array([steps[index == u].mean() for u in range(len(rounded))]) if len(rounded) < 50 else rounded * tolerance
    )
    return index.astype(np.int64), times


def local_plots(sensor: Sensor, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Recorded plots (n, 3) in the local frame: positions (n, 3), covariances (n, 6), and which are valid (n,).

    A plot is valid if it has all three values and, in biconical coordinates, lies in front of the antenna."""
    is_valid, sigma = np.isfinite(measured).all(axis=1), np.array(sensor.sigma)
    z, R = np.zeros((len(measured), 3)), np.tile(np.eye(3), (len(measured), 1, 1))
    if sensor.sigma_range_m is None:
        z[is_valid], R[is_valid] = measured[is_valid], np.diag(sigma**2)
    else:
        sines = np.sin(np.where(is_valid[:, None], measured, 0.0)[:, 1:])
        in_front = np.abs(np.where(is_valid[:, None], measured, 0.0)[:, 1:]).sum(axis=1) < np.pi / 2
        is_valid &= in_front & (1 - (sines**2).sum(axis=1) > plots.MIN_U2)
        turn = frames.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
        valid = measured[is_valid]
        plain = sensor.conversion == "plain"
        antenna = frames.from_biconical(valid) if plain else frames.unbiased_from_biconical(valid, sigma)
        z[is_valid] = frames.to_local(antenna, turn, sensor.antenna_height_m)
        R[is_valid] = frames.plot_covariance(valid, sigma, turn)
    upper = np.triu_indices(3)
    return z, R[:, upper[0], upper[1]], is_valid
