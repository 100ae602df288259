"""Exact laws of manoeuvre detectors: false alarms, detection, and delay where tests are independent.

The statistic is â²/σ_a² (P3 eq. 3, with the estimate that the paper omits), where â is the acceleration of a parabola
through n plots. â is linear in the plots, so it is Gaussian where their errors are. The statistic of one coordinate is
χ² with one degree of freedom, noncentral by (mean of â / σ_a)² in a manoeuvre; the sum over C coordinates is χ² with C
degrees of freedom. This holds for any deterministic course."""

from typing import Any

import numpy as np

from radarsim.studies.sonar.conversion import Values


def threshold(false_alarm: Values, coordinates: int | np.ndarray = 1) -> Any:
    """Threshold k of a test that gives an alarm with this probability without a manoeuvre; broadcasts."""
    from scipy import stats  # here, because it takes a second to load

    return stats.chi2.isf(false_alarm, coordinates)


def false_alarm(k: Values, coordinates: int | np.ndarray = 1) -> Any:
    """Probability of an alarm in a test without a manoeuvre: 0.317 at the paper's k = 1; broadcasts."""
    from scipy import stats  # here, because it takes a second to load

    return stats.chi2.sf(k, coordinates)


def detection(k: Values, shift: Values, coordinates: int = 1) -> Any:
    """The probability of an alarm in a test where the mean of â is `shift` σ_a from zero; broadcasts.

    For several coordinates the shift is the root of the sum of squares."""
    from scipy import special, stats  # here, because they take a second to load

    if coordinates == 1:
        return special.ndtr(shift - np.sqrt(k)) + special.ndtr(-shift - np.sqrt(k))
    central = np.asarray(shift) == 0
    noncentrality = np.where(central, 1.0, np.square(shift))
    return np.where(central, stats.chi2.sf(k, coordinates), stats.ncx2.sf(k, coordinates, noncentrality))


def shift_for(probability: float, k: float) -> float:
    """The acceleration, in σ_a, that a test of one coordinate at threshold k detects with this probability.

    Zero if false alarms alone reach the probability. At k = 1 and 0.683 it is 1.456."""
    from scipy.optimize import brentq

    if detection(k, 0.0) >= probability:
        return 0.0
    return float(brentq(lambda shift: detection(k, shift) - probability, 0.0, np.sqrt(k) + 10.0, xtol=1e-12))


def acceleration_law(
    weights: np.ndarray, course: np.ndarray, C: np.ndarray, pushes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance (M,) of an acceleration with weights (M, n) of the plots.

    course (n,) holds the true values, C (n, n) is the covariance of the errors, and pushes (n, m) holds what m
    independent unit accelerations add to the values."""
    moved = weights @ pushes
    return weights @ course, np.einsum("mi,ij,mj->m", weights, C, weights) + (moved**2).sum(axis=1)


def probability_by_then(p: np.ndarray) -> np.ndarray:
    """Probability (…, n) that a first event has come by each of n independent tests of probabilities p (…, n).

    Tests of overlapping windows are not independent; their law is multivariate normal and has no closed form. For them
    this is an upper bound if the target does not manoeuvre and errors are white (Šidák 1967), because alarms come in
    runs."""
    return 1 - np.cumprod(1 - p, axis=-1)
