"""Exact laws of P3's detector of manoeuvres: false alarms, detection, and delay where tests are independent.

The statistic is â²/σ_a² (P3 eq. 3, with the estimate that the print leaves out), â the acceleration of a parabola
through n plots: linear in the plots, so Gaussian where their errors are. Alone it is χ² of one degree of freedom,
off-centre by (mean of â / σ_a)² in a manoeuvre; the sum over C coordinates is χ² of C degrees. This holds for any
deterministic course.
"""

import numpy as np


def threshold(false_alarm, coordinates: int = 1):
    """Threshold k whose tests give an alarm with that probability without a manoeuvre; broadcasts."""
    from scipy import stats  # here, for it takes a second to load

    return stats.chi2.isf(false_alarm, coordinates)


def false_alarm(k, coordinates: int = 1):
    """Probability of an alarm a test without a manoeuvre: 0.317 at the paper's k = 1; broadcasts."""
    from scipy import stats  # here, for it takes a second to load

    return stats.chi2.sf(k, coordinates)


def detection(k, shift, coordinates: int = 1):
    """Probability of an alarm a test where the means of â lie `shift` of their σ_a from zero; broadcasts.

    Of several coordinates the shift is the root of the sum of squares.
    """
    from scipy import special, stats  # here, for they take a second to load

    if coordinates == 1:
        return special.ndtr(shift - np.sqrt(k)) + special.ndtr(-shift - np.sqrt(k))
    centred = np.asarray(shift) == 0
    off = np.where(centred, 1.0, np.square(shift))
    return np.where(centred, stats.chi2.sf(k, coordinates), stats.ncx2.sf(k, coordinates, off))


def shift_for(probability: float, k: float) -> float:
    """Acceleration in units of σ_a that one coordinate's test at threshold k detects with that probability.

    Zero where false alarms alone reach it. At k = 1 and 0.683 it is 1.456.
    """
    from scipy.optimize import brentq

    if detection(k, 0.0) >= probability:
        return 0.0
    return float(brentq(lambda shift: detection(k, shift) - probability, 0.0, np.sqrt(k) + 10.0, xtol=1e-12))


def acceleration_law(
    weights: np.ndarray, course: np.ndarray, C: np.ndarray, pushes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance (M,) of an acceleration that is weights (M, n) times plots.

    course (n,) holds the true values, C (n, n) covers the errors, pushes (n, m) what m unit random accelerations add to
    the values.
    """
    moved = weights @ pushes
    return weights @ course, np.einsum("mi,ij,mj->m", weights, C, weights) + (moved**2).sum(axis=1)


def by_then(p: np.ndarray) -> np.ndarray:
    """Probability (…, n) of a first event up to each of n independent tests of probabilities p (…, n).

    Overlapping windows are not independent, and their law is a multivariate normal one without a closed form. Where no
    target manoeuvres and errors are white it is an upper bound there (Šidák 1967): alarms come in runs.
    """
    return 1 - np.cumprod(1 - p, axis=-1)
