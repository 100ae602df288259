"""The paper's closed forms, for degree 1, equal intervals and equal weights."""

import numpy as np

from radarsim.studies.sonar.conversion import Values


def sigma_smoothed(n: Values) -> Values:
    """σ of the smoothed coordinate at the last of n plots, per σ of a plot (formula below P3 eq. 2)."""
    return np.sqrt(2 * (2 * n - 1) / (n * (n + 1)))


def sigma_extrapolated(n: Values) -> Values:
    """σ of the coordinate extrapolated by one scan from n plots, per σ of a plot (formula below P3 eq. 2)."""
    return np.sqrt(2 * (2 * n + 1) / (n * (n - 1)))


def sigma_acceleration(n: Values, period: float) -> Values:
    """σ of the acceleration of a quadratic through n plots, per σ of a plot (P3 eq. 3)."""
    return np.sqrt(720 / (n * (n**2 - 1) * (n**2 - 4))) / period**2


def gains_closed(n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A_n and B_n of P3 (14): gains of the residual in coordinate and velocity (per period)."""
    return 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))
