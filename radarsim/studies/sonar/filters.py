"""Filters of P3 for one coordinate: the weights that each gives to plots at known times, computed once.

All recursive filters have one form. The innovation corrects the state (value, rate, acceleration) and, in filters that
model correlated errors, the carried error e of the last plot:

    innovation = z - (F x)₀ - c e        x⁺ = F x + g innovation        e⁺ = c e + g₃ innovation

A design is therefore its gains (M, K, 4), for M patterns of missed plots at once; a missed plot has gain zero.
Internally times are in periods T₀ and weights relative to the nominal plot, as in the paper; gains and covariances are
returned in m, s (or rad, s).
"""

from dataclasses import dataclass

import numpy as np

from radarsim.kernels.algebra import pack, unpack
from radarsim.physics.motion import manoeuvre_covariance, transition
from radarsim.studies.sonar.kernels import steps
from radarsim.studies.sonar.world import step_correlations


@dataclass(frozen=True)
class Plots:
    """Times and weights of the plots of one coordinate, for M patterns of missed plots.

    t (K,) in s; weight (M, K) = (sigma / σ of the plot)², zero where it is missed; period T₀ in s, in which lags of the
    correlation are counted too; sigma of a nominal plot.
    """

    t: np.ndarray
    weight: np.ndarray
    period: float
    sigma: float

    def step(self, k: int) -> float:
        """The interval before scan k, in periods."""
        return (self.t[k] - self.t[k - 1]) / self.period if k else 0.0

    def moments(self) -> np.ndarray:
        """The number (M, K) of distinct times of plots so far: as many unknowns of a polynomial can be determined."""
        fresh, last = self.weight > 0, np.full(len(self.weight), -np.inf)
        for k, time in enumerate(self.t):
            last, fresh[:, k] = np.where(fresh[:, k], time, last), fresh[:, k] & (time > last)
        return np.cumsum(fresh, axis=1)

    def scaled(self, manoeuvre_variance: float, size: int) -> float:
        """A manoeuvre variance in units of the variance of a nominal plot and of the period."""
        return manoeuvre_variance * self.period ** (2 * size) / self.sigma**2


@dataclass(frozen=True)
class Design:
    """A recursive filter: gain (M, K, 4), carry (K,), covariance (M, K, 3, 3), times of plots so far (M, K)."""

    size: int
    gain: np.ndarray
    carry: np.ndarray
    covariance: np.ndarray
    plots: np.ndarray


def recursive(
    plots: Plots,
    size: int,
    rho: float = 0.0,
    manoeuvre_variance: float | None = None,
    start: int = 0,
    fixed: tuple[float, float, float] = steps.KALMAN_GAIN,
) -> Design:
    """A recursive filter, by the formulas of the kernels, for all patterns of plots at once.

    Without a manoeuvre variance it is least squares in information form: on the differences u_n - ρ^m u_{n-m} of plots
    (`steps.least_squares`), which for ρ = 0 are the plots and for size 2 the paper's recursion (12)-(14). Else it
    starts so, on the first plots (`size`, or `start` if that is more), and goes on as a Kalman-Bucy filter (11) of the
    state and, for ρ other than 0, of the plot's error, the plot then being exact (`steps.kalman`); with `fixed` gains
    (3,), in periods, if any are given. manoeuvre_variance is that of a random derivative of order `size`, constant
    between scans: (m/s²)² for size 2.
    """
    patterns, scans = plots.weight.shape
    gain, P = np.zeros((patterns, scans, 4)), np.zeros((patterns, scans, 3, 3))
    carry, times = step_correlations(rho, plots.t, plots.period), plots.moments()
    before = zero = np.zeros(patterns)
    Y, J = (zero,) * 8, (zero,) * 10
    variance = plots.scaled(manoeuvre_variance or 0.0, size)
    with np.errstate(divide="ignore", invalid="ignore"):  # of choices that are not taken
        for k in range(scans):
            w, step = plots.weight[:, k], plots.step(k)
            Y, K, packed = steps.least_squares(Y, times[:, k] - (w > 0), w, step, carry[k], size)
            if manoeuvre_variance is not None:
                model = steps.Model(size, max(size, start), carry[k], variance, fixed)
                J, K, packed = steps.kalman(J, (K, packed), before, w, step, model)
            gain[:, k], P[:, k], before = np.stack(K, axis=1), unpack(packed), times[:, k]
    scale = plots.period ** -np.arange(3.0)
    covariance = P * plots.sigma**2 * np.outer(scale, scale)
    return Design(size, gain * np.append(scale, 1.0), carry, covariance, plots.moments())


def settled_gain(period: float, sigma: float, size: int, manoeuvre_variance: float) -> tuple[float, float, float]:
    """Steady-state gains (3,) of the Kalman filter, α, β and γ (0 for size 2), from the algebraic Riccati equation."""
    from scipy.linalg import solve_discrete_are

    F, H = transition(1.0, size), np.eye(size)[:, :1]
    Q = manoeuvre_covariance(manoeuvre_variance * period ** (2 * size) / sigma**2, 1.0, size)
    P = solve_discrete_are(F.T, H, Q, np.eye(1))
    alpha, beta, *gamma = P[:, 0] / (1 + P[0, 0])
    return alpha, beta, gamma[0] if gamma else 0.0


def window_weights(plots: Plots, k: int, length: int, size: int) -> tuple[int, np.ndarray, np.ndarray]:
    """Least squares on the last `length` plots up to scan k, extrapolated to k where k itself is missed.

    Returns the first scan of the window, the weights (M, 3, n) of the plots from there on, and the covariance
    (M, 3, 3).
    """
    seen = plots.weight[:, : k + 1] > 0
    count = np.cumsum(seen, axis=1)
    inside = seen & (count > count[:, -1:] - length)
    first = int(np.argmax(inside.any(axis=0))) if inside.any() else k
    w = np.where(inside, plots.weight[:, : k + 1], 0.0)[:, first:]
    since = (plots.t[first : k + 1] - plots.t[k]) / plots.period
    A = np.stack([np.ones_like(since), since, since**2 / 2], axis=1)
    times = Plots(plots.t[first : k + 1], w, plots.period, plots.sigma).moments()[:, -1]
    P = unpack(steps.leading_inverse(pack(np.einsum("mn,ni,nj->mij", w, A, A)), np.minimum(times, size)))
    scale = plots.period ** -np.arange(3.0)
    weights = np.einsum("i,mij,nj,mn->min", scale, P, A, w)
    return first, weights, P * plots.sigma**2 * np.outer(scale, scale)
