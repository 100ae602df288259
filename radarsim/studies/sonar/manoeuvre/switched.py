"""The degree of a sliding window switched by the detector (3), exactly: the window that the paper advises, 5–6 plots.

At each scan the straight line and the parabola through the last m plots are at hand, and the acceleration of a parabola
through the last n. All three are linear in the plots, so that they are jointly Gaussian, and the mean square error of
the one that an alarm picks has a closed form. One coordinate, white errors, equal intervals, any course.
"""

from typing import NamedTuple

import numpy as np


class Switched(NamedTuple):
    """σ (K,) of the straight line held, of the parabola held, and of the one that the alarm picks, m plots each."""

    line: np.ndarray
    parabola: np.ndarray
    switched: np.ndarray


def switched_window(
    course: np.ndarray, sigma: float, dt: float, memory: int, plots: int, threshold_k: float
) -> Switched:
    """σ at every scan from the `memory`-th on: course (K,) are the true values, plots those of the detector.

    An alarm is a squared acceleration of over k times its own variance; with it the parabola is taken, without it the
    straight line.
    """
    line, parabola = (_last_value(memory, degree, dt) for degree in (1, 2))
    acceleration = np.zeros(memory)
    acceleration[memory - plots :] = _acceleration(plots, dt)
    windows = np.lib.stride_tricks.sliding_window_view(course, memory)
    truth = course[memory - 1 :]
    spread = sigma * np.linalg.norm(acceleration)
    ends = np.sqrt(threshold_k) * spread
    mean = windows @ acceleration
    low, high = (-ends - mean) / spread, (ends - mean) / spread
    squares = []
    for weights in (line, parabola):
        bias = windows @ weights - truth
        slope = float(sigma**2 * (weights @ acceleration) / spread)  # of the error on the acceleration, per σ of it
        rest = float(sigma**2 * weights @ weights - slope**2)
        squares.append((bias**2 + slope**2 + rest, _outside(bias, slope, rest, low, high)))
    (whole_line, alarmed_line), (whole_parabola, alarmed) = squares
    return Switched(*(np.sqrt(each) for each in (whole_line, whole_parabola, whole_line - alarmed_line + alarmed)))


def _outside(bias: np.ndarray, slope: float, rest: float, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """E e² over the realisations with an alarm, z < low or z > high, where e = bias + slope z + an independent rest."""
    from scipy.special import ndtr

    density_low, density_high = (np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) for z in (low, high))
    share = ndtr(low) + ndtr(-high)
    first = density_high - density_low
    second = share + high * density_high - low * density_low
    return (bias**2 + rest) * share + 2 * bias * slope * first + slope**2 * second


def _last_value(plots: int, degree: int, dt: float) -> np.ndarray:
    """Weights (n,) of the value at the last plot of a polynomial through n plots."""
    powers = (dt * np.arange(1 - plots, 1))[:, None] ** np.arange(degree + 1)
    return np.linalg.pinv(powers)[0]


def _acceleration(plots: int, dt: float) -> np.ndarray:
    """Weights (n,) of the acceleration of a parabola through n plots."""
    powers = (dt * np.arange(1 - plots, 1))[:, None] ** np.arange(3)
    return 2 * np.linalg.pinv(powers)[2]
