"""Filters of P3 for one coordinate: the weights that each gives to plots at known times, computed once.

All recursive filters have one form. The innovation corrects the state (value, rate, acceleration) and, in filters that
model correlated errors, the carried error e of the last plot:

    innovation = z - (F x)₀ - c e        x⁺ = F x + g innovation        e⁺ = c e + g₃ innovation

A design is therefore its gains (M, K, 4), for M patterns of missed plots at once; a missed plot has gain zero.
Internally times are in periods T₀ and weights relative to the nominal plot, as in the paper; gains and covariances are
returned in m, s (or rad, s).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from radarsim.physics.motion import manoeuvre_covariance, transition
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

    def early(self, size: int) -> np.ndarray:
        """Where (M, K) there were plots at fewer than `size` times before, so that a filter is still starting."""
        return np.pad(self.moments(), ((0, 0), (1, 0)))[:, :-1] < size

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


def leading_inverse(Y: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """Inverses (M, 3, 3) of the leading blocks, of size rank (M,), of Y (M, 3, 3); zero outside the blocks.

    With few plots only a polynomial of lower degree is determined.
    """
    P = np.zeros_like(Y)
    for size in (1, 2, 3):
        chosen = rank == size
        if chosen.any():
            P[chosen, :size, :size] = np.linalg.inv(Y[chosen, :size, :size])
    return P


def _finished(plots: Plots, size: int, gain: np.ndarray, carry: np.ndarray, P: np.ndarray) -> Design:
    """Convert gains and covariances from periods and nominal weights to s and to m or rad."""
    scale = plots.period ** -np.arange(3.0)
    gain = gain * np.append(scale, 1.0)
    covariance = P * plots.sigma**2 * np.outer(scale, scale)
    return Design(size, gain, carry, covariance, plots.moments())


def line(plots: Plots) -> Design:
    """The paper's recursion (12)-(14) for a straight line, with any weights, intervals and missed plots.

    All sums start from zero. Over an interval τ, in periods, h becomes h + 2gτ + fτ² and g becomes g + fτ; then f
    increases by w and K by w h, and the gains are h w / K and g w / K. While K = 0, before the second plot, the
    estimate is the mean of the plots.
    """
    patterns, scans = plots.weight.shape
    gain, P = np.zeros((patterns, scans, 4)), np.zeros((patterns, scans, 3, 3))
    f, g, h, K = np.zeros((4, patterns))
    for k in range(scans):
        step, w = plots.step(k), plots.weight[:, k]
        h, g = h + 2 * g * step + f * step**2, g + f * step
        f, K = f + w, K + w * h
        lined, alone = K > 0, (K <= 0) & (f > 0)
        Psi = np.stack([np.stack([h, g], axis=1), np.stack([g, f], axis=1)], axis=1)
        P[lined, k, :2, :2] = Psi[lined] / K[lined, None, None]
        P[alone, k, 0, 0] = 1 / f[alone]
        gain[:, k, :2] = P[:, k, :2, 0] * w[:, None]
    return _finished(plots, 2, gain, np.zeros(scans), P)


def _information(plots: Plots, size: int, rho: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gains (M, K, 4), carry (K,) and covariance (M, K, 3, 3) of `differenced`, in periods and nominal weights."""
    patterns, scans = plots.weight.shape
    gain, P = np.zeros((patterns, scans, 4)), np.zeros((patterns, scans, 3, 3))
    carry = step_correlations(rho, plots.t, plots.period)
    rank = np.minimum(plots.moments(), size)
    Y, age, c = np.zeros((patterns, 3, 3)), np.zeros(patterns), np.zeros(patterns)
    for k in range(scans):
        step, w = plots.step(k), plots.weight[:, k]
        back = transition(-step)
        Y = back.T @ Y @ back
        age, c, seen = age + step, c * carry[k], w > 0
        row = np.array([1.0, 0.0, 0.0]) - c[:, None] * np.stack([np.ones(patterns), -age, age**2 / 2], axis=1)
        new = 1 - c * c  # a plot at the very time of the last one contains nothing new
        weight = np.where(new > 1e-12, w / np.maximum(new, 1e-12), 0.0)
        Y = Y + weight[:, None, None] * row[:, :, None] * row[:, None, :]
        P[:, k] = leading_inverse(Y, rank[:, k])
        gain[:, k, :3] = weight[:, None] * np.einsum("mij,mj->mi", P[:, k], row)
        gain[:, k, 3] = np.where((weight > 0) & (rho != 0), 1.0 - gain[:, k, 0], 0.0)
        age, c = np.where(seen, 0.0, age), np.where(seen, 1.0, c)
    return gain, carry, P


def differenced(plots: Plots, size: int, rho: float) -> Design:
    """Recursive least squares in information form, on the differences u_n - ρ^m u_{n-m}, or on the plots for ρ = 0.

    The first plot has its full weight. Each difference (after eq. 15) has the weight 1/(1 - ρ^2m) and the row
    H - ρ^m H F(-m) at the present state, where m is the interval since the last plot. With fewer plots than unknowns
    only the leading block is solved, for a polynomial of lower degree.
    """
    gain, carry, P = _information(plots, size, rho)
    return _finished(plots, size, gain, carry, P)


def _started_recursion(
    plots: Plots,
    size: int,
    manoeuvre_variance: float,
    start: int,
    updated: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
) -> Design:
    """A filter that starts as least squares on the first `start` plots and then predicts and updates at every scan.

    updated gives gain (M, size) and covariance (M, size, size) from the predicted covariance and the weight (M,) of the
    plot.
    """
    gain, carry, P = _information(plots, size, 0.0)
    variance, early = plots.scaled(manoeuvre_variance, size), plots.early(start)
    state = np.zeros((len(gain), size, size))
    for k in range(len(plots.t)):
        step = plots.step(k)
        F = transition(step, size)
        state = F @ state @ F.T + manoeuvre_covariance(variance, step, size)
        K, state = updated(state, plots.weight[:, k])
        gain[:, k, :size] = np.where(early[:, k, None], gain[:, k, :size], K)
        state = np.where(early[:, k, None, None], P[:, k, :size, :size], state)
        P[:, k, :size, :size] = state
    return _finished(plots, size, gain, carry, P)


def kalman(plots: Plots, size: int, manoeuvre_variance: float) -> Design:
    """Kalman-Bucy filter (11), started as least squares on the first `size` plots.

    manoeuvre_variance is that of a random derivative of order `size`, constant between scans: (m/s²)² for size 2.
    """

    def updated(state: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        K = state[:, :, 0] * (w / (1 + w * state[:, 0, 0]))[:, None]
        state = state - K[:, :, None] * state[:, None, 0, :]
        return K, (state + state.transpose(0, 2, 1)) / 2

    return _started_recursion(plots, size, manoeuvre_variance, size, updated)


def augmented(plots: Plots, size: int, rho: float, manoeuvre_variance: float) -> Design:
    """The Kalman filter of the state and the plot's error, the plot then being exact: H = [H | I].

    The paper's step 4 lacks a plus. The covariance is singular after every plot (H x + e is known). Where the
    innovation is singular too, for a plot at the very time of the last one, the plot contains nothing new and has gain
    zero. The filter starts as least squares on the first `size` plots.
    """
    gain, carry, P = _information(plots, size, rho)
    variance, early = plots.scaled(manoeuvre_variance, size), plots.early(size)
    state, F, Q = np.zeros((len(gain), size + 1, size + 1)), np.eye(size + 1), np.zeros((size + 1, size + 1))
    H = np.zeros(size + 1)
    H[0] = H[size] = 1.0
    for k in range(len(plots.t)):
        step, seen, begun = plots.step(k), plots.weight[:, k] > 0, early[:, k]
        F[:size, :size], F[size, size] = transition(step, size), carry[k]
        Q[:size, :size], Q[size, size] = manoeuvre_covariance(variance, step, size), 1 - carry[k] ** 2
        state = F @ state @ F.T + Q
        column = state @ H
        S = column @ H
        used = seen & (S > 1e-12)
        K = column * np.where(used, 1 / np.where(used, S, 1.0), 0.0)[:, None]
        left = np.eye(size + 1) - K[:, :, None] * H
        state = left @ state @ left.transpose(0, 2, 1)
        state[begun & seen] = _with_error(P[begun & seen, k, :size, :size])
        gain[~begun, k, :size], gain[~begun, k, 3] = K[~begun, :size], K[~begun, size]
        P[~begun, k, :size, :size] = state[~begun, :size, :size]
    return _finished(plots, size, gain, carry, P)


def _with_error(P: np.ndarray) -> np.ndarray:
    """Joint covariance of state and last plot's error from that of the state after a plot: e = z - H x exactly."""
    across = -P[:, :, :1]
    upper = np.concatenate([P, across], axis=2)
    lower = np.concatenate([across.transpose(0, 2, 1), P[:, :1, :1]], axis=2)
    return np.concatenate([upper, lower], axis=1)


def steady_gain(period: float, sigma: float, size: int, manoeuvre_variance: float) -> np.ndarray:
    """Steady-state gains (size,) of the Kalman filter: α, β/T₀ (and γ/T₀²), from the algebraic Riccati equation."""
    from scipy.linalg import solve_discrete_are

    F, H = transition(1.0, size), np.eye(size)[:, :1]
    Q = manoeuvre_covariance(manoeuvre_variance * period ** (2 * size) / sigma**2, 1.0, size)
    P = solve_discrete_are(F.T, H, Q, np.eye(1))
    return P[:, 0] / (1 + P[0, 0]) * period ** -np.arange(float(size))


def fixed_gain(plots: Plots, size: int, manoeuvre_variance: float, start: int = 0) -> Design:
    """The α-β(-γ) filter: least squares on the first plots, then the steady-state gains, and none at a missed plot.

    start is the number of these plots, at least `size`. After so few the steady-state gains, small as they are, take
    long to correct the first velocity. The covariance is that of the filter's own recursion under the manoeuvre
    variance.
    """
    settled = steady_gain(plots.period, plots.sigma, size, manoeuvre_variance) * plots.period ** np.arange(float(size))

    def updated(state: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        K = np.where((w > 0)[:, None], settled, 0.0)
        left = np.eye(size) - K[:, :, None] * np.eye(size)[0]
        noise = np.where(w > 0, 1 / np.where(w > 0, w, 1.0), 0.0)
        return K, left @ state @ left.transpose(0, 2, 1) + noise[:, None, None] * K[:, :, None] * K[:, None, :]

    return _started_recursion(plots, size, manoeuvre_variance, max(size, start), updated)


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
    P = leading_inverse(np.einsum("mn,ni,nj->mij", w, A, A), np.minimum(times, size))
    scale = plots.period ** -np.arange(3.0)
    weights = np.einsum("i,mij,nj,mn->min", scale, P, A, w)
    return first, weights, P * plots.sigma**2 * np.outer(scale, scale)
