"""Conversion of polar plots to cartesian ones, plain and unbiased, and the bias of the plain one."""

import numpy as np

PLACED = 8  # plots in the mean position at which the covariance of the unbiased conversion is computed
Values = float | np.ndarray


def convert_plainly(
    r: np.ndarray, b: np.ndarray, sigma_r: Values, sigma_b: Values
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Plain conversion: x, y and the linearised covariance (xx, xy, yy) of plots r, b; broadcasts.

    The mean of x and y is exp(-σ_b²/2) times the true value: see `conversion_bias`."""
    c, s = np.cos(b), np.sin(b)
    along, across = sigma_r**2 + 0 * r, (r * sigma_b) ** 2
    return r * c, r * s, (along * c**2 + across * s**2, (along - across) * c * s, along * s**2 + across * c**2)


def convert_unbiased(
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


def weighting_positions(r: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
