"""Motion of targets in cartesian and polar coordinates.

Bearings are counted from the x axis (north) towards the y axis (east): x = r cos b, y = r sin b. A state of one
coordinate is (value, rate, acceleration). Times in s, ranges in m, angles in rad."""

import math
from collections.abc import Sequence

import numpy as np

from radarsim.physics.targets import polynomial


def turning_states(
    x: float, y: float, speed: float, course: float, turns: Sequence[tuple[float, float, float]], t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """States (K, 3) in x and y of a target on straight legs and arcs, at constant speed (m/s).

    turns holds (start, end, rate) in s, s and rad/s, positive to starboard (the course increases), in order and
    without overlap. At the very start of a turn the acceleration is already that of the turn."""
    states = np.zeros((2, len(t), 3))
    legs, clock = [], 0.0
    for start, end, rate in turns:
        legs += [(clock, start, 0.0), (start, end, rate)]
        clock = end
    legs.append((clock, math.inf, 0.0))
    position = np.array([x, y], dtype=float)
    for start, end, rate in legs:
        inside = (t >= start) & (t < end)
        states[:, inside] = _arc(position, speed, course, rate, t[inside] - start)
        if end < math.inf:
            position = _arc(position, speed, course, rate, np.array([end - start]))[:, 0, 0]
            course += rate * (end - start)
    return states[0], states[1]


def _arc(position: np.ndarray, speed: float, course: float, rate: float, elapsed: np.ndarray) -> np.ndarray:
    """States (2, n, 3) after `elapsed` seconds of a turn.

    The chord of an arc of angle a has length speed · elapsed · sinc(a / 2)."""
    half = rate * elapsed / 2
    chord = speed * elapsed * np.sinc(half / np.pi)
    heading = course + 2 * half
    x = [position[0] + chord * np.cos(course + half), speed * np.cos(heading), -speed * rate * np.sin(heading)]
    y = [position[1] + chord * np.sin(course + half), speed * np.sin(heading), speed * rate * np.cos(heading)]
    return np.stack([np.stack(x, axis=1), np.stack(y, axis=1)])


def accelerating_states(
    x: float, y: float, speed: float, course: float, acceleration: float, start: float, end: float, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """States (K, 3) in x and y of a target on a straight course, accelerated from start to end (s, m/s²).

    The acceleration acts from the very start, and no longer at the end."""
    on, off = np.maximum(t - start, 0.0), np.maximum(t - end, 0.0)
    distance = speed * t + acceleration * (on**2 - off**2) / 2
    rate = speed + acceleration * (on - off)
    along = np.stack([distance, rate, np.where((t >= start) & (t < end), acceleration, 0.0)], axis=1)
    origin = np.array([[x], [y]]) * np.array([1.0, 0.0, 0.0])
    states = origin[:, None, :] + np.array([math.cos(course), math.sin(course)])[:, None, None] * along
    return states[0], states[1]


def polar_states(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States (K, 3) of range and unwrapped bearing from those of x and y."""
    r = np.hypot(x[:, 0], y[:, 0])
    b = np.unwrap(np.arctan2(y[:, 0], x[:, 0]))
    cb, sb = np.cos(b), np.sin(b)
    vr, vb = x[:, 1] * cb + y[:, 1] * sb, (y[:, 1] * cb - x[:, 1] * sb) / r
    ar = x[:, 2] * cb + y[:, 2] * sb + r * vb**2
    ab = (y[:, 2] * cb - x[:, 2] * sb - 2 * vr * vb) / r
    return np.stack([r, vr, ar], axis=1), np.stack([b, vb, ab], axis=1)


def cartesian_states(r: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States (K, 3) of x and y from those of range and bearing; the inverse of `polar_states`."""
    cb, sb = np.cos(b[:, 0]), np.sin(b[:, 0])
    across, radial = r[:, 0] * b[:, 1], r[:, 2] - r[:, 0] * b[:, 1] ** 2
    lateral = 2 * r[:, 1] * b[:, 1] + r[:, 0] * b[:, 2]
    x = [r[:, 0] * cb, r[:, 1] * cb - across * sb, radial * cb - lateral * sb]
    y = [r[:, 0] * sb, r[:, 1] * sb + across * cb, radial * sb + lateral * cb]
    return np.stack(x, axis=1), np.stack(y, axis=1)


def polynomial_states(coefficients: Sequence[Sequence[float]], t: np.ndarray) -> tuple[np.ndarray, ...]:
    """States (K, 3) of each coordinate from its derivatives at t = 0 (P3 eq. 1, with vᵢ = cᵢ / i!)."""
    return tuple(polynomial(c, t) for c in coefficients)
