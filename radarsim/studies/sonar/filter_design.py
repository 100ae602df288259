"""Design of filters for one coordinate: the weights that each gives to plots at known times.

All recursive filters have one form. The innovation corrects the state (value, rate, acceleration) and, in filters that
model correlated errors, the carried error e of the last plot:

    innovation = z - (F x)₀ - c e        x⁺ = F x + g innovation        e⁺ = c e + g₃ innovation

A design is therefore its gains (M, K, 4), for M patterns of missed plots at once; a missed plot has gain zero.
Internally times are in periods T₀ and weights relative to the nominal plot, as in the paper; gains and covariances are
returned in m, s (or rad, s)."""

from dataclasses import dataclass

import numpy as np

from radarsim.kernels.kalman_algebra import pack, unpack
from radarsim.physics.motion import manoeuvre_covariance, transition
from radarsim.studies.sonar.detector_arrays import AdaptiveRule, ModelPair
from radarsim.studies.sonar.kernels import kalman, least_squares, normal_equations
from radarsim.studies.sonar.plot_errors import step_correlations


@dataclass(frozen=True)
class Plots:
    """Times and weights of the plots of one coordinate, for M patterns of missed plots."""

    t: np.ndarray  #: (K,) in s
    weight: np.ndarray  #: (M, K) (sigma / σ of the plot)², zero where it is missed
    period: float  #: T₀ in s, in which lags of the correlation are counted too
    sigma: float  #: of a nominal plot

    def step(self, k: int) -> float:
        """The interval before scan k, in periods."""
        return (self.t[k] - self.t[k - 1]) / self.period if k else 0.0

    def moments(self) -> np.ndarray:
        """The number (M, K) of distinct times of plots so far: as many coefficients of a polynomial are determined."""
        fresh, last = self.weight > 0, np.full(len(self.weight), -np.inf)
        for k, time in enumerate(self.t):
            last, fresh[:, k] = np.where(fresh[:, k], time, last), fresh[:, k] & (time > last)
        return np.cumsum(fresh, axis=1)

    def scaled(self, manoeuvre_variance: float, size: int) -> float:
        """A manoeuvre variance in units of the variance of a nominal plot and of the period."""
        return manoeuvre_variance * self.period ** (2 * size) / self.sigma**2


@dataclass(frozen=True)
class RecursionDesign:
    """A recursive filter: gain (M, K, 4), carry (K,), covariance (M, K, 3, 3), times of plots so far (M, K)."""

    size: int
    gain: np.ndarray
    carry: np.ndarray
    covariance: np.ndarray
    plots: np.ndarray


def design_recursion(
    plots: Plots,
    size: int,
    rho: float = 0.0,
    manoeuvre_variance: float | None = None,
    start: int = 0,
    fixed: tuple[float, float, float] = kalman.KALMAN_GAIN,
) -> RecursionDesign:
    """A recursive filter, by the formulas of the kernels, for all patterns of plots at once.

    Without a manoeuvre variance it is least squares in information form: on the differences u_n - ρ^m u_{n-m} of plots
    (`least_squares.least_squares`), which for ρ = 0 are the plots and for size 2 the paper's recursion (12)-(14). With
    one it starts so, on the first plots (`size`, or `start` if that is more), and goes on as a Kalman-Bucy filter (11)
    of the state and, for ρ other than 0, of the plot's error, the plot then being exact (`steps.kalman`); with `fixed`
    gains (3,), in periods, if any are given. manoeuvre_variance is that of a random derivative of order `size`,
    constant between scans: (m/s²)² for size 2."""
    patterns, scans = plots.weight.shape
    gain, P = np.zeros((patterns, scans, 4)), np.zeros((patterns, scans, 3, 3))
    carry, times = step_correlations(rho, plots.t, plots.period), plots.moments()
    previous_count = zero = np.zeros(patterns)
    Y, J = (zero,) * 8, (zero,) * 10
    variance = plots.scaled(manoeuvre_variance or 0.0, size)
    with np.errstate(divide="ignore", invalid="ignore"):  # of choices that are not taken
        for k in range(scans):
            w, step = plots.weight[:, k], plots.step(k)
            Y, K, packed = least_squares.least_squares(Y, times[:, k] - (w > 0), w, step, carry[k], size)
            if manoeuvre_variance is not None:
                model = kalman.Model(size, max(size, start), carry[k], variance, fixed)
                J, K, packed = kalman.kalman(J, (K, packed), previous_count, w, step, model)
            gain[:, k], P[:, k], previous_count = np.stack(K, axis=1), unpack(packed), times[:, k]
    scale = plots.period ** -np.arange(3.0)
    covariance = P * plots.sigma**2 * np.outer(scale, scale)
    return RecursionDesign(size, gain * np.append(scale, 1.0), carry, covariance, plots.moments())


def steady_gain(period: float, sigma: float, size: int, manoeuvre_variance: float) -> tuple[float, float, float]:
    """Steady-state gains (3,) of the Kalman filter, α, β and γ (0 for size 2), from the algebraic Riccati equation."""
    from scipy.linalg import solve_discrete_are

    F, H = transition(1.0, size), np.eye(size)[:, :1]
    Q = manoeuvre_covariance(manoeuvre_variance * period ** (2 * size) / sigma**2, 1.0, size)
    P = solve_discrete_are(F.T, H, Q, np.eye(1))
    alpha, beta, *gamma = P[:, 0] / (1 + P[0, 0])
    return alpha, beta, gamma[0] if gamma else 0.0


def window_weights(plots: Plots, k: int, length: int, size: int) -> tuple[int, np.ndarray, np.ndarray]:
    """Least squares on the last `length` plots up to scan k, extrapolated to k where k itself is missed.

    Returns the first scan of the window, the weights (M, 3, n) of the plots from there on, and the covariance (M, 3,
    3)."""
    is_detected = plots.weight[:, : k + 1] > 0
    count = np.cumsum(is_detected, axis=1)
    inside = is_detected & (count > count[:, -1:] - length)
    first = int(np.argmax(inside.any(axis=0))) if inside.any() else k
    w = np.where(inside, plots.weight[:, : k + 1], 0.0)[:, first:]
    since = (plots.t[first : k + 1] - plots.t[k]) / plots.period
    A = np.stack([np.ones_like(since), since, since**2 / 2], axis=1)
    times = Plots(plots.t[first : k + 1], w, plots.period, plots.sigma).moments()[:, -1]
    with np.errstate(divide="ignore", invalid="ignore"):
        P = unpack(normal_equations.leading_inverse(pack(np.einsum("mn,ni,nj->mij", w, A, A)), np.minimum(times, size)))
    P[~np.isfinite(P).all(axis=(1, 2))] = 0.0  # weights so unequal that one plot alone counts: no rate is known
    scale = plots.period ** -np.arange(3.0)
    weights = np.einsum("i,mij,nj,mn->min", scale, P, A, w)
    return first, weights, P * plots.sigma**2 * np.outer(scale, scale)


@dataclass(frozen=True)
class FilterSpec:
    """A configured filter."""

    kind: str
    size: int  #: of the state
    length: int  #: in plots of a window, of a least-squares start or of a test
    variance: np.ndarray  #: (C,) of a manoeuvre in each coordinate
    rho: np.ndarray  #: (C,) correlation in each coordinate
    response: AdaptiveRule | ModelPair | None = None  #: the rule or the models of a filter that responds to manoeuvres


def recursive_design(spec: FilterSpec, c: int, plots: Plots) -> RecursionDesign:
    """The design of a recursive filter for coordinate c."""
    size, variance = spec.size, spec.variance[c]
    match spec.kind:
        case "growing_memory":
            return design_recursion(plots, size)
        case "kalman_differenced":
            return design_recursion(plots, size, spec.rho[c])
        case "kalman":
            return design_recursion(plots, size, 0.0, variance)
        case "kalman_augmented":
            return design_recursion(plots, size, spec.rho[c], variance)
        case "fixed_gain":
            steady_gains = steady_gain(plots.period, plots.sigma, size, variance)
            return design_recursion(plots, size, 0.0, variance, spec.length, steady_gains)
    raise ValueError(f"not a recursive filter: {spec.kind}")


@dataclass(frozen=True)
class FilterDesign:
    """A filter designed for the plots of one coordinate."""

    spec: FilterSpec
    plots: Plots
    covariance: np.ndarray  #: (M, K, 3, 3) that it believes for M patterns of plots
    recursion: RecursionDesign | None = None
    #: of a window, at every scan: the first scan in it and the weights (M, 3, n) of the plots from there on
    window_rows: tuple[tuple[int, np.ndarray], ...] = ()

    @property
    def estimated_sizes(self) -> np.ndarray:
        """The number (M, K) of estimated components: plots at a single time determine a value but no rate."""
        return (np.diagonal(self.covariance, axis1=2, axis2=3) > 0).sum(axis=2)


def design_filter(spec: FilterSpec, c: int, plots: Plots) -> FilterDesign:
    """Design a filter for the plots of coordinate c."""
    if spec.kind != "window":
        design = recursive_design(spec, c, plots)
        return FilterDesign(spec, plots, design.covariance, design)
    rows = [window_weights(plots, k, spec.length, spec.size) for k in range(len(plots.t))]
    covariance = np.stack([P for _, _, P in rows], axis=1)
    return FilterDesign(spec, plots, covariance, window_rows=tuple((first, weights) for first, weights, _ in rows))


def apply_filter(spec: FilterSpec, c: int, plots: Plots, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Estimates (n, 3) and covariances (n, 3, 3) from recorded plots z (n,), arbitrary where the weight is zero."""
    design, x = design_filter(spec, c, plots), np.zeros((len(plots.t), 3))
    for k, (first, weights) in enumerate(design.window_rows):
        x[k] = weights[0] @ z[first : k + 1]
    if design.recursion is not None:
        carry, gain = design.recursion.carry, design.recursion.gain[0]
        state, e = np.zeros(3), 0.0
        for k, dt in enumerate(np.diff(plots.t, prepend=plots.t[0])):
            state, e = transition(dt) @ state, carry[k] * e
            innovation = z[k] - state[0] - e
            state, e = state + gain[k, :3] * innovation, e + gain[k, 3] * innovation
            x[k] = state
    return x, design.covariance[0]
