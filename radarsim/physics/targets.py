"""Range, velocity and acceleration of model targets: polynomial, pulse, turn, fly-by.

All functions take times t (K,) in seconds from the first plot and give (K, 3): range in m, radial velocity in m/s,
radial acceleration in m/s²."""

import math
from collections.abc import Sequence

import numpy as np

from radarsim.constants import STANDARD_GRAVITY_MPS2


def polynomial(coefficients: Sequence[float], t: np.ndarray) -> np.ndarray:
    """Σ cᵢ tⁱ / i! and two derivatives, (K, 3) at times t (K,); the cᵢ are derivatives at t = 0 (m, m/s, m/s², …)."""
    series = np.polynomial.Polynomial([c / math.factorial(i) for i, c in enumerate(coefficients)])
    return np.stack([series(t), series.deriv(1)(t), series.deriv(2)(t)], axis=1)


def acceleration_start(coefficients: Sequence[float], acceleration: float, start: float, t: np.ndarray) -> np.ndarray:
    """A polynomial whose acceleration grows by `acceleration` (m/s²) from `start` (s) on: (K, 3) at times t (K,)."""
    elapsed = np.maximum(t - start, 0.0)
    step = np.stack([elapsed**2 / 2, elapsed, np.where(t >= start, 1.0, 0.0)], axis=1)
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
        elapsed = np.maximum(t - onset, 0.0)
        return np.stack([elapsed**3 / 6, elapsed**2 / 2, elapsed], axis=1)

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
    straight_before = np.minimum(t, start)[:, None] * speed * np.array([math.cos(aspect), math.sin(aspect)])
    straight_after = np.maximum(t - start - duration, 0.0)[:, None] * velocity
    position = (
        np.array([range_0, 0.0])
        + straight_before
        + _arc(speed, rate, aspect, np.clip(t - start, 0.0, duration))
        + straight_after
    )
    return position, velocity, acceleration


def _states(motion: Sequence[np.ndarray]) -> np.ndarray:
    """States (K, 9), axis by axis, of position, velocity and acceleration (K, 2) in a plane."""
    states = np.zeros((len(motion[0]), 9))
    for order, derivative in enumerate(motion):
        states[:, order], states[:, 3 + order] = derivative.T
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
