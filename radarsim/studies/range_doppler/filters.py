"""The exact error recursion, of one filter or of B of them side by side.

Three things run together: P, the covariance that a filter believes, which gives its gains; S, the covariance of what
the noise of the plots puts into its error; and E, the C parts of the error that do not change from plot to plot. Column
0 is the mean error; each further column is what one drawn bias of unit variance leads to. So the second moment of the
error is S + E Eᵀ. The last columns belong to a random truth, by how its motion leaves that of the middle.

The world of P1: the true range of a target at the scans, and what is drawn of it for each realisation.

What is drawn is either the first range, velocity and acceleration of a polynomial, which a filter started by least
squares forgets; or where a flight in space begins, and how fast: then its accelerations stay what they are, but the
radar sees another motion in range.

Kalman filters of the second order whose gains do not depend on the data: designed once, applied N times.

The state is x = (r, V_r, a_r), a plot z = (range, radial velocity); a filter observes the range alone or both.

Why P1's gains come out as they do: the groups on which they depend, and their steady limit for fast scans.

With τ₁ = σ_r/σ_V and τ₂ = (σ_r²/D_M)^(1/6) a gain depends on k, C_θ = (τ₁/Δt)² and Λ = (Δt/τ₂)³ alone. As Δt → 0 the
plots become white noise of density σ_r²Δt and σ_V²Δt, the manoeuvre a white jerk of density D_M Δt, and what is left is
t/τ₁ and c = (τ₁/τ₂)². Derived in docs/chart.md, tested against the recursion.

Exact steady gains of many radars at once: the map of the chart, with the scan period in it.

Exact errors of a linear filter: its gains applied to the true plots' covariance, not to the one it believes.

When truth and model agree there is no manoeuvre, so the error covariance runs through the filter's own gains without
process noise; where the truth leaves the model, the mean error (dynamic error, bias) runs beside it."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from radarsim import physics
from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.kernels import algebra
from radarsim.physics import manoeuvre_covariance, process_noise, transition
from radarsim.studies.radial import checked_truth
from radarsim.studies.range_doppler.config import FlyBy, Flying, Keys, Recorded, Target, Turn


# ---- propagation -----------------------------------------------------------------------------------------------------
class Plots(NamedTuple):
    """What plots are: standard deviations sigma, mean errors bias, and standard deviations sigma_bias of the errors
    that are drawn once a realisation, each (2,) of range in m and velocity in m/s; the probability of detection; the
    number of columns of E for a random truth."""

    sigma: np.ndarray
    bias: np.ndarray = np.zeros(2)
    sigma_bias: np.ndarray = np.zeros(2)
    detection: float = 1.0
    of_truth: int = 0

    @property
    def inputs(self) -> np.ndarray:
        """What the plots add to the columns of E, (2, C): their mean error, and a column for each bias drawn."""
        random_biases = np.diag(self.sigma_bias)[:, self.sigma_bias > 0]
        return np.concatenate([self.bias[:, None], random_biases, np.zeros((2, self.of_truth))], axis=1)


class Errors(NamedTuple):
    """Errors at one scan: P and S packed, six numbers or arrays (B,) each; E three arrays (C, 1 or B), or numbers."""

    P: Any
    S: Any
    E: Any

    def second_moments(self) -> np.ndarray:
        """E e² of the components, (3,) or (3, B)."""
        return np.array([self.S[n] + (e**2).sum(axis=0) for n, e in zip((0, 3, 5), self.E, strict=True)])


def defects(x: np.ndarray, dt: float, plots: Plots, drawn: np.ndarray | None = None) -> np.ndarray:
    """F x − x⁺ of the truth x (K, 3) at every scan from the one before, for the columns of E: (K, 3, C).

    random_truth (K, 3, 1 + of_truth): beside x, the mean and the columns of a truth that is drawn; None: it is not."""
    defect = np.zeros((len(x), 3, plots.inputs.shape[1]))
    defect[1:, :, 0] = np.array(algebra.predicted(x[:-1].T, algebra.constant_acceleration(dt))).T - x[1:]
    if drawn is not None:
        defect[:, :, 0] += drawn[:, :, 0]
        defect[:, :, defect.shape[2] - plots.of_truth :] = drawn[:, :, 1:]
    return defect


def started(weights: np.ndarray, believed: np.ndarray, plots: Plots, defect: np.ndarray, dt: float) -> Errors:
    """Errors of a start that weighs plots, (3, 2, n), at the last of the n scans; defect as `defects` has it.

    believed (3, 3) is the covariance that the filter takes them to have."""
    S = np.einsum("ijk,j,ljk->il", weights, plots.sigma**2, weights)
    truth = np.zeros((weights.shape[2], 3, defect.shape[2]))
    for k in range(1, len(truth)):  # from zero, as the start forgets what a filter of the model can follow
        truth[k] = np.array(algebra.predicted(truth[k - 1], algebra.constant_acceleration(dt))) - defect[k]
    E = np.einsum("ijk,kjc->ic", weights, truth[:, :2]) - truth[-1] + weights.sum(axis=2) @ plots.inputs
    P, S = ([float(part) for part in algebra.pack(matrix)] for matrix in (believed, S))
    return Errors(P, S, E[:, :, None])


def scans(errors: Errors, observes: int, plots: Plots, Q: Any, defect: np.ndarray, dt: float) -> Iterator[Errors]:
    """The errors after each further scan, with its plot: numbers are taken one after the other, as their noises are
    independent. Q packed, of numbers or arrays (B,); defect (K, 3, C) of these scans."""
    (P, S, E), F = errors, algebra.constant_acceleration(dt)
    inputs: Any = plots.inputs[:, :, None]
    defects_of_scans: Any = defect[:, :, :, None]
    if has_plain_numbers := isinstance(Q[0], float) and E.size == 3:  # of plain numbers alone Python is faster
        E, inputs, defects_of_scans = E.ravel().tolist(), inputs.ravel().tolist(), defect.reshape(-1, 3).tolist()
    R, is_steady = [float(sigma) ** 2 for sigma in plots.sigma[:observes]], False
    gains: list[Any] = []
    add, forward = algebra.add_scaled.function, algebra.predicted.function  # a call less in each of many scans
    for scan_defect in defects_of_scans:
        E = add(forward(E, F), 1.0, scan_defect)
        if not is_steady:
            previous, gains = (P, S), []
            P, S = algebra.predicted_covariance(P, F, Q), algebra.predicted_covariance(S, F, algebra.NO_NOISE)
            for m in range(observes):
                P, gain, _ = algebra.TAKE[m](P, R[m], 1.0)
                S = algebra.CORRECT[m](S, R[m], gain)
                gains.append(gain)
            is_steady = has_plain_numbers and previous == (P, S)  # to the last bit, and so they stay
        for m, gain in enumerate(gains):
            E = add(E, inputs[m] - E[m], gain)
        yield Errors(P, S, E)


# ---- world -----------------------------------------------------------------------------------------------------------
APART = 6.0  # standard deviations of a drawn flight that its middle stays away from the radar
NODES = {2: 6, 3: 6, 4: 5, 6: 4}  # of the mean over so many numbers drawn, in each: to 1e-6 of what they add, at APART
DRAWN_SCANS = 300  # of a flight that is drawn: beyond, its exact errors are not given
KEPT_SHARE = 1e-10  # of the variance of what is drawn, that is left out
AT_ONCE = 256  # nodes


def scan_times(spec: Keys) -> np.ndarray:
    """Times (K,) of the scans, s from the first."""
    return np.arange(spec.plots) * spec.radar.scan_period_s


def sigma_flight(target: Target) -> np.ndarray:
    """Standard deviations (6,) with which x, y, z (m) and vx, vy, vz (m/s) at the first plot are drawn. Of a flight in
    a plane through the radar, within the plane."""
    if not isinstance(target, Flying):
        return np.zeros(6)
    axes = np.array([1.0, 1.0, 1.0 if isinstance(target, Recorded) else 0.0])
    return np.concatenate([target.sigma_position_m * axes, target.sigma_velocity_mps * axes])


def is_drawn(target: Target) -> bool:
    """Whether realisations have targets of their own."""
    return bool(sigma_flight(target).any())


def flight(target: Target, t: np.ndarray) -> np.ndarray:
    """States (K, 9) as (x, vx, ax, y, …) of the middle of a drawn flight, at times t (K,); (0, 9) where none is."""
    match target:
        case _ if not sigma_flight(target).any():
            return np.zeros((0, 9))
        case Turn():
            leg = target.range_m, target.speed_mps, target.aspect_rad
            return physics.turn_in_space(*leg, target.acceleration_g, target.start_s, target.duration_s, t)
        case FlyBy():
            return physics.fly_by_in_space(target.distance_m, target.speed_mps, target.start_range_m, t)
        case Recorded():
            return physics.smoothed(*physics.points(target.file), t)
    raise ValueError(f"no flight: {target.kind}")


def true_motion(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Times (K,) of the scans and the truth (K, 3) of a case, of a drawn one that of the middle. Raises ConfigError for
    a target that cannot be."""
    target, t = case.spec.target, scan_times(case.spec)
    x = checked_truth(target, t, case.name)
    spread = sigma_flight(target)
    min_range_m = np.hypot(np.max(spread[:3]), np.max(spread[3:]) * t) * APART
    if (x[:, 0] < min_range_m).any():
        k = int(np.argmax(x[:, 0] < min_range_m))
        fault = f"its random spread may reach the radar: at {t[k]:g} s it is {x[k, 0]:.4g} m away"
        raise ConfigError(f"{case.name}: target: {fault}, {APART:g} standard deviations are {min_range_m[k]:.4g} m")
    return t, x


def drawn_defects(target: Target, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """How the truth of realisations leaves the filters' model, beyond what the middle x (K, 3) does: (K, 3, 1 + C).

    At every scan F x − x⁺ from the scan before, whose first two moments are these: column 0 its mean, the others its
    covariance as the sum of their products. Not-a-number where the run is too long for it. One column of zeros where
    nothing is drawn that matters."""
    spread, path = sigma_flight(target), flight(target, t)
    scans = len(t)
    if not len(path):
        return np.zeros((scans, 3, 1))
    if scans > DRAWN_SCANS:
        return np.full((scans, 3, 1), np.nan)
    dt = float(t[1])
    unit = np.array([1.0, dt, dt**2])
    middle_defect = left(x[None], dt)[0]
    total, products = np.zeros(3 * scans), np.zeros((3 * scans, 3 * scans))
    for weights, shifts in displacements(spread):
        deviations = ((left(displaced(path, shifts, t), dt) - middle_defect) * unit).reshape(len(weights), -1)
        total += weights @ deviations
        products += deviations.T @ (weights[:, None] * deviations)
    variances, vectors = np.linalg.eigh(products - np.outer(total, total))
    is_relevant = variances > KEPT_SHARE * max(variances[-1], 0.0) / len(variances)
    columns = vectors[:, is_relevant][:, ::-1] * np.sqrt(variances[is_relevant][::-1])
    moments: np.ndarray = np.column_stack([total, columns]).reshape(scans, 3, -1) / unit[:, None]
    return moments


def left(x: np.ndarray, dt: float) -> np.ndarray:
    """F x − x⁺ of truths x (M, K, 3), at every scan from the one before; zero at the first."""
    defect: np.ndarray = np.zeros_like(x)
    defect[:, 1:] = x[:, :-1] @ transition(dt).T - x[:, 1:]
    return defect


def displacements(spread: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Weights (M,) and displacements (M, 6) whose weighted means are those over what is drawn, some at a time.
    Gauss–Hermite quadrature in each number that is drawn; spread (6,) are their standard deviations."""
    random_numbers = np.flatnonzero(spread)
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES[len(random_numbers)])
    points = np.stack(np.meshgrid(*[nodes] * len(random_numbers), indexing="ij"), axis=-1).reshape(
        -1, len(random_numbers)
    )
    point_weights = np.stack(np.meshgrid(*[weights / weights.sum()] * len(random_numbers), indexing="ij"), axis=-1)
    shifts = np.zeros((len(points), 6))
    shifts[:, random_numbers] = points * spread[random_numbers]
    weights_of_points = point_weights.reshape(-1, len(random_numbers)).prod(axis=1)
    bounds = [*range(0, len(weights_of_points), AT_ONCE), len(weights_of_points)]
    return [(weights_of_points[a:b], shifts[a:b]) for a, b in pairwise(bounds)]


def displaced(path: np.ndarray, shifts: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Range, radial velocity and acceleration (M, K, 3) of a flight (K, 9), displaced at first by shifts (M, 6)."""
    moves = shifts[:, None, 3:]
    position = path[:, 0::3] + shifts[:, None, :3] + moves * t[:, None]
    velocity, acceleration = path[:, 1::3] + moves, path[:, 2::3]
    r = np.sqrt((position**2).sum(axis=2))
    radial = (position * velocity).sum(axis=2) / r
    return np.stack([r, radial, ((velocity**2).sum(axis=2) + (position * acceleration).sum(axis=2) - radial**2) / r], 2)


# ---- filters ---------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class LinearFilter:
    """One designed filter over K scans."""

    observes: int  #: 1 (range) or 2 (range and velocity)
    start: int  #: scan, from 1, of the first least-squares estimate
    weights: np.ndarray  #: (3, 2, start) make it from the plots so far
    gains: np.ndarray  #: (K, 3, 2) zero up to the start
    believed: np.ndarray  #: (K, 3, 3) covariance that the filter claims
    available: np.ndarray  #: (K, 3) which components it estimates
    noise: tuple[float, ...]  #: its Q, packed
    given: bool = False  #: whether its gains are those of a package, not the Kalman filter's of this Q


def observation(observes: int) -> np.ndarray:
    """H of eq. (10): the first `observes` rows of the unit matrix, (observes, 3)."""
    return np.eye(3)[:observes]


def least_squares(times: np.ndarray, present: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Weighted least squares on plots at times (n,), s, as a state at time 0: weights (3, 2, n), covariance (3, 3).

    present (n, 2): which numbers there are; sigma (2,) holds the standard deviations of range (m) and radial velocity
    (m/s). None where they do not determine a state. Solved in scaled units (state per interval, rows per sigma) so that
    periods of milliseconds and of hours are equally well conditioned."""
    unit = max(float(np.ptp(times)), 1e-9) / max(len(times) - 1, 1)
    scale = np.array([1.0, 1.0 / unit, 1.0 / unit**2])
    A = np.concatenate([transition(t)[:2] * scale / sigma[:, None] for t in times])[present.ravel()]
    if np.linalg.matrix_rank(A) < 3:
        return None
    solution = scale[:, None] * np.linalg.pinv(A)
    weights = np.zeros((3, len(times), 2))
    weights[:, present] = solution
    return (weights / sigma).swapaxes(1, 2), solution @ solution.T


def least_squares_start(observes: int, start: int, sigma: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """As `least_squares`, on the first `start` scans, at the last of them: weights (3, 2, start), covariance (3, 3)."""
    present = np.broadcast_to(np.arange(2) < observes, (start, 2))
    solution = least_squares(dt * np.arange(1 - start, 1), present, sigma)
    if solution is None:
        raise ValueError("too few plots for a start")
    return solution


def noise_by_time(noise: str, manoeuvre_variance: float, period: float) -> np.ndarray:
    """Process noise over any time t, (2, 6) packed: Q_ij = a_ij t^(5 − i − j) + b_ij t^(6 − i − j), i and j from 0.
    What `physics.process_noise` adds over a scan period (s), for plots at uneven times: the jerk stays constant between
    two plots; white jerk keeps its density; of the acceleration's steps there are as many as periods."""
    coefficients = np.zeros((2, 6))
    noise_per_second = np.array(algebra.pack(process_noise(noise, manoeuvre_variance, 1.0)))
    coefficients[int(noise == "random_jerk")] = noise_per_second * (1.0 if noise == "random_jerk" else period)
    return coefficients


def design(
    observes: int,
    start: int,
    manoeuvre_variance: float,
    sigma: np.ndarray,
    dt: float,
    scans: int,
    noise: str = "random_jerk",
) -> LinearFilter:
    """The paper's filter: least squares on `start` scans, then eqs. (5), (9), (13) with M of eq. (6); sigma (2,).

    Before the start the estimates are the plots themselves: the range, and the velocity where it is observed. `noise`
    is the form of the process noise, see `physics.process_noise`."""
    F, Q = (
        algebra.constant_acceleration(dt),
        tuple(map(float, algebra.pack(process_noise(noise, manoeuvre_variance, dt)))),
    )
    R, present = tuple(map(float, sigma**2)), (True, observes == 2)
    weights, covariance = least_squares_start(observes, start, sigma, dt)
    gains, believed = np.zeros((scans, 3, 2)), np.zeros((scans, 6))
    available = np.ones((scans, 3), dtype=bool)
    available[: start - 1, observes:] = False
    believed[: start - 1, [0, 3][:observes]] = sigma[:observes] ** 2
    P = tuple(map(float, algebra.pack(covariance)))
    believed[start - 1] = P
    scans_after_start: list[tuple[float, ...]] = []
    while len(scans_after_start) < scans - start:
        previous = P
        P, range_gain, velocity_gain = updated(P, F, Q, R, present)
        scans_after_start.append(P + range_gain + velocity_gain)
        if previous == P:  # stationary to the last bit, and so it stays
            scans_after_start += [scans_after_start[-1]] * (scans - start - len(scans_after_start))
    designed_scans = np.array(scans_after_start).reshape(-1, 12)
    believed[start:], gains[start:] = designed_scans[:, :6], designed_scans[:, 6:].reshape(-1, 2, 3).swapaxes(1, 2)
    return LinearFilter(observes, start, weights, gains, algebra.unpack(believed.T), available, Q)


def updated(P: Any, F: Any, Q: Any, R: Any, present: Any) -> tuple[Any, Any, Any]:
    """A covariance after a scan, packed, and its gains (3,) on range and velocity where they are present; R (2,)."""
    P, range_gain, velocity_gain = algebra.predicted_covariance(P, F, Q), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if present[0]:
        P, range_gain, _ = algebra.take_value(P, R[0], 1.0)
    if present[1]:  # taken after the range, so that it moves what that makes of the estimate
        P, velocity_gain, _ = algebra.take_rate(P, R[1], 1.0)
        range_gain = algebra.add_scaled(range_gain, -range_gain[1], velocity_gain)
    return P, range_gain, velocity_gain


# ---- closed form -----------------------------------------------------------------------------------------------------
# Where Δt/τ₁ and Δt/τ₂ are at most SMALL and c at most LARGEST, gains with the first order of the period are within
# ERROR_POINTS of the recursion's, up to c of MODERATE within MODERATE_POINTS. As functions of c alone, without it, they
# are within LIMIT_POINTS. What grows with c is the error in acceleration: the fastest root, ~ √2 c^(1/4)/τ₂, is no
# longer slow against a scan.
SMALL, LARGEST, MODERATE = 0.05, 5e4, 1000.0
LIMIT_POINTS, ERROR_POINTS, MODERATE_POINTS = 0.55, 0.5, 0.11


class Groups(NamedTuple):
    """The dimensionless numbers on which the gains of a radar depend; c holds neither Δt."""

    C_theta: float
    Lambda: float
    c: float


def groups(sigma_range_m: float, sigma_velocity_mps: float, dt: float, manoeuvre_variance: float) -> Groups:
    """C_θ (11), Λ = √D_M Δt³/σ_r, and c = (σ_r/σ_V)² (D_M/σ_r²)^(1/3)."""
    memory = filter_memory(sigma_range_m, manoeuvre_variance)
    ratio = sigma_range_m / sigma_velocity_mps
    return Groups((ratio / dt) ** 2, (dt / memory) ** 3, (ratio / memory) ** 2)


def filter_memory(sigma_range_m: float, manoeuvre_variance: float) -> float:
    """τ₂ = (σ_r²/D_M)^(1/6), s."""
    return float((sigma_range_m**2 / manoeuvre_variance) ** (1 / 6))


def damping(c: np.ndarray | float) -> np.ndarray:
    """A, the greatest root of A⁴ − 8A = 4c for c ≥ 0, of any shape, to rounding (Newton's method from above)."""
    c = np.asarray(c, dtype=float)
    A = 2.0 + np.sqrt(2.0) * c**0.25
    for _ in range(60):
        A = A - (A**4 - 8 * A - 4 * c) / (4 * A**3 - 8)
    return A


def error_polynomial(c: float) -> np.ndarray:
    """Coefficients (4,), highest power first, of the limit filter's error in units of τ₂: s³ + As² + (A²/2)s + 1. Of
    range and velocity, c > 0, A is `damping`; of the range alone c = 0 and A = 2."""
    A = float(damping(c))
    return np.array([1.0, A, A**2 / 2, 1.0])


def believed(c: np.ndarray | float) -> np.ndarray:
    """Steady covariance (3, 3, …) that the limit filter believes, over σ_r² Δt/τ₂ and powers of τ₂: rational in A. The
    solution of the algebraic Riccati equation; derived in docs/chart.md."""
    A = damping(c)
    X = A**3
    W = X**2 - 8 * X + 8
    p11, p12, p13, p22 = 2 * A * (X - 4) / W, 4 * A**2 / W, 8 / W, 4 * (X - 2) / W
    p33 = p12 * p13 + A * (X - 8) / 4 * p22 * p11
    return np.array([[p11, p12, p13], [p12, p22, p11], [p13, p11, p33]])


def steady_gain(c: float) -> np.ndarray:
    """Gain (3, 2) of the limit filter on range and velocity, in units of σ_r and τ₂; c = 0: the second column is zero.
    The error that it leaves has the characteristic polynomial `error_polynomial`."""
    return believed(c)[:, :2] * np.array([1.0, c])


def noise_variances(c: np.ndarray | float, step: np.ndarray | float = 0.0) -> np.ndarray:
    """σ_r², σ_V², σ_a² (3, …) of the limit filter on a quadratic truth, over σ_r² Δt/τ₂ · (1, τ₂⁻², τ₂⁻⁴). Of the range
    alone, c = 0, they are 5/3, 3/2, 1/3. They are what the filter believes, less what the manoeuvre would add that such
    a truth has not. step is Δt/τ₂, to first order: half a scan of extrapolation."""
    A, P = damping(c), believed(c)
    X, p11 = A**3, P[0, 0]
    b, d = A**2 / 2 - A * (X - 8) / 4 * p11, X - 2
    range_variance = P[0, 0] - P[0, 2] ** 2 * A / d - step * (P[0, 1] - P[0, 2] * p11 * A / d)
    velocity_variance = P[1, 1] - (1 + p11**2 * A) / d - step * (P[1, 2] - (A - p11 + p11 * b * A) / d)
    return np.array([range_variance, velocity_variance, P[2, 2] - (1.5 * A**2 - 2 * b + b**2 * A) / d])


def steady_gains(c: np.ndarray | float, step: np.ndarray | float = 0.0) -> np.ndarray:
    """Relative gains (3, …) of range, velocity, acceleration by the velocity in the limit, %: functions of c alone.
    Within LIMIT_POINTS of the recursion up to SMALL and LARGEST; with the first order of the period, step = Δt/τ₂,
    within ERROR_POINTS."""
    with np.errstate(invalid="ignore"):
        return 100 * (1 - np.sqrt(noise_variances(c, step) / noise_variances(np.zeros_like(c, dtype=float), step)))


def no_acceleration_gain() -> float:
    """The c at which the gain in acceleration changes its sign, to rounding: below it the velocity costs accuracy."""
    low, high = 0.5, 1.0
    while (c := (low + high) / 2) not in (low, high):
        low, high = (c, high) if steady_gains(c)[2] < 0 else (low, c)
    return c


# ---- steady ----------------------------------------------------------------------------------------------------------
DOUBLINGS = 20  # a million scans: hundreds of memories where a memory has thousands


def exact_gains(C_theta: np.ndarray, Lambda: np.ndarray) -> np.ndarray:
    """Exact steady gains (3, n) in per cent of radars with these numbers (n,), their scan period in them."""
    base = errors_of_many(np.zeros_like(C_theta), Lambda)
    return 100 * (1 - np.sqrt(errors_of_many(C_theta, Lambda) / base))


def errors_of_many(C_theta: np.ndarray, Lambda: np.ndarray) -> np.ndarray:
    """Steady variances (3, n) of the filters of many radars at once, each in units of its own; C_θ = 0: range alone. As
    `steady_state`, by doubling: each round of the Riccati equation's iteration does as many scans as all before
    (Anderson, Int. J. Control 28, 1978, 295-306), and so does each of the sum of what the noise leaves."""
    n, time_unit = len(Lambda), np.maximum(1.0, Lambda ** (-1 / 3))  # time in memories τ₂, where longer than a scan
    F = np.stack([transition(1 / u) for u in time_unit])
    Q = np.stack(
        [manoeuvre_covariance(noise_index**2 * u**6, 1 / u) for noise_index, u in zip(Lambda, time_unit, strict=True)]
    )
    information = np.zeros((n, 3, 3))  # HᵀR⁻¹H
    information[:, 0, 0], information[:, 1, 1] = 1.0, C_theta / time_unit**2
    P, A, G = Q, F.transpose(0, 2, 1), information
    for _ in range(DOUBLINGS):
        W = np.linalg.inv(np.eye(3) + G @ P)
        P, A, G = (P + A.transpose(0, 2, 1) @ P @ W @ A, A @ W @ A, G + A @ W @ G @ A.transpose(0, 2, 1))
    I_minus_KH = np.linalg.inv(np.eye(3) + P @ information)  # I − KH
    believed = I_minus_KH @ P
    S, M = believed @ information @ believed.transpose(0, 2, 1), I_minus_KH @ F  # K R Kᵀ, with K = believed HᵀR⁻¹
    for _ in range(DOUBLINGS):
        S, M = S + M @ S @ M.transpose(0, 2, 1), M @ M
    return np.diagonal(S, axis1=1, axis2=2).T


# ---- exact -----------------------------------------------------------------------------------------------------------
def error_recursion(
    filter_: LinearFilter, plots: Plots, truth: np.ndarray, dt: float, random_truth: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Lasting errors E (K, 3, C) and covariance S (K, 3, 3) due to noise, at every scan of a truth (K, 3).

    random_truth: see `defects`. Before the start the estimates are the plots."""
    defect, observes, start_index = defects(truth, dt, plots, random_truth), filter_.observes, filter_.start - 1
    E, S = np.zeros_like(defect), np.zeros((len(truth), 6))
    E[:start_index, :observes], S[:start_index, 0] = plots.inputs[:observes], plots.sigma[0] ** 2
    S[:start_index, 3] = plots.sigma[1] ** 2 if observes > 1 else 0.0
    start = started(filter_.weights, filter_.believed[start_index], plots, defect, dt)
    E[start_index], S[start_index] = start.E[:, :, 0], start.S
    later_errors = list(scans(start, observes, plots, filter_.noise, defect[filter_.start :], dt))
    if later_errors:
        E[filter_.start :] = np.array([errors.E for errors in later_errors]).reshape(len(later_errors), 3, -1)
        S[filter_.start :] = [errors.S for errors in later_errors]
    return E, algebra.unpack(S.T)


def steady_state(
    observes: int, manoeuvre_variance: float, sigma: np.ndarray, dt: float, noise: str = "random_jerk"
) -> tuple[np.ndarray, np.ndarray]:
    """Steady covariances (3, 3): the one the filter believes, and the true one on a truth without manoeuvre. The
    believed one solves the discrete algebraic Riccati equation; the true one is the fixed point of the error recursion
    under the steady gain (a Lyapunov equation)."""
    from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

    # Time counted in the filter's own memory, (σ_r²/D_M)^(1/6), where longer than a scan: then no state is tiny.
    unit = max(dt, (sigma[0] ** 2 / manoeuvre_variance) ** (1 / 6))
    scale = sigma[0] * np.array([1.0, 1.0 / unit, 1.0 / unit**2])
    step = dt / unit
    F, H = transition(step), np.eye(3)[:observes]
    R = np.diag((sigma / scale[:2])[:observes] ** 2)
    Q = process_noise(noise, manoeuvre_variance * unit**6 / sigma[0] ** 2, step)
    extrapolated = solve_discrete_are(F.T, H.T, Q, R)
    K = np.linalg.solve(H @ extrapolated @ H.T + R, H @ extrapolated).T
    I_minus_KH = np.eye(3) - K @ H
    believed = I_minus_KH @ extrapolated @ I_minus_KH.T + K @ R @ K.T
    true = solve_discrete_lyapunov(I_minus_KH @ F, K @ R @ K.T)
    to_units = np.outer(scale, scale)
    return believed * to_units, true * to_units


def normalised_error(
    believed: np.ndarray, bias: np.ndarray, moment: np.ndarray, available: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of eᵀP⁻¹e per estimated component (…,) of a Gaussian error e; not-a-number without components
    and where P is singular.

    believed (…, 3, 3) is P, bias (…, 3) the mean m of e, moment (…, 3, 3) its second moment M = E eeᵀ, available
    (…, 3) the components of e that there are. The mean is tr P⁻¹M, the variance 2 tr (P⁻¹M)² - 2 (mᵀP⁻¹m)²."""
    spread = np.diagonal(believed, axis1=-2, axis2=-1)
    scale = np.where(spread > 0, spread, np.inf) ** -0.5  # m, m/s and m/s² brought to one size before solving
    unit = scale[..., :, None] * scale[..., None, :]
    mean, variance = np.full(available.shape[:-1], np.nan), np.full(available.shape[:-1], np.nan)
    for pattern in np.unique(available.reshape(-1, 3), axis=0):
        components, has_pattern = np.flatnonzero(pattern), np.all(available == pattern, axis=-1)
        if components.size:
            P, M = ((part * unit)[has_pattern][:, components][:, :, components] for part in (believed, moment))
            m = (bias * scale)[has_pattern][:, components, None]
            P[np.linalg.slogdet(P).sign == 0] = np.nan  # of a filter that diverges, by rounding; solve would raise
            ratio = np.linalg.solve(P, M)
            shift = (m * np.linalg.solve(P, m)).sum(axis=(1, 2))
            mean[has_pattern] = np.trace(ratio, axis1=1, axis2=2) / components.size
            variance[has_pattern] = 2 * (np.einsum("nij,nji->n", ratio, ratio) - shift**2) / components.size**2
    return mean, variance
