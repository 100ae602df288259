"""Flight of a point mass in the local frame (x north, y up, z east): gravity, drag, and accelerations commanded by
phase.

The paper's trajectory (P2 figs. 1-4) is lost except for its axes, so trajectories are integrated from a description
that is physical: exponential atmosphere, ballistic coefficient m/(C_D S), commands that are followed with a lag.

Flights that the axes of P2's lost figures allow, beside the shipped one; chosen before any filter ran on them.

What is left of figures 1 to 4: 0 to 200 km north, ±100 km east, under 2000 m/s, 186.2 s, a ballistic part and one of
intense manoeuvre. What manoeuvre it is, in the vertical or to the side, how strong, from when on and for how long, is
lost. All flights but one begin as the shipped one does; they manoeuvre from 125 s on, the early ones from 60 s, to
170 s at the latest. Manoeuvres are those of the field's textbooks: a weave, reversals, one pull-up, a spiral; 40 to
250 m/s², which is 4 to 25 g.

Design of multiple-model filters: banks of motion models, transition probabilities over any interval, and the start
of a track.

    M           number of models of a filter
    T (M, M)    transition probabilities over the interval Δt that they are stated for, column j: from model j
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
    """Commanded accelerations (m/s²) from start_s on: to the right, up (normal to the velocity), and along the
    velocity. With period_s > 0 they follow a sine of that period from the phase's start. trimmed: lift and thrust also
    balance gravity and drag, as in an aeroplane's steady flight."""

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
    flight hits the ground or exceeds the speed of an orbit."""
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
    """States (K, 9) at times t of a recorded flight: times (n,), at least 5 and increasing, positions (n, 3). As
    `physics.smoothed`; raises Unflyable as `fly`."""
    track = smoothed(times, positions, t)
    _check(track, t)
    return track


# ---- flights ---------------------------------------------------------------------------------------------------------
BEGINS, ENDS, EARLY = 125, 170, 60  # s, of the manoeuvre; EARLY: another beginning
BASE: dict[str, Any] = {
    "kind": "flight",
    "duration_s": 186.2,
    "position_m": [190e3, 45e3, 97e3],
    "velocity_mps": [-931, 560, -930],
    "ballistic_coefficient_kgpm2": 9000,
    "lag_s": 1,
}


def _flight(phases: list[dict[str, Any]], ends: float = ENDS, **other: Any) -> Flight:
    """Ballistic, then these phases, then trimmed; stages as those of the shipped flight."""
    stages = [
        *({"name": "start", "end_s": 20}, {"name": "ballistic", "end_s": phases[0]["start_s"]}),
        *({"name": "manoeuvre", "end_s": ends}, {"name": "after"}),
    ]
    every = [{"start_s": 0}, *phases, {"start_s": ends, "trimmed": True}]
    return Flight.model_validate(BASE | other | {"phases": every, "stages": stages})


def _weave(period_s: float, **commands: float) -> list[dict[str, Any]]:
    """A sine of the commands, after eight seconds that lift the target out of its fall."""
    lifted = {"start_s": BEGINS, "normal_mps2": 40}
    return [lifted, {"start_s": BEGINS + 8, "period_s": period_s, "trimmed": True, **commands}]


def _held(size: float, until_s: float, key: str = "normal_mps2", **also: float) -> dict[str, Any]:
    """One acceleration, held; with the stage that ends where it ends."""
    return {"phases": [{"start_s": BEGINS, key: size, **also}], "ends": until_s}


def _reversals(key: str, size: float, held_s: float, begins: float = BEGINS, **also: float) -> list[dict[str, Any]]:
    """Accelerations of one size, the sign changed after each has been held."""
    count = int((ENDS - begins) / held_s)
    return [{"start_s": begins + i * held_s, key: size * (-1) ** i, **also} for i in range(count)]


def _spiral(size: float, held_s: float, turns: int) -> list[dict[str, Any]]:
    """The acceleration goes round: right, up, left, down, each held, and 20 m/s² upwards throughout."""
    round_ = ((1, 0), (0, 1), (-1, 0), (0, -1)) * turns
    return [
        {"start_s": BEGINS + held_s * i, "lateral_mps2": size * side, "normal_mps2": 20 + size * up}
        for i, (side, up) in enumerate(round_)
    ]


FLIGHTS: dict[str, Flight] = {
    "gentle, up and aside 40": _flight(
        [
            {"start_s": BEGINS, "normal_mps2": 40},
            {"start_s": 135},
            {"start_s": 140, "lateral_mps2": 40, "normal_mps2": 10},
            {"start_s": 150},
            {"start_s": 155, "lateral_mps2": -40, "normal_mps2": 20},
        ],
        ends=165,
    ),
    "lateral weave 40": _flight(_weave(20, lateral_mps2=40)),
    "lateral weave 100": _flight(_weave(12, lateral_mps2=100)),
    "lateral reversals 100": _flight(_reversals("lateral_mps2", 100, 9, normal_mps2=20)),
    "one turn 60": _flight(**_held(60, 139, "lateral_mps2", normal_mps2=20)),
    "vertical weave 60": _flight(_weave(16, normal_mps2=60)),
    "vertical weave 150": _flight(_weave(16, normal_mps2=150)),
    "vertical reversals 150": _flight(_reversals("normal_mps2", 150, 5)),
    "pull-up 100": _flight(**_held(100, 133)),
    "pull-up 250": _flight(**_held(250, 129)),
    "spiral 80": _flight(_spiral(80, 4, 2), ends=157),
    "low, vertical weave 60": _flight(
        _weave(16, normal_mps2=60), position_m=[150e3, 42e3, 60e3], velocity_mps=[-700, 560, -500]
    ),
    "early lateral reversals 150": _flight(
        _reversals("lateral_mps2", 150, 9, EARLY, normal_mps2=20), ends=EARLY + 12 * 9
    ),
    "early vertical reversals 100": _flight(_reversals("normal_mps2", 100, 6, EARLY), ends=EARLY + 18 * 6),
    "dive 60": _flight(**_held(-60, 145)),
}


# ---- filters ---------------------------------------------------------------------------------------------------------
MOTIONS = {"still": (0.0, 0.0), "uniform": (1.0, 0.0), "accelerated": (1.0, 1.0)}  # with velocity, with acceleration
MOST_STEPS = 2.0**52  # greatest exponent: every power has converged by then, and more would not fit a whole number


def labels(models: Sequence) -> tuple[str, ...]:
    """What each model of a config's bank is, for tables and figures: its motion and the spread in m/s²."""
    return tuple(f"{model.motion} {model.sigma_acceleration_mps2:g}" for model in models)


def transition_matrix(rows: Sequence[Sequence[float]]) -> np.ndarray:
    """The transition matrix T (M, M) of the rows of a config, its columns summing to one exactly."""
    T = np.array(rows)
    return T / T.sum(axis=0)


def bank(motions: Sequence[str], sigmas: Sequence[float]) -> np.ndarray:
    """The models (M, 3) as a kernel takes them: moves, accelerates (0 or 1), sigma of the acceleration per step
    (m/s²)."""
    return np.array([(*MOTIONS[motion], sigma) for motion, sigma in zip(motions, sigmas, strict=True)])


def stationary(transition: np.ndarray) -> np.ndarray:
    """The stationary probabilities p = T p (M,) of a column-stochastic matrix (M, M). Where there are several (a
    reducible matrix), the one that equal probabilities tend to."""
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
    The paper's three-model matrix has no exact one: its zeros make T**0.9 slightly negative (-4e-7)."""
    from scipy.linalg import logm

    Q = np.real(logm(transition))
    Q = np.where(np.eye(len(Q), dtype=bool), 0.0, np.maximum(Q, 0.0))
    return Q - np.diag(Q.sum(axis=0))


def transition_powers(transition: np.ndarray, exponents: np.ndarray) -> np.ndarray:
    """T(m Δt) = T(Δt)**m, eq. (8), for exponents m (n,): (n, M, M), column-stochastic.

    Whole m: the power; the part under one: expm(m Q) with the generator above, so that no probability is negative."""
    exponents = np.minimum(np.asarray(exponents, dtype=float), MOST_STEPS)
    # The whole part exactly, the rest by the generator: continuous in m and never negative.
    whole = np.floor(exponents + 1e-9).astype(np.int64)
    rest = np.maximum(exponents - whole, 0.0)
    distinct, place = np.unique(whole, return_inverse=True)
    powers = np.stack([np.linalg.matrix_power(transition, m) for m in distinct])[place]
    broken = rest > 1e-9
    if broken.any():
        powers[broken] = powers[broken] @ exponentials(generator(transition), rest[broken])
    powers = np.maximum(powers, 0.0)
    return powers / powers.sum(axis=1, keepdims=True)


def exponentials(Q: np.ndarray, t: np.ndarray) -> np.ndarray:
    """expm(t Q) for times t (n,): (n, M, M); by eigenvectors where they are well conditioned, all times at once."""
    from scipy.linalg import expm

    values, V = np.linalg.eig(Q)
    if np.linalg.cond(V) > 1e6:
        return expm(t[:, None, None] * Q)
    return np.real(V @ (np.exp(t[:, None] * values)[:, :, None] * np.linalg.inv(V)))


def start_weights(t: np.ndarray, acceleration_spread: float) -> np.ndarray:
    """Least squares of a straight line through three plots at times t (3,): a, b, g (3 each) for `kernels.strip.start`.

    The estimate at the third plot is x = Σ aₖ zₖ, v = Σ bₖ zₖ, acceleration 0. An acceleration w of the target makes
    errors (Σ aₖ τₖ²/2, Σ bₖ τₖ²/2, -1) w, τₖ = tₖ - t₃; with w of the stated spread (m/s²) they enter the covariance:
    g is this vector."""
    tau = np.asarray(t, dtype=float) - t[2]
    a, b = np.linalg.pinv(np.stack([np.ones(3), tau / -tau[0]], axis=1))
    b = b / -tau[0]
    bent = tau**2 / 2
    return np.concatenate([a, b, acceleration_spread * np.array([a @ bent, b @ bent, -1.0])])


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
    """Times (K,) and true states (K, 9) at the scans; raises ConfigError where the target is no possible one."""
    spec, target = case.spec, case.spec.target
    try:
        if target.kind == "recorded":
            times, positions = points(target.file)
            t = scan_times(spec, case, float(times[-1] - times[0]))
            return t, recorded(times, positions, t)
        phases = [
            Phase(p.start_s, p.lateral_mps2, p.normal_mps2, p.axial_mps2, p.period_s or 0.0, p.trimmed)
            for p in target.phases
        ]
        t = scan_times(spec, case, target.duration_s)
        if len(t) < 4:
            raise ConfigError(f"{case.name}: target: lasts only {len(t)} scans; at least 4 are needed")
        coefficient = target.ballistic_coefficient_kgpm2
        return t, _flown(target.position_m, target.velocity_mps, coefficient, target.lag_s, tuple(phases), t.tobytes())
    except Unreadable as error:
        raise ConfigError(*error.faults) from None
    except Unflyable as error:
        raise ConfigError(f"{case.name}: target: {error}") from None


@lru_cache(maxsize=4)
def _flown(
    position: tuple[float, ...],
    velocity: tuple[float, ...],
    coefficient: float,
    lag: float,
    phases: tuple[Phase, ...],
    t: bytes,
) -> np.ndarray:
    """`fly`, once for all cases of one flight: it takes most of their preparation."""
    track = fly(position, velocity, coefficient, lag, phases, np.frombuffer(t))
    track.flags.writeable = False
    return track


def plot_truth(case: Case, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """What plots are made of (K, 8): range, sine and cosine of elevation and azimuth, x, y, z. Raises ConfigError where
    the target leaves the antenna's sector."""
    sensor = case.spec.sensor
    position = x[:, 0::3]
    if sensor.sigma_range_m is None:
        return np.concatenate([np.zeros((len(t), 5)), position], axis=1)
    R = physics.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
    antenna = physics.to_antenna(position, R, sensor.antenna_height_m)
    r = np.linalg.norm(antenna, axis=1)
    outside = antenna[:, 0] <= r * np.sqrt(2 * strip.LEAST)
    if outside.any():
        when = t[np.argmax(outside)]
        raise ConfigError(
            f"{case.name}: target: leaves the antenna's sector at {when:.6g} s: it must stay in front of it"
        )
    s_e, s_a = antenna[:, 1] / r, antenna[:, 2] / r
    return np.stack([r, s_e, np.sqrt(1 - s_e**2), s_a, np.sqrt(1 - s_a**2), *position.T], axis=1)


def sensor_frame(sensor: Sensor) -> np.ndarray:
    """The numbers (n,) of a sensor as the kernels take them; see `strip.frame`."""
    R = physics.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
    form = records.BICONICAL if sensor.sigma_range_m is not None else records.CARTESIAN
    unbiased = sensor.conversion == "unbiased"
    return strip.frame(R, sensor.antenna_height_m, sensor.sigma, form, unbiased, sensor.detection_probability)


def intervals(t: np.ndarray, tolerance: float = 1e-9) -> tuple[np.ndarray, np.ndarray]:
    """For each scan the number of its interval since the last (K,), and the different intervals (U,), s."""
    steps = np.diff(t, prepend=t[0] - (t[1] - t[0]))
    rounded, index = np.unique(np.round(steps / tolerance), return_inverse=True)
    times = (
        np.array([steps[index == u].mean() for u in range(len(rounded))]) if len(rounded) < 50 else rounded * tolerance
    )
    return index.astype(np.int64), times


def local_plots(sensor: Sensor, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Recorded plots (n, 3) in the local frame: positions (n, 3), covariances (n, 6), and which are whole (n,). A plot
    counts where all three values are there and, of biconical ones, where it lies in front of the antenna."""
    whole, sigma = np.isfinite(measured).all(axis=1), np.array(sensor.sigma)
    z, R = np.zeros((len(measured), 3)), np.tile(np.eye(3), (len(measured), 1, 1))
    if sensor.sigma_range_m is None:
        z[whole], R[whole] = measured[whole], np.diag(sigma**2)
    else:
        sines = np.sin(np.where(whole[:, None], measured, 0.0)[:, 1:])
        narrow = np.abs(np.where(whole[:, None], measured, 0.0)[:, 1:]).sum(axis=1) < np.pi / 2
        whole &= narrow & (1 - (sines**2).sum(axis=1) > strip.LEAST)
        turn = physics.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
        seen = measured[whole]
        plain = sensor.conversion == "plain"
        antenna = physics.from_biconical(seen) if plain else physics.unbiased_from_biconical(seen, sigma)
        z[whole] = physics.to_local(antenna, turn, sensor.antenna_height_m)
        R[whole] = physics.plot_covariance(seen, sigma, turn)
    upper = np.triu_indices(3)
    return z, R[:, upper[0], upper[1]], whole
