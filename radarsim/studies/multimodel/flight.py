"""Flight of a point mass in the local frame (x north, y up, z east): gravity, drag, and accelerations commanded by
phase.

The paper's trajectory (P2 figs. 1-4) is lost except for its axes, so trajectories are integrated from a description
that is physical: exponential atmosphere, ballistic coefficient m/(C_D S), commands that are followed with a lag.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.physics.constants import STANDARD_GRAVITY_MPS2
from radarsim.physics.recorded import smoothed

DENSITY_KGPM3, SCALE_HEIGHT_M = 1.225, 7200.0  # of an exponential atmosphere, fitted below 50 km
ORBIT_MPS = 7900.0  # first cosmic velocity: a flat earth is no model of anything faster
TOLERANCE = 1e-10


@dataclass(frozen=True)
class Phase:
    """Commanded accelerations (m/s²) from start_s on: to the right, up (normal to the velocity), and along the
    velocity.

    With period_s > 0 they follow a sine of that period from the phase's start. trimmed: lift and thrust also balance
    gravity and drag, as in an aeroplane's steady flight.
    """

    start_s: float
    lateral: float = 0.0
    normal: float = 0.0
    axial: float = 0.0
    period_s: float = 0.0
    trimmed: bool = False


class Unflyable(ValueError):
    """A flight that hits the ground or is faster than an orbit."""


def derivative(t: float, state: np.ndarray, phase: Phase, coefficient: float, lag: float) -> np.ndarray:
    """Time derivative of the state (9,): position, velocity, followed accelerations (right, up, along)."""
    velocity, followed = state[3:6], state[6:9]
    command = np.array([phase.lateral, phase.normal, phase.axial])
    if phase.period_s > 0:
        command = command * math.sin(2 * math.pi * (t - phase.start_s) / phase.period_s)
    speed = math.sqrt(velocity @ velocity)
    along = velocity / speed
    level = math.hypot(velocity[0], velocity[2])
    right = np.array([-velocity[2], 0.0, velocity[0]]) / level if level > 0 else np.array([0.0, 0.0, 1.0])
    up = np.cross(right, along)
    acceleration = followed[0] * right + followed[1] * up + followed[2] * along
    if not phase.trimmed:
        density = DENSITY_KGPM3 * math.exp(-state[1] / SCALE_HEIGHT_M)
        acceleration = (
            acceleration - density * speed**2 / (2 * coefficient) * along + np.array([0, -STANDARD_GRAVITY_MPS2, 0])
        )
    return np.concatenate([velocity, acceleration, (command - followed) / lag])


def fly(
    position: Sequence[float],
    velocity: Sequence[float],
    coefficient: float,
    lag: float,
    phases: Sequence[Phase],
    t: np.ndarray,
) -> np.ndarray:
    """States (K, 9) as (x, vx, ax, y, vy, ay, z, vz, az) at times t (K,) in s, increasing from 0.

    position (m), velocity (m/s) at t = 0; coefficient (kg/m²); lag (s) of the commands. Raises Unflyable where the
    flight hits the ground or exceeds the speed of an orbit.
    """
    from scipy.integrate import solve_ivp

    bounds = [phase.start_s for phase in phases[1:]] + [float(t[-1])]
    state, begin, parts = np.concatenate([position, velocity, np.zeros(3)]).astype(float), 0.0, []
    for phase, end in zip(phases, bounds, strict=True):
        last = end >= t[-1]
        end = min(end, float(t[-1]))
        inside = (t >= begin) & ((t <= end) if last else (t < end))
        arguments = (phase, coefficient, lag)
        path = solve_ivp(
            derivative, (begin, end), state, "DOP853", dense_output=True, args=arguments, rtol=TOLERANCE, atol=1e-6
        )
        if not path.success:
            raise Unflyable(f"the flight cannot be integrated beyond {path.t[-1]:.6g} s")
        assert path.sol is not None  # asked for by dense_output
        states = path.sol(t[inside]).T if inside.any() else ()  # a phase may pass between two plots
        state = path.y[:, -1]
        parts += [_kinematics(at, s, arguments) for at, s in zip(t[inside], states, strict=True)]
        if last:
            break
        begin = end
    track = np.array(parts)
    _check(track, t)
    return track


def _kinematics(t: float, state: np.ndarray, arguments: tuple) -> np.ndarray:
    """Position, velocity, acceleration of a state, axis by axis (9,)."""
    acceleration = derivative(t, state, *arguments)[3:6]
    return np.stack([state[:3], state[3:6], acceleration], axis=1).ravel()


def _check(track: np.ndarray, t: np.ndarray) -> None:
    low, fast = track[:, 3] <= 0, np.linalg.norm(track[:, 1::3], axis=1) > ORBIT_MPS
    if low.any():
        raise Unflyable(f"the target hits the ground at {t[np.argmax(low)]:.6g} s")
    if fast.any():
        raise Unflyable(f"the target is faster than an orbit at {t[np.argmax(fast)]:.6g} s")


def recorded(times: np.ndarray, positions: np.ndarray, t: np.ndarray) -> np.ndarray:
    """States (K, 9) at times t of a recorded flight: times (n,), at least 5 and increasing, positions (n, 3).

    As `physics.recorded.smoothed`; raises Unflyable as `fly`.
    """
    track = smoothed(times, positions, t)
    _check(track, t)
    return track
