"""Physical constants that more than one study uses.

Wave bands: the words for wavelengths, and the letters for frequencies (IEEE Std 521-2019).

Polynomial motion over one scan: transition matrices and the covariance of a random manoeuvre.

Local, antenna and biconical coordinates (P2 part 6), with Jacobians.

Local: x north, y up, z east, origin at the radar's foot. Antenna: x along the normal, y and z in the aperture, z to the
right. Biconical: range r, elevation e and azimuth a, the complements of the angles to the antenna's y and z axes, so
that y_A = r sin e, z_A = r sin a. Positions are arrays (…, 3); biconical points (…, 3) hold (r, e, a) in m and rad.

Recorded flights: positions from a CSV file, and the motion that a smoothing spline through them has.

Range, radial velocity and radial acceleration of a target of targets that fit a polynomial or break it.

All functions take times t (K,) in seconds from the first plot and give (K, 3): range in m, radial velocity in m/s,
radial acceleration in m/s²."""

import csv
import math
from collections.abc import Sequence

import numpy as np

from radarsim.constants import STANDARD_GRAVITY_MPS2

ROUNDED = 1e-7  # of a correlation: what rounding may leave
NOTHING = 1e-15  # of the largest element of a covariance: a variance that is only rounding


# ---- motion ----------------------------------------------------------------------------------------------------------
def transition(dt: float, size: int = 3) -> np.ndarray:
    """Transition matrix (size, size) of value, rate, …: element i, j is dt**(j - i) / (j - i)! (P1 eq. 3, its B)."""
    F = np.eye(size)
    for lag in range(1, size):
        F += np.diag(np.full(size - lag, dt**lag / float(np.prod(range(1, lag + 1)))), lag)
    return F


def white_jerk_covariance(variance: float, dt: float) -> np.ndarray:
    """Covariance (3, 3) that white jerk of spectral density variance · dt, in (m/s³)² s, adds over a scan. A jerk that
    white noise gives has, averaged over a scan, the variance `variance`, (m/s³)². (Bar-Shalom, Li & Kirubarajan,
    Estimation with Applications to Tracking and Navigation, 2001, eq. 6.2.3-7.)"""
    g = [[dt**4 / 20, dt**3 / 8, dt**2 / 6], [dt**3 / 8, dt**2 / 3, dt / 2], [dt**2 / 6, dt / 2, 1.0]]
    return variance * dt**2 * np.array(g)


def acceleration_step_covariance(variance: float, dt: float) -> np.ndarray:
    """Covariance (3, 3) that a step of the acceleration at the beginning of a scan, of variance · dt², adds by its end.
    The piecewise constant Wiener acceleration (Bar-Shalom, Li & Kirubarajan 2001, eq. 6.3.3-4), with the acceleration
    gaining in a scan what a jerk of this variance, (m/s³)², gives it."""
    g = np.array([dt**2 / 2, dt, 1.0])
    return variance * dt**2 * np.outer(g, g)


def process_noise(kind: str, variance: float, dt: float) -> np.ndarray:
    """Q (3, 3) of a scan: `random_jerk` (P1 eq. 6), `white_jerk` or `white_acceleration`; variance is D_M, (m/s³)²."""
    covariances = {
        "random_jerk": manoeuvre_covariance,
        "white_jerk": white_jerk_covariance,
        "white_acceleration": acceleration_step_covariance,
    }
    return covariances[kind](variance, dt)


def manoeuvre_covariance(variance: float, dt: float, size: int = 3) -> np.ndarray:
    """Covariance (size, size) that a random derivative of order `size`, constant over the scan, adds (P1 eq. 6, its M).
    For size 3 the variance is that of a random jerk, (m/s³)²; for size 2 of a random acceleration, (m/s²)²."""
    g = transition(dt, size + 1)[:-1, -1]
    return variance * np.outer(g, g)


def is_covariance(found: np.ndarray) -> bool:
    """Whether a finite matrix (n, n) is symmetric and not negative, up to rounding: of any units, by correlations."""
    least = NOTHING * (np.abs(found).max() or 1.0)
    sigma = np.sqrt(np.maximum(np.diag(found), least))
    scaled = found / np.outer(sigma, sigma)  # else m² would hide what is wrong of rad²
    asymmetry = np.abs(scaled - scaled.T).max()
    np.fill_diagonal(scaled, np.diag(scaled).clip(0))
    return bool(np.diag(found).min() >= -least and asymmetry <= ROUNDED and np.linalg.eigvalsh(scaled)[0] >= -ROUNDED)


# ---- frames ----------------------------------------------------------------------------------------------------------
class OutsideSector(ValueError):
    """A point behind the antenna or in its plane, where biconical coordinates say nothing."""


def rotation(azimuth: float, elevation: float) -> np.ndarray:
    """R (3, 3) from antenna to local axes: the normal turned by `azimuth` from north to east, then raised by
    `elevation`."""
    ca, sa, ce, se = math.cos(azimuth), math.sin(azimuth), math.cos(elevation), math.sin(elevation)
    return np.array([[ca * ce, -ca * se, -sa], [se, ce, 0.0], [sa * ce, -sa * se, ca]])


def to_antenna(local: np.ndarray, R: np.ndarray, height: float) -> np.ndarray:
    """Antenna coordinates (…, 3) of local positions (…, 3); height (m) of the phase centre above the origin."""
    return (local - np.array([0.0, height, 0.0])) @ R


def to_local(antenna: np.ndarray, R: np.ndarray, height: float) -> np.ndarray:
    """Local positions (…, 3) of antenna coordinates (…, 3)."""
    return antenna @ R.T + np.array([0.0, height, 0.0])


def normal_cosine(biconical: np.ndarray) -> np.ndarray:
    """Cosine (…) of the angle from the antenna's normal of biconical (…, 3), sqrt(1 - sin² e - sin² a). Raises
    OutsideSector where it is not > 0."""
    square = 1.0 - np.sin(biconical[..., 1]) ** 2 - np.sin(biconical[..., 2]) ** 2
    # |e| + |a| >= 90° is no direction in front of the antenna.
    if not np.all((square > 0) & (np.abs(biconical[..., 1:]).sum(axis=-1) < math.pi / 2)):
        raise OutsideSector(
            "|elevation| + |azimuth| must be under 90 degrees: the point is not in front of the antenna"
        )
    return np.sqrt(square)


def from_biconical(biconical: np.ndarray) -> np.ndarray:
    """Antenna coordinates (…, 3) of biconical points, eq. (10); raises OutsideSector."""
    r, u = biconical[..., 0], normal_cosine(biconical)
    return np.stack([r * u, r * np.sin(biconical[..., 1]), r * np.sin(biconical[..., 2])], axis=-1)


def jacobian(biconical: np.ndarray) -> np.ndarray:
    """Derivatives (…, 3, 3) of the antenna coordinates by (r, e, a): J of eq. (10); raises OutsideSector."""
    r, e, a = np.moveaxis(biconical, -1, 0)
    u, zero = normal_cosine(biconical), np.zeros_like(r)
    return np.stack(
        [
            np.stack([u, -r * np.sin(e) * np.cos(e) / u, -r * np.sin(a) * np.cos(a) / u], axis=-1),
            np.stack([np.sin(e), r * np.cos(e), zero], axis=-1),
            np.stack([np.sin(a), zero, r * np.cos(a)], axis=-1),
        ],
        axis=-2,
    )


def plot_covariance(biconical: np.ndarray, sigma: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Covariance (…, 3, 3) in the local frame of plots with errors sigma (3,) in (r, e, a): R J diag(sigma²) J' R'."""
    root = R @ jacobian(biconical) * np.asarray(sigma)
    return root @ np.swapaxes(root, -1, -2)


def unbiased_from_biconical(biconical: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Antenna coordinates whose mean, over errors sigma (3,) of the plot, is the true point to the second order in
    sigma.

    sin of a noisy angle has the mean exp(-sigma²/2) sin; for x_A half the trace of the Hessian times the variances is
    taken off."""
    antenna, (_, ve, va) = from_biconical(biconical), np.asarray(sigma) ** 2
    r, u = biconical[..., 0], normal_cosine(biconical)
    bend = 0.0
    for angle, variance in ((biconical[..., 1], ve), (biconical[..., 2], va)):
        s2 = np.sin(angle) ** 2
        bend = bend + variance * (s2 - (1 - s2) - s2 * (1 - s2) / u**2) / u
    return antenna * np.array([1.0, 1 + ve / 2, 1 + va / 2]) - np.stack([r * bend / 2, 0 * r, 0 * r], axis=-1)


# ---- recorded --------------------------------------------------------------------------------------------------------
COLUMNS = ("t_s", "x_m", "y_m", "z_m")
LEAST_POINTS = 5  # that a smoothing spline takes
MOST_FAULTS = 20


class Unreadable(ValueError):
    """A file that is no recorded flight; `faults` name the file and the line of each."""

    def __init__(self, *faults: str):
        super().__init__("\n".join(faults))
        self.faults = faults


def points(path: str) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) in s and positions (n, 3) in m of a CSV file t_s,x_m,y_m,z_m; raises Unreadable, line by line."""
    with open(path, newline="", encoding="utf-8") as file:
        reader = csv.reader(file)
        header = next(reader, [])
        if missing := [name for name in COLUMNS if name not in header]:
            raise Unreadable(f"{path}:1: no column {', '.join(missing)}; needed: {', '.join(COLUMNS)}")
        at = [header.index(name) for name in COLUMNS]
        rows: list[list[float]] = []
        faults: list[str] = []
        for line in reader:
            try:
                row = [float(line[i]) for i in at]
            except (ValueError, IndexError):
                faults.append(f"{path}:{reader.line_num}: must be four numbers, got {','.join(line)[:60]!r}")
                continue
            if not np.isfinite(row).all():
                faults.append(f"{path}:{reader.line_num}: must be finite, got {','.join(line)[:60]!r}")
            elif rows and row[0] <= rows[-1][0]:
                faults.append(f"{path}:{reader.line_num}: t_s must increase, got {row[0]:g} after {rows[-1][0]:g}")
            else:
                rows.append(row)
    if not faults and len(rows) < LEAST_POINTS:
        faults.append(f"{path}: needs at least {LEAST_POINTS} points, got {len(rows)}")
    if faults:
        raise Unreadable(*faults[:MOST_FAULTS])
    table = np.array(rows)
    return table[:, 0], table[:, 1:]


def smoothed(times: np.ndarray, positions: np.ndarray, t: np.ndarray) -> np.ndarray:
    """States (K, 9) as (x, vx, ax, y, vy, ay, z, vz, az) at times t (K,) from the first point of a recorded flight.

    times (n,) are at least 5 and increase, positions (n, 3). A cubic smoothing spline for each axis, its strength
    chosen by generalised cross-validation; its derivatives are taken as the true velocity and acceleration."""
    from scipy.interpolate import make_smoothing_spline

    since = times - times[0]
    track = np.empty((len(t), 9))
    for axis in range(3):
        spline = make_smoothing_spline(since, positions[:, axis])
        for order in range(3):
            track[:, 3 * axis + order] = spline.derivative(order)(t) if order else spline(t)
    return track


def radial(states: np.ndarray) -> np.ndarray:
    """Range, radial velocity and acceleration (K, 3), as seen from the origin, of states (K, 9) as above. V = x·v / r,
    and a = (|v|² + x·a − V²) / r."""
    x, v, a = states[:, 0::3], states[:, 1::3], states[:, 2::3]
    r = np.sqrt((x**2).sum(axis=1))
    radial_velocity = (x * v).sum(axis=1) / r
    radial_acceleration = ((v**2).sum(axis=1) + (x * a).sum(axis=1) - radial_velocity**2) / r
    return np.stack([r, radial_velocity, radial_acceleration], axis=1)


# ---- targets ---------------------------------------------------------------------------------------------------------
def polynomial(coefficients: Sequence[float], t: np.ndarray) -> np.ndarray:
    """Σ cᵢ tⁱ / i! and two derivatives, (K, 3) at times t (K,); the cᵢ are derivatives at t = 0 (m, m/s, m/s², …)."""
    series = np.polynomial.Polynomial([c / math.factorial(i) for i, c in enumerate(coefficients)])
    return np.stack([series(t), series.deriv(1)(t), series.deriv(2)(t)], axis=1)


def acceleration_start(coefficients: Sequence[float], acceleration: float, start: float, t: np.ndarray) -> np.ndarray:
    """A polynomial whose acceleration grows by `acceleration` (m/s²) from `start` (s) on: (K, 3) at times t (K,)."""
    since = np.maximum(t - start, 0.0)
    step = np.stack([since**2 / 2, since, np.where(t >= start, 1.0, 0.0)], axis=1)
    return polynomial(coefficients, t) + acceleration * step


def acceleration_pulse(
    coefficients: Sequence[float], acceleration: float, start: float, duration: float, t: np.ndarray
) -> np.ndarray:
    """A polynomial with a constant acceleration (m/s²) from `start` for `duration` (s): (K, 3) at times t (K,)."""
    ended = acceleration_start((0.0,), acceleration, start + duration, t)
    return acceleration_start(coefficients, acceleration, start, t) - ended


def jerk_pulse(coefficients: Sequence[float], jerk: float, start: float, duration: float, t: np.ndarray) -> np.ndarray:
    """A polynomial with a constant jerk (m/s³) from `start` for `duration` (s), then acceleration: (K, 3) at t (K,)."""

    def ramp(onset: float) -> np.ndarray:
        since = np.maximum(t - onset, 0.0)
        return np.stack([since**3 / 6, since**2 / 2, since], axis=1)

    return polynomial(coefficients, t) + jerk * (ramp(start) - ramp(start + duration))


def turn(
    range_0: float, speed: float, aspect: float, acceleration_g: float, start: float, duration: float, t: np.ndarray
) -> np.ndarray:
    """Radial motion of a target that flies straight in a plane through the radar, turns at constant g, flies straight.

    range_0 (m) at t = 0; speed (m/s); aspect (rad) of the velocity from the direction away from the radar (pi: straight
    in); acceleration_g the lateral acceleration in standard gravities, positive to the left; start and duration in s.
    Gives range, radial velocity and acceleration (K, 3) at times t (K,)."""
    position, velocity, acceleration = _turning(range_0, speed, aspect, acceleration_g, start, duration, t)
    r = np.hypot(position[:, 0], position[:, 1])
    radial_velocity = np.sum(position * velocity, axis=1) / r
    radial_acceleration = (speed**2 - radial_velocity**2 + np.sum(position * acceleration, axis=1)) / r
    return np.stack([r, radial_velocity, radial_acceleration], axis=1)


def turn_in_space(
    range_0: float, speed: float, aspect: float, acceleration_g: float, start: float, duration: float, t: np.ndarray
) -> np.ndarray:
    """The flight of `turn` in its plane, the radar at the origin: (K, 9) as (x, vx, ax, y, vy, ay, z, vz, az)."""
    return _states(_turning(range_0, speed, aspect, acceleration_g, start, duration, t))


def _turning(
    range_0: float, speed: float, aspect: float, acceleration_g: float, start: float, duration: float, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration of `turn` in its plane, each (K, 2)."""
    rate = acceleration_g * STANDARD_GRAVITY_MPS2 / speed
    turned = rate * np.clip(t - start, 0.0, duration)
    heading = aspect + turned
    velocity = speed * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    turning = (t >= start) & (t < start + duration)
    acceleration = np.where(turning, speed * rate, 0.0)[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    # Position: the straight parts before and after, and the arc, whose chord is integrated in closed form.
    before = np.minimum(t, start)[:, None] * speed * np.array([math.cos(aspect), math.sin(aspect)])
    after = np.maximum(t - start - duration, 0.0)[:, None] * velocity
    position = np.array([range_0, 0.0]) + before + _arc(speed, rate, aspect, np.clip(t - start, 0.0, duration)) + after
    return position, velocity, acceleration


def _states(motion: Sequence[np.ndarray]) -> np.ndarray:
    """States (K, 9), axis by axis, of position, velocity and acceleration (K, 2) in a plane."""
    states = np.zeros((len(motion[0]), 9))
    for order, part in enumerate(motion):
        states[:, order], states[:, 3 + order] = part.T
    return states


def fly_by(distance: float, speed: float, start_range: float, t: np.ndarray) -> np.ndarray:
    """Radial motion of a target in straight flight past the radar, (K, 3) at times t (K,).

    distance (m) of closest approach, speed (m/s), start_range (m) at t = 0, inbound. r² = d² + x², V = v x / r,
    a = v² d² / r³ with x = v t − √(r₀² − d²) along the path."""
    along = speed * t - math.sqrt((start_range - distance) * (start_range + distance))
    r = np.hypot(along, distance)
    return np.stack([r, speed * along / r, speed**2 * distance**2 / r**3], axis=1)


def fly_by_in_space(distance: float, speed: float, start_range: float, t: np.ndarray) -> np.ndarray:
    """The flight of `fly_by` in its plane, the radar at the origin: (K, 9) as (x, vx, ax, y, vy, ay, z, vz, az)."""
    states = np.zeros((len(t), 9))
    states[:, 0] = speed * t - math.sqrt((start_range - distance) * (start_range + distance))
    states[:, 1], states[:, 3] = speed, distance
    return states


def _arc(speed: float, rate: float, aspect: float, elapsed: np.ndarray) -> np.ndarray:
    """Displacement (K, 2) after `elapsed` seconds of turning; a chord of angle x is speed·elapsed·sinc(x/2) long."""
    half = rate * elapsed / 2
    chord = speed * elapsed * np.sinc(half / np.pi)
    return chord[:, None] * np.stack([np.cos(aspect + half), np.sin(aspect + half)], axis=1)
