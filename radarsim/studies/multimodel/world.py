"""Flight of a point mass in the local frame (x north, y up, z east): gravity, drag, and accelerations commanded by
phase.

The paper's trajectory (P2 figs. 1-4) is lost except for its axes, so trajectories are integrated from a description
that is physical: exponential atmosphere, ballistic coefficient m/(C_D S), commands that are followed with a lag.

Flights that the axes of P2's lost figures allow, besides the shipped one; chosen before any filter ran on them.

Of figures 1 to 4 remain: 0 to 200 km north, ±100 km east, under 2000 m/s, 186.2 s, a ballistic part and one of intense
manoeuvre. Lost are the kind of the manoeuvre (vertical or lateral), its strength, its start and its duration. All
flights but one start as the shipped one; they manoeuvre from 125 s on, the early ones from 60 s, to 170 s at the
latest. The manoeuvres are those of textbooks: a weave, reversals, one pull-up, a spiral; 40 to 250 m/s², or 4 to 25 g.

Design of multiple-model filters: banks of motion models, transition probabilities over any interval, and the start
of a track.

    M           number of models of a filter
    T (M, M)    transition probabilities over the configured interval Δt, column j: from model j
    Q (M, M)    rates of the Markov process, T(t) = expm(t Q)
    p (M,)      probabilities of the models

The world of P2: the true flight, the times of the scans, the sensor, plots in the antenna's coordinates."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from radarsim import physics
from radarsim.config.experiment import Case
from radarsim.constants import STANDARD_GRAVITY_MPS2
from radarsim.errors import ConfigError
from radarsim.kernels import random
from radarsim.physics import Unreadable, points, smoothed
from radarsim.studies.multimodel.config import Flight, Keys, Sensor
from radarsim.studies.multimodel.kernels import records, strip
from radarsim.studies.noise import noise_key

# ---- flight ----------------------------------------------------------------------------------------------------------
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
    """States (K, 9) at times t of a recorded flight, as `physics.smoothed`; raises ImpossibleFlight as `fly`.

    times (n,), at least 5 and increasing; positions (n, 3)."""
    track = smoothed(times, positions, t)
    _check_flight(track, t)
    return track


# ---- flights ---------------------------------------------------------------------------------------------------------
START_S, END_S, EARLY_START_S = 125, 170, 60  # of the manoeuvre, s, and of an early one
FLIGHT_KEYS: dict[str, Any] = {
    "kind": "flight",
    "duration_s": 186.2,
    "position_m": [190e3, 45e3, 97e3],
    "velocity_mps": [-931, 560, -930],
    "ballistic_coefficient_kgpm2": 9000,
    "lag_s": 1,
}


def _flight(phases: list[dict[str, Any]], end_s: float = END_S, **keys: Any) -> Flight:
    """A ballistic flight, then these phases, then a trimmed flight; its stages are those of the shipped flight."""
    stages = [
        *({"name": "start", "end_s": 20}, {"name": "ballistic", "end_s": phases[0]["start_s"]}),
        *({"name": "manoeuvre", "end_s": end_s}, {"name": "after"}),
    ]
    all_phases = [{"start_s": 0}, *phases, {"start_s": end_s, "trimmed": True}]
    return Flight.model_validate(FLIGHT_KEYS | keys | {"phases": all_phases, "stages": stages})


def _weave(period_s: float, **commands: float) -> list[dict[str, Any]]:
    """Commands that follow a sine, after eight seconds of lift that end the fall."""
    lift = {"start_s": START_S, "normal_mps2": 40}
    return [lift, {"start_s": START_S + 8, "period_s": period_s, "trimmed": True, **commands}]


def _constant_acceleration(
    size: float, end_s: float, key: str = "normal_mps2", **other_commands: float
) -> dict[str, Any]:
    """A constant acceleration, with the end of its stage."""
    return {"phases": [{"start_s": START_S, key: size, **other_commands}], "end_s": end_s}


def _reversals(
    key: str, size: float, interval_s: float, begin_s: float = START_S, **other_commands: float
) -> list[dict[str, Any]]:
    """Accelerations of the same size, whose sign changes at intervals."""
    count = int((END_S - begin_s) / interval_s)
    return [{"start_s": begin_s + i * interval_s, key: size * (-1) ** i, **other_commands} for i in range(count)]


def _spiral(size: float, interval_s: float, turns: int) -> list[dict[str, Any]]:
    """An acceleration to the right, up, left and down in turn, plus 20 m/s² upwards throughout."""
    directions = ((1, 0), (0, 1), (-1, 0), (0, -1)) * turns
    return [
        {"start_s": START_S + interval_s * i, "lateral_mps2": size * side, "normal_mps2": 20 + size * up}
        for i, (side, up) in enumerate(directions)
    ]


FLIGHTS: dict[str, Flight] = {
    "gentle, up and aside 40": _flight(
        [
            {"start_s": START_S, "normal_mps2": 40},
            {"start_s": 135},
            {"start_s": 140, "lateral_mps2": 40, "normal_mps2": 10},
            {"start_s": 150},
            {"start_s": 155, "lateral_mps2": -40, "normal_mps2": 20},
        ],
        end_s=165,
    ),
    "lateral weave 40": _flight(_weave(20, lateral_mps2=40)),
    "lateral weave 100": _flight(_weave(12, lateral_mps2=100)),
    "lateral reversals 100": _flight(_reversals("lateral_mps2", 100, 9, normal_mps2=20)),
    "one turn 60": _flight(**_constant_acceleration(60, 139, "lateral_mps2", normal_mps2=20)),
    "vertical weave 60": _flight(_weave(16, normal_mps2=60)),
    "vertical weave 150": _flight(_weave(16, normal_mps2=150)),
    "vertical reversals 150": _flight(_reversals("normal_mps2", 150, 5)),
    "pull-up 100": _flight(**_constant_acceleration(100, 133)),
    "pull-up 250": _flight(**_constant_acceleration(250, 129)),
    "spiral 80": _flight(_spiral(80, 4, 2), end_s=157),
    "low, vertical weave 60": _flight(
        _weave(16, normal_mps2=60), position_m=[150e3, 42e3, 60e3], velocity_mps=[-700, 560, -500]
    ),
    "early lateral reversals 150": _flight(
        _reversals("lateral_mps2", 150, 9, EARLY_START_S, normal_mps2=20), end_s=EARLY_START_S + 12 * 9
    ),
    "early vertical reversals 100": _flight(
        _reversals("normal_mps2", 100, 6, EARLY_START_S), end_s=EARLY_START_S + 18 * 6
    ),
    "dive 60": _flight(**_constant_acceleration(-60, 145)),
}


# ---- filters ---------------------------------------------------------------------------------------------------------
MOTIONS = {"still": (0.0, 0.0), "uniform": (1.0, 0.0), "accelerated": (1.0, 1.0)}  # with velocity, with acceleration
MAX_EXPONENT = 2.0**52  # greatest exponent: every power has converged by then, and more would not fit a whole number


def labels(models: Sequence) -> tuple[str, ...]:
    """The models of a config's bank in words, for tables: motion and spread of the acceleration in m/s²."""
    return tuple(f"{model.motion} {model.sigma_acceleration_mps2:g}" for model in models)


def transition_matrix(rows: Sequence[Sequence[float]]) -> np.ndarray:
    """The transition matrix T (M, M) of the rows of a config, its columns summing to one exactly."""
    T = np.array(rows)
    return T / T.sum(axis=0)


def model_rows(motions: Sequence[str], sigmas: Sequence[float]) -> np.ndarray:
    """The models (M, 3) as a kernel takes them: moves, accelerates (0 or 1), sigma of the acceleration per step
    (m/s²)."""
    return np.array([(*MOTIONS[motion], sigma) for motion, sigma in zip(motions, sigmas, strict=True)])


def stationary(transition: np.ndarray) -> np.ndarray:
    """The stationary probabilities p = T p (M,) of a column-stochastic matrix (M, M).

    If there are several (a reducible matrix), those to which equal probabilities tend."""
    size = len(transition)
    mixing = (transition + np.eye(size)) / 2  # has the same stationary probabilities, and no periodic chains
    for _ in range(40):
        mixing = mixing @ mixing
        mixing /= mixing.sum(axis=0)  # rounding would grow with each square
    p = mixing @ np.full(size, 1.0 / size)
    p = np.maximum(p, 0.0)
    return p / p.sum()


def generator(transition: np.ndarray) -> np.ndarray:
    """Rates Q (M, M) of the Markov process nearest to log T: off-diagonal ones not negative, columns summing to zero.

    The paper's three-model matrix has no exact generator: its zeros make T**0.9 slightly negative (-4e-7)."""
    from scipy.linalg import logm

    Q = np.real(logm(transition))
    Q = np.where(np.eye(len(Q), dtype=bool), 0.0, np.maximum(Q, 0.0))
    return Q - np.diag(Q.sum(axis=0))


def transition_powers(transition: np.ndarray, exponents: np.ndarray) -> np.ndarray:
    """T(m Δt) = T(Δt)**m, eq. (8), for exponents m (n,): (n, M, M), column-stochastic.

    The whole part of m by powers, the fraction by expm(m Q) with the generator, so that no probability is negative."""
    exponents = np.minimum(np.asarray(exponents, dtype=float), MAX_EXPONENT)
    # The whole part exactly, the fraction by the generator: continuous in m and never negative.
    whole_exponents = np.floor(exponents + 1e-9).astype(np.int64)
    fractions = np.maximum(exponents - whole_exponents, 0.0)
    distinct, power_index = np.unique(whole_exponents, return_inverse=True)
    powers = np.stack([np.linalg.matrix_power(transition, m) for m in distinct])[power_index]
    has_fraction = fractions > 1e-9
    if has_fraction.any():
        powers[has_fraction] = powers[has_fraction] @ matrix_exponentials(
            generator(transition), fractions[has_fraction]
        )
    powers = np.maximum(powers, 0.0)
    return powers / powers.sum(axis=1, keepdims=True)


def matrix_exponentials(Q: np.ndarray, t: np.ndarray) -> np.ndarray:
    """expm(t Q) for times t (n,): (n, M, M); by eigenvectors where they are well conditioned, all times at once."""
    from scipy.linalg import expm

    values, V = np.linalg.eig(Q)
    if np.linalg.cond(V) > 1e6:
        return expm(t[:, None, None] * Q)
    return np.real(V @ (np.exp(t[:, None] * values)[:, :, None] * np.linalg.inv(V)))


def start_weights(t: np.ndarray, acceleration_spread: float) -> np.ndarray:
    """Weights a, b, g (3 each) of a straight line by least squares through three plots at times t (3,).

    See `kernels.strip.start_track`. The estimate at the third plot is x = Σ aₖ zₖ, v = Σ bₖ zₖ, acceleration 0. An
    acceleration w of the target causes the errors (Σ aₖ τₖ²/2, Σ bₖ τₖ²/2, -1) w, τₖ = tₖ - t₃; with w of the given
    spread (m/s²) they enter the covariance: g is this vector."""
    tau = np.asarray(t, dtype=float) - t[2]
    a, b = np.linalg.pinv(np.stack([np.ones(3), tau / -tau[0]], axis=1))
    b = b / -tau[0]
    half_squares = tau**2 / 2
    return np.concatenate([a, b, acceleration_spread * np.array([a @ half_squares, b @ half_squares, -1.0])])


# ---- world -----------------------------------------------------------------------------------------------------------
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
    """Times (K,) and true states (K, 9) at the scans; raises ConfigError for an impossible target."""
    spec, target = case.spec, case.spec.target
    try:
        if target.kind == "recorded":
            times, positions = points(target.file)
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
    except Unreadable as error:
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
    R = physics.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
    antenna = physics.to_antenna(position, R, sensor.antenna_height_m)
    r = np.linalg.norm(antenna, axis=1)
    is_outside = antenna[:, 0] <= r * np.sqrt(2 * strip.MIN_U2)
    if is_outside.any():
        time_s = t[np.argmax(is_outside)]
        raise ConfigError(
            f"{case.name}: target: leaves the antenna's sector at {time_s:.6g} s: it must stay in front of it"
        )
    s_e, s_a = antenna[:, 1] / r, antenna[:, 2] / r
    return np.stack([r, s_e, np.sqrt(1 - s_e**2), s_a, np.sqrt(1 - s_a**2), *position.T], axis=1)


def sensor_frame(sensor: Sensor) -> np.ndarray:
    """The numbers (n,) of a sensor as the kernels take them; see `strip.pack_frame`."""
    R = physics.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
    form = records.BICONICAL if sensor.sigma_range_m is not None else records.CARTESIAN
    unbiased = sensor.conversion == "unbiased"
    return strip.pack_frame(R, sensor.antenna_height_m, sensor.sigma, form, unbiased, sensor.detection_probability)


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
        is_valid &= in_front & (1 - (sines**2).sum(axis=1) > strip.MIN_U2)
        turn = physics.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
        valid = measured[is_valid]
        plain = sensor.conversion == "plain"
        antenna = physics.from_biconical(valid) if plain else physics.unbiased_from_biconical(valid, sigma)
        z[is_valid] = physics.to_local(antenna, turn, sensor.antenna_height_m)
        R[is_valid] = physics.plot_covariance(valid, sigma, turn)
    upper = np.triu_indices(3)
    return z, R[:, upper[0], upper[1]], is_valid
