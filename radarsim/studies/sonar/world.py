"""Labels and exact values of the sums of a sonar case; and those of cases whose filters know their plots.

The sonar's world (P3): correlated errors of plots, targets in polar and cartesian coordinates, and conversions.

Bearings are counted from the x axis (north) towards the y axis (east): x = r cos b, y = r sin b. A state of one
coordinate is (value, rate, acceleration). Times in s, ranges in m, angles in rad."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.engine.results import Axes
from radarsim.physics import polynomial


# ---- axes ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, kw_only=True)
class SonarAxes(Axes):
    """Labels of F filters over K scans in C coordinates."""

    coordinates: tuple[tuple[str, str], ...]  #: name and unit of each coordinate that the filters work in.
    sizes: np.ndarray  #: (F,) components of each filter's state in one coordinate, 2 or 3.
    #: (F, K, C) exact σ of the value extrapolated by one scan, in the row of the scan that it was extrapolated from,
    #: in the coordinate's unit; NaN where it is not known.
    exact_ahead: np.ndarray
    exact_nees: np.ndarray  #: (F, K, C) expected eᵀP⁻¹e of the complete state in a coordinate; NaN likewise.
    scan_period_s: float  #: period of the first sonar, s.
    sigma: np.ndarray  #: (C,) nominal standard deviation of a plot in each coordinate, in its unit.


@dataclass(frozen=True, kw_only=True)
class GivenPlotsAxes(SonarAxes):
    """Labels of cases whose filters have known association: smoothing, and manoeuvres."""

    rho: np.ndarray  #: (C,) correlation of the errors of neighbouring plots.
    sigma_of_plots: np.ndarray  #: (K, C) standard deviation of each plot, infinite where there never is a plot.
    #: mean error along the line of sight of the first plot converted to x and y, m; zero where it is not converted, or
    #: converted without bias.
    conversion_bias: float
    polar: np.ndarray  #: (K, C, 3) the target's range, bearing (and depth or elevation) with first and second rates.


# ---- world -----------------------------------------------------------------------------------------------------------
PLACED = 8  # plots in the mean position at which the covariance of the unbiased conversion is computed
Values = float | np.ndarray


# ---- errors of plots -------------------------------------------------------------------------------------------------
def correlation(rho: float, lags: np.ndarray) -> np.ndarray:
    """ρ to the power of the lags, in periods, an array of any shape (P3 eq. 15).

    A negative ρ has a meaning at whole periods only, so its lags are rounded."""
    if rho < 0:
        lags = np.rint(lags)
        return np.where(lags % 2 == 1, -1.0, 1.0) * np.abs(rho) ** lags
    return np.power(rho, lags) if rho > 0 else np.where(lags == 0, 1.0, 0.0)


def step_correlations(rho: float, t: np.ndarray, period: float) -> np.ndarray:
    """Correlation (K,) of the errors at t[k] and t[k - 1]; 0 at k = 0, and for white errors."""
    return np.concatenate([[0.0], correlation(rho, np.diff(t) / period)]) if rho else np.zeros(len(t))


def error_covariance(sigma: np.ndarray, rho: float, t: np.ndarray, period: float) -> np.ndarray:
    """Covariance (K, K) of the stationary errors of plots with standard deviations sigma (K,), in one coordinate."""
    C = np.outer(sigma, sigma) * correlation(rho, np.abs(t[:, None] - t[None, :]) / period)
    return C if rho else np.diag(np.diag(C))


# ---- targets ---------------------------------------------------------------------------------------------------------
def turning(
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


def accelerating(
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


def polynomials(coefficients: Sequence[Sequence[float]], t: np.ndarray) -> tuple[np.ndarray, ...]:
    """States (K, 3) of each coordinate from its derivatives at t = 0 (P3 eq. 1, with vᵢ = cᵢ / i!)."""
    return tuple(polynomial(c, t) for c in coefficients)


# ---- conversion ------------------------------------------------------------------------------------------------------
def converted(
    r: np.ndarray, b: np.ndarray, sigma_r: Values, sigma_b: Values
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Plain conversion: x, y and the linearised covariance (xx, xy, yy) of plots r, b; broadcasts.

    The mean of x and y is exp(-σ_b²/2) times the true value: see `conversion_bias`."""
    c, s = np.cos(b), np.sin(b)
    along, across = sigma_r**2 + 0 * r, (r * sigma_b) ** 2
    return r * c, r * s, (along * c**2 + across * s**2, (along - across) * c * s, along * s**2 + across * c**2)


def converted_unbiased(
    r: np.ndarray, b: np.ndarray, sigma_r: Values, sigma_b: Values
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Unbiased conversion exp(σ_b²/2) (r cos b, r sin b), and its covariance for a target at the plot's position.

    For independent Gaussian errors E cos(b + e) = exp(-σ²/2) cos b and E cos 2(b + e) = exp(-2σ²) cos 2b, which makes
    the factor exact and gives the second moments. Longbin, Xiaoquan, Yiyu, Kang and Bar-Shalom (1998) use the same
    identities."""
    c, s = np.cos(b), np.sin(b)
    grow, shrink = np.exp(sigma_b**2), np.exp(-2 * sigma_b**2)
    power = grow * (r**2 + sigma_r**2) / 2
    c2, s2 = shrink * np.cos(2 * b), shrink * np.sin(2 * b)
    covariance = power * (1 + c2) - (r * c) ** 2, power * s2 - r**2 * c * s, power * (1 - c2) - (r * s) ** 2
    return np.sqrt(grow) * r * c, np.sqrt(grow) * r * s, covariance


def places(r: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions at which the covariance of the unbiased conversion is computed; r and b (n,) are plots in order.

    Each is the running mean of up to `PLACED` earlier plots; for the first plot it is the plot itself. At the plot's
    own position the weight would be correlated with the error of the plot, and weighted estimates would be biased
    again. The mean of a few plots reduces this bias, the more plots the better."""
    out, mean, count = np.empty((2, len(r))), np.array([r[0], b[0]]), 0
    for k, plot in enumerate(np.stack([r, b], axis=1)):
        out[:, k] = mean if count else plot
        count = min(count + 1, PLACED)
        mean = mean + (plot - mean) / count
    return out[0], out[1]


def conversion_bias(r: Values, sigma_b: Values) -> Values:
    """Mean error of the plain conversion along the line of sight: (exp(-σ_b²/2) - 1) r, exact for Gaussian errors."""
    return np.expm1(-(sigma_b**2) / 2) * r
