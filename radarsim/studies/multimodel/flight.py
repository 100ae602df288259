"""Flight of a point mass in the local frame (x north, y up, z east): gravity, drag, and accelerations by phase.

The paper's trajectory (P2 figs. 1-4) is lost except for its axes, so trajectories are integrated from a description
that is physical: exponential atmosphere, ballistic coefficient m/(C_D S), commands that are followed with a lag."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.constants import STANDARD_GRAVITY_MPS2
from radarsim.physics.recorded_course import smooth_course

DENSITY_KGPM3, SCALE_HEIGHT_M = 1.225, 7200.0  # of an exponential atmosphere, fitted below 50 km
ORBIT_MPS = 7900.0  # first cosmic velocity: a flat earth is no model of anything faster
TOLERANCE = 1e-10


@dataclass(frozen=True)
class Phase:
    """Commanded accelerations (m/s²) from start_s on: to the right, up (normal to the velocity), along the velocity.

    With period_s > 0 they follow a sine of that period from the start of the phase. trimmed: lift and thrust also
    balance gravity and drag, as in an aeroplane's steady flight."""

    start_s: float
    lateral: float = 0.0
    normal: float = 0.0
    axial: float = 0.0
    period_s: float = 0.0
    trimmed: bool = False


class ImpossibleFlight(ValueError):
    """A flight that hits the ground or is faster than an orbit."""


def derivative(t: float, state: np.ndarray, phase: Phase, coefficient: float, lag: float) -> np.ndarray:
    """Time derivative of the state (9,): position, velocity, accelerations that follow the commands (right, up,
    forward)."""
    velocity, accelerations = state[3:6], state[6:9]
    command = np.array([phase.lateral, phase.normal, phase.axial])
    if phase.period_s > 0:
        command = command * math.sin(2 * math.pi * (t - phase.start_s) / phase.period_s)
    speed = math.sqrt(velocity @ velocity)
    forward = velocity / speed
    horizontal_speed = math.hypot(velocity[0], velocity[2])
    right = (
        np.array([-velocity[2], 0.0, velocity[0]]) / horizontal_speed
        if horizontal_speed > 0
        else np.array([0.0, 0.0, 1.0])
    )
    up = np.cross(right, forward)
    acceleration = accelerations[0] * right + accelerations[1] * up + accelerations[2] * forward
    if not phase.trimmed:
        density = DENSITY_KGPM3 * math.exp(-state[1] / SCALE_HEIGHT_M)
        acceleration = (
            acceleration - density * speed**2 / (2 * coefficient) * forward + np.array([0, -STANDARD_GRAVITY_MPS2, 0])
        )
    return np.concatenate([velocity, acceleration, (command - accelerations) / lag])


def fly(
    position: Sequence[float],
    velocity: Sequence[float],
    coefficient: float,
    lag: float,
    phases: Sequence[Phase],
    t: np.ndarray,
) -> np.ndarray:
    """States (K, 9) as (x, vx, ax, y, vy, ay, z, vz, az) at times t (K,) in s, increasing from 0.

    position (m), velocity (m/s) at t = 0; coefficient (kg/m²); lag (s) of the commands. Raises ImpossibleFlight if the
    flight hits the ground or exceeds the speed of an orbit."""
    from scipy.integrate import solve_ivp

    bounds = [phase.start_s for phase in phases[1:]] + [float(t[-1])]
    state, begin_s, states_by_scan = np.concatenate([position, velocity, np.zeros(3)]).astype(float), 0.0, []
    for phase, end_s in zip(phases, bounds, strict=True):
        is_last = end_s >= t[-1]
        end_s = min(end_s, float(t[-1]))
        in_phase = (t >= begin_s) & ((t <= end_s) if is_last else (t < end_s))
        arguments = (phase, coefficient, lag)
        solution = solve_ivp(
            derivative, (begin_s, end_s), state, "DOP853", dense_output=True, args=arguments, rtol=TOLERANCE, atol=1e-6
        )
        if not solution.success:
            raise ImpossibleFlight(f"the flight cannot be integrated beyond {solution.t[-1]:.6g} s")
        assert solution.sol is not None  # by dense_output
        states = solution.sol(t[in_phase]).T if in_phase.any() else ()  # a phase may pass between two plots
        state = solution.y[:, -1]
        states_by_scan += [
            _kinematics(time, state_at_time, arguments) for time, state_at_time in zip(t[in_phase], states, strict=True)
        ]
        if is_last:
            break
        begin_s = end_s
    track = np.array(states_by_scan)
    _check_flight(track, t)
    return track


def _kinematics(t: float, state: np.ndarray, arguments: tuple) -> np.ndarray:
    """Position, velocity, acceleration of a state, axis by axis (9,)."""
    acceleration = derivative(t, state, *arguments)[3:6]
    return np.stack([state[:3], state[3:6], acceleration], axis=1).ravel()


def _check_flight(track: np.ndarray, t: np.ndarray) -> None:
    is_below_ground, is_too_fast = track[:, 3] <= 0, np.linalg.norm(track[:, 1::3], axis=1) > ORBIT_MPS
    if is_below_ground.any():
        raise ImpossibleFlight(f"the target hits the ground at {t[np.argmax(is_below_ground)]:.6g} s")
    if is_too_fast.any():
        raise ImpossibleFlight(f"the target is faster than an orbit at {t[np.argmax(is_too_fast)]:.6g} s")


def smoothed_states(times: np.ndarray, positions: np.ndarray, t: np.ndarray) -> np.ndarray:
    """States (K, 9) of a recorded flight at times t, by `recorded_course.smooth_course`.

    times (n,), at least 5 and increasing; positions (n, 3). Raises ImpossibleFlight as `fly`."""
    track = smooth_course(times, positions, t)
    _check_flight(track, t)
    return track
