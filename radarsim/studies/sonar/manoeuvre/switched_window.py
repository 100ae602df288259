"""Exact errors of a sliding window whose degree a detector switches.

The window is the one that the paper advises, of 5–6 plots; the detector is that of eq. (3).

At each scan there are the straight line and the parabola through the last m plots, and the acceleration of a parabola
through the last n. All three are linear in the plots, so that they are jointly Gaussian, and the mean square error of
the one that an alarm selects has a closed form. One coordinate, white errors, equal intervals, any course."""

from typing import NamedTuple

import numpy as np


class SwitchedWindow(NamedTuple):
    """σ (K,) of a straight line, of a parabola, and of the one of both that an alarm selects, through m plots."""

    line: np.ndarray
    parabola: np.ndarray
    switched: np.ndarray


def switched_window(
    course: np.ndarray, sigma: float, dt: float, memory: int, plots: int, threshold_k: float
) -> SwitchedWindow:
    """σ at every scan from the `memory`-th on, for the true values course (K,) and a detector of `plots` plots.

    There is an alarm if the squared acceleration exceeds k times its own variance. An alarm selects the parabola,
    otherwise the straight line is used."""
    line, parabola = (_last_value(memory, degree, dt) for degree in (1, 2))
    acceleration = np.zeros(memory)
    acceleration[memory - plots :] = _acceleration(plots, dt)
    windows = np.lib.stride_tricks.sliding_window_view(course, memory)
    truth = course[memory - 1 :]
    spread = sigma * np.linalg.norm(acceleration)
    limit = np.sqrt(threshold_k) * spread
    mean = windows @ acceleration
    low, high = (-limit - mean) / spread, (limit - mean) / spread
    squares = []
    for weights in (line, parabola):
        bias = windows @ weights - truth
        slope = float(sigma**2 * (weights @ acceleration) / spread)  # of the error on the acceleration, per σ of it
        residual_variance = float(sigma**2 * weights @ weights - slope**2)
        squares.append(
            (bias**2 + slope**2 + residual_variance, _mean_square_in_alarms(bias, slope, residual_variance, low, high))
        )
    (line_square, line_in_alarms), (parabola_square, parabola_in_alarms) = squares
    return SwitchedWindow(
        *(
            np.sqrt(mean_square)
            for mean_square in (line_square, parabola_square, line_square - line_in_alarms + parabola_in_alarms)
        )
    )


def _mean_square_in_alarms(
    bias: np.ndarray, slope: float, residual_variance: float, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """E e² over the realisations with an alarm, z < low or z > high; e = bias + slope z + an independent error."""
    from scipy.special import ndtr

    density_low, density_high = (np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) for z in (low, high))
    share = ndtr(low) + ndtr(-high)
    first = density_high - density_low
    second = share + high * density_high - low * density_low
    return (bias**2 + residual_variance) * share + 2 * bias * slope * first + slope**2 * second


def _last_value(plots: int, degree: int, dt: float) -> np.ndarray:
    """Weights (n,) of the value at the last plot of a polynomial through n plots."""
    powers = (dt * np.arange(1 - plots, 1))[:, None] ** np.arange(degree + 1)
    return np.linalg.pinv(powers)[0]


def _acceleration(plots: int, dt: float) -> np.ndarray:
    """Weights (n,) of the acceleration of a parabola through n plots."""
    powers = (dt * np.arange(1 - plots, 1))[:, None] ** np.arange(3)
    return 2 * np.linalg.pinv(powers)[2]
