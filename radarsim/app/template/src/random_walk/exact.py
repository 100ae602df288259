"""Exact values, known without sampling.

Yours: exact values where there are any; the tables show them beside the measured ones.
"""

import numpy as np


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
