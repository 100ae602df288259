"""From the keys of a filter to the gains that the kernel reads, and what is known exactly: NumPy, once for each case.

The state is the position x; x⁺ = x + w with w of variance q = step², a plot is z = x + v with v of variance R = sigma².
"""

import numpy as np

from random_walk import config


def design(options: config.Filter, sigma: float, step: float, scans: int) -> np.ndarray:
    """The gains K (scans,) of a filter, the first of which takes the first plot as it is. sigma and step in m."""
    # Yours: a line for each kind of filter. Gains that depend on the data belong in the kernel.
    match options.kind:
        case "kalman":
            return kalman_gains(sigma, step, scans)
        case "fixed_gain":
            return np.concatenate([[1.0], np.full(scans - 1, options.gain)])
    raise ValueError(f"no such filter: {options.kind}")


def kalman_gains(sigma: float, step: float, scans: int) -> np.ndarray:
    """K = P / (P + R) with the predicted variance P = (1 - K) P + q (Bar-Shalom et al. 2001, section 5.2); (scans,)."""
    gains, P = np.ones(scans), sigma**2
    for k in range(1, scans):
        P += step**2
        gains[k] = P / (P + sigma**2)
        P *= 1 - gains[k]
    return gains


# Yours: exact values where there are any; the tables show them beside the measured ones.
def error_variance(gains: np.ndarray, sigma: float, step: float) -> np.ndarray:
    """Variance of the error of a filter with these gains (K,) after each scan, (K,); sigma and step in m.

    The error is e⁺ = (1 - K)(e - w) + K v, so S⁺ = (1 - K)² (S + q) + K² R, whether or not the gains are optimal.
    """
    variance, S = np.empty(len(gains)), 0.0
    for k, K in enumerate(gains):
        S = (1 - K) ** 2 * (S + step**2) + K**2 * sigma**2
        variance[k] = S
    return variance


def steady_variance(gain: float, sigma: float, step: float) -> float:
    """The fixed point of that recursion under a constant gain."""
    kept = (1 - gain) ** 2
    return (kept * step**2 + gain**2 * sigma**2) / (1 - kept)
